#include "experiments/study/box_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <span>
#include <utility>

#include "core/judge/session.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

namespace {

/// Features of one kind as primitives over the vertices of two frames. With a margin every vertex becomes
/// two: its lowest and its highest corner.
class Features {
 public:
  Features(const FramePair& frames, BoxMargin margin) : margin_(margin) {
    const std::size_t values = frames.positions[0].size();
    std::vector<double> low(2 * values), high(2 * values);
    for (std::size_t f = 0; f < 2; ++f)
      for (std::size_t i = 0; i < values; ++i) {
        const auto value = float(frames.positions[f][i]);
        constexpr float far = std::numeric_limits<float>::infinity();
        low[f * values + i] =
            margin == BoxMargin::none ? frames.positions[f][i] : std::nextafter(value, -far);
        high[f * values + i] =
            margin == BoxMargin::none ? frames.positions[f][i] : std::nextafter(value, far);
      }
    vertices_ = std::uint32_t(values / 3);
    if (margin == BoxMargin::none) {
      positions_ = std::move(low);
      return;
    }
    for (std::size_t f = 0; f < 2; ++f) {
      positions_.insert(positions_.end(), low.begin() + std::ptrdiff_t(f * values),
                        low.begin() + std::ptrdiff_t((f + 1) * values));
      positions_.insert(positions_.end(), high.begin() + std::ptrdiff_t(f * values),
                        high.begin() + std::ptrdiff_t((f + 1) * values));
    }
  }

  /// Makes a primitive of each list of vertices.
  template <class Lists>
  Primitives primitives(const Lists& lists) const {
    Primitives made;
    made.kind = PrimitiveKind::control_nets;
    std::vector<std::uint32_t> primitive;
    for (const auto& list : lists) {
      primitive.assign(list.begin(), list.end());
      if (margin_ == BoxMargin::one_ulp)
        for (const std::uint32_t v : list) primitive.push_back(vertices_ + v);
      made.add(primitive);
    }
    return made;
  }
  FlightPlans<double> plans() const {
    const std::uint32_t count = margin_ == BoxMargin::none ? vertices_ : 2 * vertices_;
    return FlightPlans<double>(count, {0.0, 1.0}, positions_);
  }

 private:
  BoxMargin margin_;
  std::uint32_t vertices_ = 0;
  std::vector<double> positions_;  ///< [frame][vertex][3]
};

PairBuffer swept(const Scene<double>& scene, const std::string& strategy) {
  const StrategyEntry& entry = strategy_named(strategy);
  if (!entry.info.can.contacts)
    throw io::InputError("the strategy '" + strategy + "' finds no contacts, so it has no swept pairs");
  Session<double> session(scene, {&entry, {}, entry.info.topology.preferred});
  session.reset(0);
  // All bodies have the same vertices.
  const double* const positions = session.playback().positions(0);
  const std::vector<double> copy(positions,
                                 positions + std::size_t(3) * scene.bodies[0].plans.vertex_count() + 1);
  const std::vector<const double*> before(scene.bodies.size(), copy.data());
  session.strategy().start_sweep(0);
  session.playback().seek(1);
  session.playback().evaluate_all();
  PairBuffer pairs;
  session.strategy().swept_pairs(0, 1, before, pairs);
  return pairs;
}

using Ids = std::pair<std::uint32_t, std::uint32_t>;

}  // namespace

BoxCandidates box_candidates(const FramePair& frames, BoxMargin margin, const std::string& strategy) {
  const Features features(frames, margin);
  std::vector<std::array<std::uint32_t, 1>> vertices;
  for (std::uint32_t v = 0; v < frames.positions[0].size() / 3; ++v) vertices.push_back({v});
  Scene<double> scene;
  scene.name = frames.name;
  scene.bodies.push_back({"vertices", features.primitives(vertices), features.plans()});
  add_body_over(scene, 0, "faces", features.primitives(frames.faces));
  add_body_over(scene, 0, "edges", features.primitives(frames.edges));
  scene.pairs = {{0, 1}, {2, 2}};
  BoxCandidates found;
  std::set<Ids> touching[2];
  for (const FramePair::Listed& pair : frames.listed) {
    if (!pair.touches) continue;
    const bool edges = pair.kind == Contact::Kind::edge_edge;
    touching[edges ? 1 : 0].insert(edges ? Ids(std::minmax(pair.first, pair.second))
                                         : Ids(pair.first, pair.second));
  }
  found.touching = touching[0].size() + touching[1].size();
  for (const PrimitivePair& pair : swept(scene, strategy)) {
    if (pair.body_a == 2) {
      const auto &a = frames.edges[pair.primitive_a], &b = frames.edges[pair.primitive_b];
      if (a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1]) continue;
      ++found.edge_edge;
      touching[1].erase(std::minmax(pair.primitive_a, pair.primitive_b));
    } else {
      const auto& face = frames.faces[pair.primitive_b];
      if (std::find(face.begin(), face.end(), pair.primitive_a) != face.end()) continue;
      ++found.vertex_face;
      touching[0].erase({pair.primitive_a, pair.primitive_b});
    }
  }
  found.missed = touching[0].size() + touching[1].size();
  return found;
}

PublishedCandidates published_candidates(const std::string& name) {
  // Belgrod et al. 2023, the tests of their Scalable-CCD and of the IPC toolkit: frames 92 and 93.
  if (name == "cloth-ball") return {1'655'541, 5'197'332};
  return {};
}

}  // namespace kbvh::experiments
