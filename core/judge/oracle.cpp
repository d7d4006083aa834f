#include "core/judge/oracle.hpp"

#include "core/base/hasher.hpp"
#include "core/base/interruption.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/judge/polygon_region.hpp"
#include "core/judge/sort_pairs.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/builders.hpp"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <numeric>

namespace kbvh {

namespace {

/// The exact test of two primitives. A polygon is the union of its triangles. Just after polygons are cut,
/// simple planar ones are decided by the even-odd rule instead, without the triangles.
template <class S>
class TrueMeeting {
 public:
  TrueMeeting(const Scene<S>& scene, const Playback<S>& playback)
      : scene_(&scene), playback_(&playback), regions_(scene, playback) {}

  bool operator()(std::uint32_t body_a, std::uint32_t primitive_a, std::uint32_t body_b,
                  std::uint32_t primitive_b) {
    const Primitives &a = scene_->bodies[body_a].primitives, &b = scene_->bodies[body_b].primitives;
    const S *x = playback_->positions(body_a), *y = playback_->positions(body_b);
    if (a.kind != PrimitiveKind::polygons || b.kind != PrimitiveKind::polygons)
      return overlap(primitive_box(a[primitive_a], x), primitive_box(b[primitive_b], y));
    const bool cut_a = regions_.decides(body_a, primitive_a), cut_b = regions_.decides(body_b, primitive_b);
    if ((cut_a || cut_b) && (cut_a || a[primitive_a].size() == 3) && (cut_b || b[primitive_b].size() == 3)) {
      const PolygonRegion* const region_a = regions_.region(body_a, primitive_a);
      const PolygonRegion* const region_b =
          region_a == nullptr ? nullptr : regions_.region(body_b, primitive_b);
      if (region_b != nullptr) return region_a->meets(*region_b);
    }
    TriangleTestStats stats;
    return polygons_intersect<S>(
        a.triangles(primitive_a), [x](std::uint32_t v) { return x + std::size_t(3) * v; },
        b.triangles(primitive_b), [y](std::uint32_t v) { return y + std::size_t(3) * v; }, stats);
  }

