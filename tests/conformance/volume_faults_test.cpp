// An audit of the volumes themselves finds volumes that are a little too small; an audit of the boxes around
// them would not.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/volumes/dop_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/geometry/volumes/obb.hpp"
#include "core/geometry/volumes/sphere.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::volume_faults_test {
namespace {

constexpr double shrinkage = 2e-4;

// Shrinks each kind where boxes do not show it: a k-DOP only along its diagonals.
template <class S, int K>
Dop<S, K> shrunk(Dop<S, K> dop) {
  for (std::size_t slab = 3; slab < dop.slabs; ++slab) {
    const S by = S(0.5 * shrinkage * (double(dop.upper[slab]) - double(dop.lower[slab])));
    dop.lower[slab] += by;
    dop.upper[slab] -= by;
  }
  return dop;
}
template <class S>
Sphere<S> shrunk(Sphere<S> sphere) {
  sphere.radius *= S(1 - shrinkage);
  return sphere;
}
template <class S>
Obb<S> shrunk(Obb<S> box) {
  for (S& half : box.half) half *= S(1 - shrinkage);
  return box;
}

enum class Fault : std::uint8_t { none, shrunk };
/// What the audit is shown: the volumes, or boxes that enclose them.
enum class Shown : std::uint8_t { volumes, boxes };

/// Shrinks all volumes whose enclosing boxes do not reveal it.
template <class S, class V, Fault fault, Shown shown>
class FaultyVolumes : public VolumeStrategy<S, V> {
  using Base = VolumeStrategy<S, V>;

 public:
  FaultyVolumes(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                const Params&)
      : Base(scene, motion, std::move(topologies), 0) {}
  void reset_to(double t) override {
    Base::reset_to(t);
    shrink();
  }
  void advance_to(double t) override {
    Base::advance_to(t);
    shrink();
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    std::optional<AuditView> view = Base::audit_view(body);
    if (shown == Shown::volumes) return view;
    view->volumes = nullptr;
    return view;
  }

 private:
  void shrink() {
    if (fault == Fault::none) return;
    this->on_bodies([&](auto& bodies) {
      for (std::uint32_t body = 0; body < bodies.size(); ++body) {
        VolumeHierarchy<V>& hierarchy = bodies[body];
        hierarchy.refit(this->sampled_.positions(body));  // bodies at rest are shrunk once, too
        VolumeHierarchy<Box<S>> tight(hierarchy.topology(), this->scene_.primitives(body), Cover::vertices);
        tight.refit(this->sampled_.positions(body));
        for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
          const V smaller = shrunk(hierarchy.volume(node));
          if (enclosing_box(smaller).contains(to_double(tight.volume(node))))
            hierarchy.set_volume(node, smaller);
        }
      }
    });
  }
};

template <template <class> class V, Fault fault, Shown shown>
struct Faulty {
  template <class S>
  using Strategy = FaultyVolumes<S, V<S>, fault, shown>;
};
template <class S>
using Dop18 = Dop<S, 18>;

template <template <class> class V, Fault fault, Shown shown>
std::string violation() {
  Info info;
  info.id = "faulty_volumes";
  info.tightness = Tightness::conservative;
  info.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  const StrategyEntry entry = make_entry<Faulty<V, fault, shown>::template Strategy>(std::move(info));
  const BuilderConfig builder = entry.info.topology.preferred;
  return check(entry, synthetic_scene<float>("soups", 7), 7, {}, builder) + "|" +
         check(entry, synthetic_scene<double>("soups", 7), 7, {}, builder);
}

template <template <class> class V>
void expect_found_by_volumes_only() {
  EXPECT_EQ((violation<V, Fault::none, Shown::volumes>()), "|");
  const std::string found = violation<V, Fault::shrunk, Shown::volumes>();
  const std::size_t bar = found.find('|');
  EXPECT_NE(found.substr(0, bar).find("protrudes"), std::string::npos) << "in float: " << found;
  EXPECT_NE(found.substr(bar + 1).find("protrudes"), std::string::npos) << "in double: " << found;
  EXPECT_EQ((violation<V, Fault::shrunk, Shown::boxes>()), "|")
      << "boxes have seen it, too: nothing is shown";
}

TEST(VolumeFaults, AShrunkDopIsFoundByVolumesOnly) {
  expect_found_by_volumes_only<Dop18>();
}
TEST(VolumeFaults, AShrunkSphereIsFoundByVolumesOnly) {
  expect_found_by_volumes_only<Sphere>();
}
TEST(VolumeFaults, AShrunkOrientedBoxIsFoundByVolumesOnly) {
  expect_found_by_volumes_only<Obb>();
}

