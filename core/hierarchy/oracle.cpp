#include "core/hierarchy/oracle.hpp"

#include "core/hierarchy/builders.hpp"
#include "core/hierarchy/self_pairs.hpp"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <numeric>

namespace kbvh {

namespace {

template <class S>
bool truly_meet(const Body<S>& a, std::uint32_t primitive_a, const S* positions_a, const Body<S>& b,
                std::uint32_t primitive_b, const S* positions_b) {
  const auto polygon_a = a.primitives[primitive_a], polygon_b = b.primitives[primitive_b];
  if (a.primitives.kind != PrimitiveKind::polygons || b.primitives.kind != PrimitiveKind::polygons)
    return overlap(primitive_box(polygon_a, positions_a), primitive_box(polygon_b, positions_b));
  TriangleTestStats stats;
  return polygons_intersect<S>(
      polygon_a, [&](std::uint32_t v) { return positions_a + std::size_t(3) * v; }, polygon_b,
      [&](std::uint32_t v) { return positions_b + std::size_t(3) * v; }, stats);
}

}  // namespace

template <class S>
std::vector<PrimitivePair> brute_force_pairs(const Scene<S>& scene, Playback<S>& playback) {
  playback.evaluate_all();
  std::vector<PrimitivePair> result;
  for (const BodyPair& pair : scene.pairs) {
    const Body<S>&a = scene.bodies[pair.first], &b = scene.bodies[pair.second];
    const bool within = pair.first == pair.second;
    for (std::uint32_t i = 0; i < a.primitives.count(); ++i)
      for (std::uint32_t j = within ? i + 1 : 0; j < b.primitives.count(); ++j)
        if (a.primitives.alive(i) && b.primitives.alive(j) &&
            !(within && share_vertex(a.primitives[i], a.primitives[j])) &&
            truly_meet(a, i, playback.positions(pair.first), b, j, playback.positions(pair.second)))
          result.push_back({pair.first, i, pair.second, j});
  }
  std::sort(result.begin(), result.end());
  return result;
}

template <class S>
std::vector<PrimitivePair> sweep_pairs(const Scene<S>& scene, Playback<S>& playback) {
  playback.evaluate_all();
  std::vector<PrimitivePair> result;
  struct Item {
    Box<S> box;
    std::uint32_t primitive;
  };
  const auto sorted_items = [&](std::uint32_t body, int axis, const Box<S>& window) {
    const auto boxes = primitive_boxes(scene.bodies[body].primitives, playback.positions(body));
    std::vector<Item> items;
    for (std::uint32_t p = 0; p < boxes.size(); ++p)
      if (overlap(boxes[p], window)) items.push_back({boxes[p], p});
    std::sort(items.begin(), items.end(),
              [axis](const Item& x, const Item& y) { return x.box.lower[axis] < y.box.lower[axis]; });
    return items;
  };
  for (const BodyPair& pair : scene.pairs) {
    const Body<S>&a = scene.bodies[pair.first], &b = scene.bodies[pair.second];
    const S* positions_a = playback.positions(pair.first);
    const S* positions_b = playback.positions(pair.second);
    Box<S> whole_a, whole_b;
    for (const auto& box : primitive_boxes(a.primitives, positions_a)) whole_a.extend(box);
    for (const auto& box : primitive_boxes(b.primitives, positions_b)) whole_b.extend(box);
    if (!overlap(whole_a, whole_b)) continue;
    int axis = 0;
    for (int d = 1; d < 3; ++d)
      if (double(whole_a.upper[d]) - double(whole_a.lower[d]) >
          double(whole_a.upper[axis]) - double(whole_a.lower[axis]))
        axis = d;
    const auto items_a = sorted_items(pair.first, axis, whole_b),
               items_b = sorted_items(pair.second, axis, whole_a);
    const auto report = [&](const Item& x, const Item& y) {
      if (pair.first == pair.second &&
          (x.primitive >= y.primitive || share_vertex(a.primitives[x.primitive], a.primitives[y.primitive])))
        return;  // each of these pairs is seen twice: of both lists
      if (overlap(x.box, y.box) && truly_meet(a, x.primitive, positions_a, b, y.primitive, positions_b))
        result.push_back({pair.first, x.primitive, pair.second, y.primitive});
    };
    // Two sorted lists: whichever starts first looks ahead in the other. Equal starts are seen from a's side.
    std::size_t i = 0, j = 0;
    while (i < items_a.size() && j < items_b.size()) {
      if (items_a[i].box.lower[axis] <= items_b[j].box.lower[axis]) {
        for (std::size_t k = j;
             k < items_b.size() && items_b[k].box.lower[axis] <= items_a[i].box.upper[axis]; ++k)
          report(items_a[i], items_b[k]);
        ++i;
      } else {
        for (std::size_t k = i;
             k < items_a.size() && items_a[k].box.lower[axis] <= items_b[j].box.upper[axis]; ++k)
          report(items_a[k], items_b[j]);
        ++j;
      }
    }
  }
  std::sort(result.begin(), result.end());
  return result;
}

namespace {
constexpr std::uint64_t cache_magic =
    0x6b62766f72633031ull;  // "kbvorc01": change with the format or the test
}

template <class S>
Oracle<S>::Oracle(const Scene<S>& scene, std::filesystem::path cache_folder, std::uint64_t script)
    : scene_(&scene), script_(script) {
  if (cache_folder.empty()) return;
  char file_name[64];
  if (script == 0)
    std::snprintf(file_name, sizeof file_name, "oracle-%016llx.bin",
                  static_cast<unsigned long long>(hash(scene)));
  else
    std::snprintf(file_name, sizeof file_name, "oracle-%016llx-%016llx.bin",
                  static_cast<unsigned long long>(hash(scene)), static_cast<unsigned long long>(script));
  file_ = cache_folder / file_name;
  load();
}

template <class S>
Oracle<S>::~Oracle() {
  try {
    if (grown_ && !file_.empty()) save();
  } catch (...) {  // a cache that cannot be written costs time, never a result
  }
}

template <class S>
const std::vector<PrimitivePair>& Oracle<S>::pairs(Playback<S>& playback) {
  const auto [entry, fresh] = known_.try_emplace(playback.time());
  if (fresh) {
    entry->second = sweep_pairs(*scene_, playback);
    grown_ = true;
  }
  return entry->second;
}

template <class S>
void Oracle<S>::load() {
  std::ifstream in(file_, std::ios::binary | std::ios::ate);
  if (!in) return;
  const auto size = std::uint64_t(in.tellg());
  in.seekg(0);
  const auto read = [&](auto& value) { return bool(in.read(reinterpret_cast<char*>(&value), sizeof value)); };
  std::uint64_t magic = 0, times = 0, total = 0;
  if (!read(magic) || magic != cache_magic || !read(times) || !read(total) || total != size) return;
  std::map<double, std::vector<PrimitivePair>> known;
  for (std::uint64_t i = 0; i < times; ++i) {
    double t = 0;
    std::uint64_t count = 0;
    if (!read(t) || !read(count) || count > size / sizeof(PrimitivePair)) return;
    std::vector<PrimitivePair> pairs(count);
    if (!in.read(reinterpret_cast<char*>(pairs.data()), std::streamsize(count * sizeof(PrimitivePair))))
      return;
    known.emplace(t, std::move(pairs));
  }
  known_ = std::move(known);
}

template <class S>
void Oracle<S>::save() const {
  std::filesystem::create_directories(file_.parent_path());
  auto temporary = file_;
  temporary += "." + std::to_string(::getpid());
  {
    std::ofstream out(temporary, std::ios::binary);
    const auto write = [&](const auto& value) {
      out.write(reinterpret_cast<const char*>(&value), sizeof value);
    };
    std::uint64_t total = 24;
    for (const auto& [t, pairs] : known_) total += 16 + pairs.size() * sizeof(PrimitivePair);
    write(cache_magic);
    write(std::uint64_t(known_.size()));
    write(total);
    for (const auto& [t, pairs] : known_) {
      write(t);
      write(std::uint64_t(pairs.size()));
      out.write(reinterpret_cast<const char*>(pairs.data()),
                std::streamsize(pairs.size() * sizeof(PrimitivePair)));
    }
    if (!out.flush()) {
      std::filesystem::remove(temporary);
      return;
    }
  }
  std::filesystem::rename(temporary, file_);
}

#define KBVH_INSTANTIATE(S)                                                             \
  template std::vector<PrimitivePair> brute_force_pairs(const Scene<S>&, Playback<S>&); \
  template std::vector<PrimitivePair> sweep_pairs(const Scene<S>&, Playback<S>&);       \
  template class Oracle<S>;
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