 private:
  const Scene<S>* scene_;
  const Playback<S>* playback_;
  PolygonRegions<S> regions_;
};

}  // namespace

template <class S>
PairBuffer brute_force_pairs(const Scene<S>& scene, Playback<S>& playback) {
  playback.evaluate_all();
  PairBuffer result;
  TrueMeeting<S> truly_meet(scene, playback);
  for (const BodyPair& pair : scene.pairs) {
    const Body<S>&a = scene.bodies[pair.first], &b = scene.bodies[pair.second];
    const bool within = pair.first == pair.second;
    const bool one_set = scene.same_vertices(pair.first, pair.second);
    for (std::uint32_t i = 0; i < a.primitives.count(); ++i) {
      Interruptible::check();
      for (std::uint32_t j = within ? i + 1 : 0; j < b.primitives.count(); ++j)
        if (a.primitives.alive(i) && b.primitives.alive(j) &&
            !(one_set && share_vertex(a.primitives[i], b.primitives[j])) &&
            truly_meet(pair.first, i, pair.second, j))
          result.push_back({pair.first, i, pair.second, j});
    }
  }
  sort_pairs(result);
  return result;
}

template <class S>
PairBuffer sweep_pairs(const Scene<S>& scene, Playback<S>& playback) {
  playback.evaluate_all();
  PairBuffer result;
  TrueMeeting<S> truly_meet(scene, playback);
  struct Item {
    Box<S> box;
    std::uint32_t primitive;
  };
  std::vector<std::vector<Box<S>>> boxes_of(scene.bodies.size());
  std::vector<Box<S>> whole(scene.bodies.size());
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
    boxes_of[body] = primitive_boxes(scene.bodies[body].primitives, playback.positions(body));
    for (const Box<S>& box : boxes_of[body]) whole[body].extend(box);
  }
  const auto sorted_items = [&](std::uint32_t body, int axis, const Box<S>& window) {
    const auto& boxes = boxes_of[body];
    std::vector<Item> items;
    for (std::uint32_t p = 0; p < boxes.size(); ++p)
      if (overlap(boxes[p], window)) items.push_back({boxes[p], p});
    std::sort(items.begin(), items.end(),
              [axis](const Item& x, const Item& y) { return x.box.lower[axis] < y.box.lower[axis]; });
    return items;
  };
  for (const BodyPair& pair : scene.pairs) {
    const Box<S>&whole_a = whole[pair.first], &whole_b = whole[pair.second];
    if (!overlap(whole_a, whole_b)) continue;
    const Primitives &a = scene.bodies[pair.first].primitives, &b = scene.bodies[pair.second].primitives;
    const bool one_set = scene.same_vertices(pair.first, pair.second);
    int axis = 0;
    for (int d = 1; d < 3; ++d)
      if (double(whole_a.upper[d]) - double(whole_a.lower[d]) >
          double(whole_a.upper[axis]) - double(whole_a.lower[axis]))
        axis = d;
    const auto items_a = sorted_items(pair.first, axis, whole_b),
               items_b = sorted_items(pair.second, axis, whole_a);
    const auto report = [&](const Item& x, const Item& y) {
      // Each pair within one body is found twice: from both lists.
      if (pair.first == pair.second && x.primitive >= y.primitive) return;
      if (one_set && share_vertex(a[x.primitive], b[y.primitive])) return;
      if (overlap(x.box, y.box) && truly_meet(pair.first, x.primitive, pair.second, y.primitive))
        result.push_back({pair.first, x.primitive, pair.second, y.primitive});
    };
    // Two sorted lists: the item that starts first scans ahead in the other list. Equal starts are handled
    // from a's side.
    std::size_t i = 0, j = 0;
    while (i < items_a.size() && j < items_b.size()) {
      Interruptible::check();
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
  sort_pairs(result);
  return result;
}

namespace {
constexpr std::uint64_t cache_magic =
    0x6b62766f72633033ull;  // "kbvorc03": change it with the format or the test
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
  std::error_code error;
  if (std::filesystem::exists(file_, error) && !load())
    problem_ = file_.string() + ": damaged or of another version; true pairs are recomputed";
}

template <class S>
Oracle<S>::~Oracle() {
  keep();
}

template <class S>
void Oracle<S>::keep() {
  if (!grown_ || file_.empty()) return;
  grown_ = false;
  bool written = false;
  try {
    written = save();
  } catch (const std::exception&) {
  }
  if (!written) problem_ = file_.string() + ": cannot be written; true pairs are not cached";
}

template <class S>
const PairBuffer& Oracle<S>::pairs(Playback<S>& playback) {
  const auto [entry, fresh] = known_.try_emplace(playback.time());
  if (fresh) {
    entry->second = sweep_pairs(*scene_, playback);
    grown_ = true;
  }
  return entry->second;
}

template <class S>
const PairBuffer& Oracle<S>::pairs(Playback<S>& playback, const Scene<S>& scene, std::uint32_t changes) {
  if (changes == 0) return pairs(playback);
  const auto [entry, fresh] = changed_.try_emplace({changes, playback.time()});
  if (fresh) entry->second = sweep_pairs(scene, playback);
  return entry->second;
}

template <class S>
const PairBuffer* Oracle<S>::known(double t, std::uint32_t changes) const {
  if (changes == 0) {
    const auto entry = known_.find(t);
    return entry == known_.end() ? nullptr : &entry->second;
  }
  const auto entry = changed_.find({changes, t});
  return entry == changed_.end() ? nullptr : &entry->second;
}

/// File format: magic, number of times, size in bytes; for each time t, number of pairs, pairs; hash of all
/// preceding bytes.
template <class S>
bool Oracle<S>::load() {
  std::ifstream in(file_, std::ios::binary | std::ios::ate);
  const auto size = std::uint64_t(std::max<std::streamoff>(in.tellg(), 0));
  in.seekg(0);
  Hasher hasher;
  const auto read = [&](void* to, std::size_t bytes) {
    if (!in.read(static_cast<char*>(to), std::streamsize(bytes))) return false;
    hasher.bytes(to, bytes);
    return true;
  };
  std::uint64_t head[3];
  if (!read(head, sizeof head) || head[0] != cache_magic || head[2] != size) return false;
  std::map<double, PairBuffer> known;
  for (std::uint64_t i = 0; i < head[1]; ++i) {
    double t = 0;
    std::uint64_t count = 0;
    if (!read(&t, sizeof t) || !read(&count, sizeof count) || count > size / sizeof(PrimitivePair))
      return false;
    PairBuffer pairs(count);
    if (!read(pairs.data(), count * sizeof(PrimitivePair))) return false;
    known.emplace(t, std::move(pairs));
  }
  const std::uint64_t expected = hasher.value();
  std::uint64_t found = 0;
  if (!read(&found, sizeof found) || found != expected) return false;
  known_ = std::move(known);
  return true;
}

template <class S>
bool Oracle<S>::save() const {
  std::filesystem::create_directories(file_.parent_path());
  auto temporary = file_;
  temporary += "." + std::to_string(::getpid());
  {
    std::ofstream out(temporary, std::ios::binary);
    Hasher hasher;
    const auto write = [&](const void* from, std::size_t bytes) {
      out.write(static_cast<const char*>(from), std::streamsize(bytes));
      hasher.bytes(from, bytes);
    };
    std::uint64_t head[3] = {cache_magic, known_.size(), sizeof head + 8};
    for (const auto& [t, pairs] : known_) head[2] += 16 + pairs.size() * sizeof(PrimitivePair);
    write(head, sizeof head);
    for (const auto& [t, pairs] : known_) {
      const std::uint64_t count = pairs.size();
      write(&t, sizeof t);
      write(&count, sizeof count);
      write(pairs.data(), count * sizeof(PrimitivePair));
    }
    const std::uint64_t check = hasher.value();
    write(&check, sizeof check);
    if (!out.flush()) {
      out.close();
      std::error_code ignored;
      std::filesystem::remove(temporary, ignored);
      return false;
    }
  }
  std::filesystem::rename(temporary, file_);
  return true;
}

#define KBVH_INSTANTIATE(S)                                             \
  template PairBuffer brute_force_pairs(const Scene<S>&, Playback<S>&); \
  template PairBuffer sweep_pairs(const Scene<S>&, Playback<S>&);       \
  template class Oracle<S>;
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