// A single leaf or parent that is too small by one unit in the last place suffices: every volume is tested
// with every vertex below it, independently of its children.
template <class V>
void expect_one_node_is_enough() {
  using S = VolumeScalar<V>;
  const auto test = synthetic_scene<S>("soups");
  const Body<S>& body = test.scene.bodies[0];
  Playback<S> playback(test.scene);
  playback.seek(test.frames[0]);
  playback.evaluate_all();
  const S* const positions = playback.positions(0);
  const Topology topology =
      build_topology(body.primitives, positions, {.method = BuildMethod::median, .width = 2, .leaf_size = 2});
  VolumeHierarchy<V> hierarchy(topology, body.primitives, Cover::vertices);
  hierarchy.refit(positions);
  for (const std::uint32_t faulty : {0u, 1u, topology.size() - 1}) {
    std::vector<V> volumes = hierarchy.volumes();
    AuditView view{topology, {}, {}};
    for (const V& volume : volumes) view.boxes.push_back(enclosing_box(volume));
    view.volumes = std::make_shared<AuditedVolumes<V>>(volumes);
    const Audit sound = audit(view, body.primitives, positions);
    EXPECT_EQ(sound.topology_error + sound.first_fault, "");
    EXPECT_EQ(sound.nodes, topology.size());
    EXPECT_GT(sound.area, 0);
    // Fits its own points, then shrinks by one unit.
    std::vector<S> points;
    std::vector<std::uint32_t> open{faulty};
    while (!open.empty()) {
      const TopologyNode node = topology.nodes[open.back()];
      const std::uint32_t id = open.back();
      open.pop_back();
      if (node.is_leaf())
        for (const std::uint32_t v : hierarchy.vertices(id))
          points.insert(points.end(), positions + 3 * v, positions + 3 * v + 3);
      else
        for (std::uint32_t child = node.first(); child < node.first() + node.count(); ++child)
          open.push_back(child);
    }
    fit(volumes[faulty], PointSet<S>(points.data(), points.size() / 3));
    view.volumes = std::make_shared<AuditedVolumes<V>>(volumes);
    EXPECT_EQ(audit(view, body.primitives, positions).invalid, 0u) << faulty;
    if constexpr (requires { volumes[faulty].radius; })
      volumes[faulty].radius = std::nextafter(volumes[faulty].radius, S(0));
    else if constexpr (requires { volumes[faulty].half; })
      volumes[faulty].half[0] = std::nextafter(std::nextafter(volumes[faulty].half[0], S(0)), S(0));
    else
      volumes[faulty].upper[4] = std::nextafter(volumes[faulty].upper[4], S(-1e38));
    view.volumes = std::make_shared<AuditedVolumes<V>>(volumes);
    const Audit found = audit(view, body.primitives, positions);
    EXPECT_EQ(found.invalid, 1u) << faulty;
    EXPECT_GT(found.protrusion, 0) << faulty;
    EXPECT_NE(found.first_fault.find("node " + std::to_string(faulty)), std::string::npos)
        << found.first_fault;
    // Stale nodes are skipped, and a hierarchy with a missing volume is not sound.
    view.stale.assign(topology.size(), 0);
    view.stale[faulty] = 1;
    EXPECT_EQ(audit(view, body.primitives, positions).invalid, 0u);
    view.stale.clear();
    volumes.pop_back();
    view.volumes = std::make_shared<AuditedVolumes<V>>(volumes);
    EXPECT_NE(audit(view, body.primitives, positions).topology_error, "");
    view.volumes = std::make_shared<AuditedVolumes<V>>(hierarchy.volumes());
    EXPECT_EQ(audit(view, body.primitives, positions).topology_error, "");
    view.boxes.pop_back();
    EXPECT_NE(audit(view, body.primitives, positions).topology_error, "");
  }
}
TEST(VolumeFaults, OneNodeIsEnough) {
  expect_one_node_is_enough<Dop<float, 18>>();
  expect_one_node_is_enough<Dop<double, 18>>();
  expect_one_node_is_enough<Sphere<float>>();
  expect_one_node_is_enough<Obb<float>>();
}

// SIMD k-DOPs: sides of points that have since moved, and a search that now and then loses a pair of leaves.
enum class DopFault : std::uint8_t { none, late, forgetful };
template <class S, DopFault fault>
class FaultyDops : public DopHierarchy<S, 18> {
  using Base = DopHierarchy<S, 18>;

 public:
  FaultyDops(Topology topology, const Primitives& primitives, Cover cover)
      : Base(std::move(topology), primitives, cover) {
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      for (const std::uint32_t v : primitives[p]) scalars_ = std::max(scalars_, std::size_t(3) * v + 3);
  }
  void refit(const S* positions) {
    if (fault == DopFault::late) {
      late_.assign(positions, positions + scalars_);
      for (S& x : late_) x *= S(1 - shrinkage);
      late_.push_back(0);
    }
    Base::refit(fault == DopFault::late ? late_.data() : positions);
  }
  template <class OnLeaves>
  static std::size_t search(const FaultyDops& a, const FaultyDops& b, typename Base::Scratch& scratch,
                            std::uint64_t& tests, const Budget& budget, OnLeaves&& on_leaves) {
    std::size_t met = 0;
    return Base::search(a, b, scratch, tests, budget, [&](std::uint32_t p, std::uint32_t q) {
      if (fault != DopFault::forgetful || ++met % 20 != 0) on_leaves(p, q);
    });
  }

 private:
  std::size_t scalars_ = 0;
  std::vector<S> late_;
};
template <DopFault fault>
struct FaultyKdop {
  template <class S>
  class Strategy : public HierarchyStrategy<S, FaultyDops<S, fault>> {
   public:
    Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params&)
        : HierarchyStrategy<S, FaultyDops<S, fault>>(scene, motion, std::move(topologies), 0) {}
  };
};
template <DopFault fault>
std::string kdop_violation() {
  Info info;
  info.id = "faulty_kdop";
  info.tightness = Tightness::conservative;
  info.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  const StrategyEntry entry = make_entry<FaultyKdop<fault>::template Strategy>(std::move(info));
  return check(entry, synthetic_scene<float>("soups", 7), 7, {}, entry.info.topology.preferred);
}

TEST(VolumeFaults, LateAndForgetfulDopsAreFound) {
  EXPECT_EQ(kdop_violation<DopFault::none>(), "");
  EXPECT_NE(kdop_violation<DopFault::late>().find("protrudes"), std::string::npos);
  const std::string forgotten = kdop_violation<DopFault::forgetful>();
  EXPECT_NE(forgotten, "");
  EXPECT_EQ(forgotten.find("protrudes"), std::string::npos) << forgotten;
}

}  // namespace
}  // namespace kbvh::test::volume_faults_test
