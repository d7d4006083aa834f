// The generic refit with every kind of volume over every synthetic scene, and on topologies that are rotated
// at every frame.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "core/families/volumes/volume_strategy.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/geometry/volumes/obb.hpp"
#include "core/geometry/volumes/sphere.hpp"
#include "core/judge/audit.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::volumes_test {
namespace {

/// Returns the violations in both scalars; nothing if there are none, or if the scene is unsuitable.
std::string violations(const StrategyEntry& entry, const std::string& scene, std::uint32_t l,
                       const std::map<std::string, std::string>& params) {
  const BuilderConfig& builder = entry.info.topology.preferred;
  return check(entry, synthetic_scene<float>(scene, l), l, params, builder) + "|" +
         (in_both_scalars() ? check(entry, synthetic_scene<double>(scene, l), l, params, builder) : "");
}

std::vector<std::string> volume_words() {
  for (const Parameter& parameter : find_strategy("bottom_up_volumes").info.parameters)
    if (parameter.name == "volume") return parameter.allowed;
  return {};
}

class EveryVolume : public testing::TestWithParam<std::tuple<std::string, std::string>> {};

TEST_P(EveryVolume, ConformsOnEveryScene) {
  const auto& [volume, scene] = GetParam();
  const StrategyEntry& entry = find_strategy("bottom_up_volumes");
  EXPECT_EQ(violations(entry, scene, 3, {{"volume", volume}}), "|");
}

INSTANTIATE_TEST_SUITE_P(Registry, EveryVolume,
                         testing::Combine(testing::ValuesIn(volume_words()),
                                          testing::ValuesIn(all_synthetic_names())),
                         [](const auto& test) {
                           return std::get<0>(test.param) + "_on_" + std::get<1>(test.param);
                         });

// Boxes and k-DOPs are tight, although the strategy as a whole declares only that it is conservative; and the
// boxes are those of the reference refit.
TEST(EveryVolume, OfFixedDirectionsIsTight) {
  for (const std::string volume : {"aabb", "dop14", "dop18", "dop26"})
    for (const std::string scene : {"soups", "sheets", "pure_translation_far", "integer_ties"}) {
      const auto test = synthetic_scene<float>(scene, 3);
      const StrategyEntry& entry = find_strategy("bottom_up_volumes");
      Session<float> session(test.scene, {&entry, {{"volume", volume}}, entry.info.topology.preferred});
      Oracle<float> oracle(test.scene);
      const Verification result = verify(session, std::span<const double>(test.frames), oracle);
      EXPECT_TRUE(result.audited);
      EXPECT_EQ(result.audit.not_tight, 0u) << volume << " on " << scene;
      EXPECT_EQ(result.audit.looseness(), 0) << volume << " on " << scene;
    }
}

TEST(EveryVolume, BoxesAreThoseOfTheOtherRefit) {
  const auto test = synthetic_scene<double>("soups", 3);
  const BuilderConfig builder{.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  const StrategyEntry &plain = find_strategy("bottom_up_volumes"), &fast = find_strategy("bottom_up");
  Session<double> one(test.scene, {&plain, {{"volume", "aabb"}}, builder});
  Session<double> other(test.scene, {&fast, {}, builder});
  PhaseTimes times;
  one.reset(test.frames[0]);
  other.reset(test.frames[0]);
  for (const double t : test.frames) {
    one.advance(t, times);
    other.advance(t, times);
    for (std::uint32_t body = 0; body < test.scene.bodies.size(); ++body)
      EXPECT_EQ(one.strategy().audit_view(body)->boxes, other.strategy().audit_view(body)->boxes);
  }
}

// The purpose of these kinds: fewer candidates, for more work.
TEST(EveryVolume, KDopsLeaveFewerCandidatesThanBoxes) {
  const auto candidates = [](const std::string& volume) {
    const auto test = synthetic_scene<float>("soups", 3);
    const StrategyEntry& entry = find_strategy("bottom_up_volumes");
    Session<float> session(test.scene, {&entry, {{"volume", volume}}, entry.info.topology.preferred});
    Oracle<float> oracle(test.scene);
    return verify(session, std::span<const double>(test.frames), oracle).candidates;
  };
  const std::uint64_t box = candidates("aabb"), dop14 = candidates("dop14"), dop26 = candidates("dop26");
  EXPECT_LT(dop14, box);
  EXPECT_LT(dop26, dop14);
  EXPECT_LT(candidates("obb"), box);
}

/// Rotates a few random nodes of every body at each frame, after the refit: the query reads rotated volumes.
template <class S, class V>
class Rotating : public VolumeStrategy<S, V> {
  using Base = VolumeStrategy<S, V>;

 public:
  Rotating(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params&)
      : Base(scene, motion, std::move(topologies), 0) {}
  void advance_to(double t) override {
    Base::advance_to(t);
    this->on_bodies([&](auto& bodies) {
      for (auto& body : bodies)
        for (int i = 0; i < 8; ++i) rotate_one(body);
    });
  }

 private:
  void rotate_one(VolumeHierarchy<V>& body) {
    const Topology& topology = body.topology();
    if (topology.size() < 5) return;
    const std::uint32_t node = 1 + random_.below(topology.size() - 1);
    const TopologyNode siblings = topology.nodes[topology.parents[node]];
    const std::uint32_t sibling = siblings.first() + (node == siblings.first() ? 1 : 0);
    if (topology.nodes[sibling].is_leaf()) return;
    body.rotate(node, topology.nodes[sibling].first() + random_.below(2));
    ++rotations;
  }
  Random random_{97};

 public:
  static inline std::uint64_t rotations = 0;
};
template <class S>
using RotatingBoxes = Rotating<S, Box<S>>;
template <class S>
using RotatingDops = Rotating<S, Dop<S, 18>>;
template <class S>
using RotatingSpheres = Rotating<S, Sphere<S>>;
template <class S>
using RotatingObbs = Rotating<S, Obb<S>>;

template <template <class> class T>
StrategyEntry rotating(Tightness tightness) {
  Info info;
  info.id = "rotating";
  info.tightness = tightness;
  info.declares = {.restructures = true, .time_budget = true};
  info.topology.widths = {2};
  info.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  return make_entry<T>(std::move(info));
}

class Rotations : public testing::TestWithParam<std::string> {};

TEST_P(Rotations, AtEveryFrameKeepEveryGuarantee) {
  RotatingBoxes<float>::rotations = 0;
  // Around the boxes of control nets, and of primitives that meet them, k-DOPs differ from those of the
  // vertices.
  const bool nets = GetParam().find("points") != std::string::npos;
  const Tightness dops = nets ? Tightness::conservative : Tightness::tight;
  for (const std::uint32_t l : {1u, 7u}) {
    EXPECT_EQ(violations(rotating<RotatingBoxes>(Tightness::tight), GetParam(), l, {}), "|");
    EXPECT_EQ(violations(rotating<RotatingDops>(dops), GetParam(), l, {}), "|");
    EXPECT_EQ(violations(rotating<RotatingSpheres>(Tightness::conservative), GetParam(), l, {}), "|");
  }
  EXPECT_EQ(violations(rotating<RotatingObbs>(Tightness::conservative), GetParam(), 3, {}), "|");
  if (GetParam() == "soups" || GetParam() == "sheets") {
    EXPECT_GT((RotatingBoxes<float>::rotations), 100u);
  }
}

INSTANTIATE_TEST_SUITE_P(Synthetic, Rotations, testing::ValuesIn(all_synthetic_names()),
                         [](const auto& test) { return test.param; });

TEST(Rotations, AreTakenBackByReset) {
  expect_reset_restores_topology(rotating<RotatingDops>(Tightness::tight));
}

}  // namespace
}  // namespace kbvh::test::volumes_test
