// Faults seeded into the SIMD spheres and oriented boxes: the checks that every strategy passes find each of
// them.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/volumes/obb_hierarchy.hpp"
#include "core/families/volumes/sphere_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::lane_volume_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  rounded_down,  ///< radii or halves too small by 2^-16 of themselves: more than all margins of roundings
  child_left,    ///< spheres of inner nodes that do not reach the points below their last child
  late,          ///< volumes of points that have since moved
  forgetful,     ///< a search that loses a pair now and then
};

/// Any hierarchy of volumes in lanes, with a fault.
template <class Base, Fault fault>
class Faulty : public Base {
  using S = typename Base::Scalar;

 public:
  Faulty(Topology topology, const Primitives& primitives, Cover cover)
      : Base(std::move(topology), primitives, cover), primitives_(&primitives) {
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      for (const std::uint32_t v : primitives[p]) scalars_ = std::max(scalars_, std::size_t(3) * v + 3);
  }
  void refit(const S* positions) {
    if (fault == Fault::late) {
      moved_.assign(positions, positions + scalars_);
      for (S& x : moved_) x *= S(1 - 2e-4);
      moved_.push_back(0);
    }
    Base::refit(fault == Fault::late ? moved_.data() : positions);
    for (std::uint32_t node = 0; node < this->topology().size(); ++node) {
      auto volume = this->volume(node);
      if (fault == Fault::rounded_down) shrink(volume);
      if (fault == Fault::child_left && !this->topology().nodes[node].is_leaf())
        leave_last(volume, node, positions);
      this->set_volume(node, volume);
    }
  }
  static std::size_t find_pairs(Faulty& a, std::uint32_t body_a, Faulty& b, std::uint32_t body_b,
                                typename Base::Scratch& scratch, std::uint64_t& tests, const Budget& budget,
                                PairBuffer& out) {
    const std::size_t before = out.size();
    const std::size_t pending = Base::find_pairs(a, body_a, b, body_b, scratch, tests, budget, out);
    std::size_t kept = before;
    for (std::size_t i = before; i < out.size(); ++i)
      if (fault != Fault::forgetful || i % 20 != 19) out[kept++] = out[i];
    out.resize(kept);
    return pending;
  }

 private:
  static void shrink(Sphere<S>& sphere) { sphere.radius *= S(1 - 0x1p-16); }
  static void shrink(Obb<S>& box) {
    for (S& half : box.half) half *= S(1 - 0x1p-10);
  }
  template <class V>
  void leave_last(V& volume, std::uint32_t node, const S* positions) const {
    if constexpr (requires { volume.radius; }) {
      const TopologyNode content = this->topology().nodes[node];
      double reach = 0;
      std::vector<std::uint32_t> open;
      for (std::uint32_t c = content.first(); c + 1 < content.first() + content.count(); ++c)
        open.push_back(c);
      while (!open.empty()) {
        const TopologyNode below = this->topology().nodes[open.back()];
        open.pop_back();
        for (std::uint32_t k = below.first(); k < below.first() + below.count(); ++k) {
          if (!below.is_leaf()) {
            open.push_back(k);
            continue;
          }
          for (const std::uint32_t v : (*primitives_)[this->topology().primitives[k]]) {
            double way[3];
            outward::difference(positions + 3 * v, volume.centre, way);
            reach = std::max(reach, outward::length_above(way));
          }
        }
      }
      volume.radius = std::min(volume.radius, outward::up<S>(reach));
    }
  }

  const Primitives* primitives_;
  std::size_t scalars_ = 0;
  std::vector<S> moved_;
};

template <template <class> class Base, Fault fault>
struct FaultyStrategy {
  template <class S>
  class Strategy : public HierarchyStrategy<S, Faulty<Base<S>, fault>> {
   public:
    Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params&)
        : HierarchyStrategy<S, Faulty<Base<S>, fault>>(scene, motion, std::move(topologies), 0) {}
  };
};
template <class S>
using Wrapped = SphereHierarchy<S, SphereBounds::wrapped>;
template <class S>
using Layered = SphereHierarchy<S, SphereBounds::layered>;

template <template <class> class Base, Fault fault>
std::string violation() {
  Info info;
  info.id = "faulty_lanes";
  info.tightness = Tightness::conservative;
  info.topology.widths = {8};
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 2};
  const StrategyEntry entry = make_entry<FaultyStrategy<Base, fault>::template Strategy>(std::move(info));
  return check(entry, synthetic_scene<float>("soups", 7), 7, {}, entry.info.topology.preferred);
}

template <template <class> class Base>
void expect_found() {
  EXPECT_EQ((violation<Base, Fault::none>()), "");
  EXPECT_NE((violation<Base, Fault::rounded_down>().find("protrudes")), std::string::npos);
  EXPECT_NE((violation<Base, Fault::late>()), "");
  const std::string forgotten = violation<Base, Fault::forgetful>();
  EXPECT_NE(forgotten, "");
  EXPECT_EQ(forgotten.find("protrudes"), std::string::npos) << forgotten;
}

TEST(LaneVolumeFaults, AreFoundInWrappedSpheres) {
  expect_found<Wrapped>();
  EXPECT_NE((violation<Wrapped, Fault::child_left>().find("protrudes")), std::string::npos);
}
TEST(LaneVolumeFaults, AreFoundInLayeredSpheres) {
  expect_found<Layered>();
}
TEST(LaneVolumeFaults, AreFoundInOrientedBoxes) {
  expect_found<ObbHierarchy>();
}

}  // namespace
}  // namespace kbvh::test::lane_volume_faults_test
