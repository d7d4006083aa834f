// Strategies that restructure also conform when they do so as often as they can: by default few of the
// suite's small scenes age enough.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "core/families/restructure/tree_age.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/flying_triangles.hpp"

namespace kbvh::test::restructuring_test {
namespace {

struct Eager {
  std::string id;
  std::map<std::string, std::string> params;
  std::string counter;  ///< counts what the strategy restructured
};
const std::vector<Eager>& eager() {
  static const std::vector<Eager> all{
      {"drift_rebuild", {{"price", "0"}}, "rebuilds"},
      {"drift_rebuild", {{"measure", "surface"}, {"drift", "1"}}, "rebuilds"},
      {"drift_rebuild", {{"measure", "surface"}, {"drift", "1"}, {"spread", "3"}}, "rebuilds"},
      {"partial_rebuild", {{"price", "0"}, {"share", "0.5"}}, "leaves_renewed"},
      {"selective_restructuring", {{"drift", "1"}, {"budget", "1"}}, "subtrees_rebuilt"},
      {"rotations", {{"most", "30"}}, "rotations"},
      {"reinsertion", {{"tried", "1"}, {"growth", "1"}, {"price", "0"}, {"least", "0"}}, "reinsertions"},
  };
  return all;
}

class Restructuring : public testing::TestWithParam<std::size_t> {};

TEST_P(Restructuring, AsOftenAsPossibleKeepsEveryGuarantee) {
  const Eager& one = eager()[GetParam()];
  const StrategyEntry& entry = find_strategy(one.id);
  for (const std::string& name : all_synthetic_names())
    for (const std::uint32_t leaf : {1u, 4u}) {
      const BuilderConfig builder{
          .method = leaf == 1 ? BuildMethod::sah : BuildMethod::median, .width = 8, .leaf_size = leaf};
      EXPECT_EQ(check(entry, synthetic_scene<float>(name, 3), 3, one.params, builder), "") << name;
      EXPECT_EQ(check(entry, synthetic_scene<double>(name, 3), 3, one.params, builder), "") << name;
    }
}

TEST_P(Restructuring, HappensAndIsTakenBackByReset) {
  const Eager& one = eager()[GetParam()];
  const StrategyEntry& entry = find_strategy(one.id);
  const auto test = synthetic_scene<float>("soups", 7);
  const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = 1};
  Session<float> session(test.scene, {&entry, one.params, builder});
  PhaseTimes times;
  PairBuffer pairs;
  std::vector<std::size_t> found[2];
  std::uint64_t counted[2] = {0, 0};
  std::optional<Topology> start;
  for (int round = 0; round < 2; ++round) {
    session.reset(test.frames.front());
    const Topology topology = session.strategy().audit_view(0)->topology;
    if (round == 0)
      start = topology;
    else
      EXPECT_TRUE(topology == *start);
    for (const double t : test.frames) {
      session.advance(t, times);
      session.query(pairs, times);
      found[round].push_back(pairs.size());
    }
    if (round == 0) {
      EXPECT_FALSE(session.strategy().audit_view(0)->topology == *start);
    }
    for (const auto& named : session.strategy().counters().named)
      if (named.name == one.counter) counted[round] = named.value;
  }
  EXPECT_GT(counted[0], 0u);
  EXPECT_EQ(counted[0], counted[1]);
  EXPECT_EQ(found[0], found[1]);
}

/// Plays a clip with queries of rays only; returns the box tests of the last frame.
std::uint64_t last_tests_of_rays(const Scene<float>& scene, const std::string& id,
                                 std::vector<RayHit>& hits) {
  Session<float> session(scene, {&find_strategy(id), {}, {}});
  session.reset(0);
  std::mt19937 random(5);
  std::vector<Ray<float>> rays(1000);
  for (Ray<float>& ray : rays) {
    ray.length = std::numeric_limits<float>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      ray.origin[axis] = float(random() % 2001) / 1000 - 1;
      ray.direction[axis] = float(random() % 2001) / 1000 - 1;
    }
  }
  hits.resize(rays.size());
  PhaseTimes times;
  std::uint64_t before = 0;
  for (int frame = 1; frame <= 30; ++frame) {
    before = session.strategy().counters()[Counter::box_tests];
    session.advance(frame, times);
    session.probe(RayProbes<float>{RayQuery::closest, rays, hits}, times);
  }
  return session.strategy().counters()[Counter::box_tests] - before;
}

TEST(Restructuring, TreesAgeByRaysAlone) {
  const Scene<float> scene = flying_triangles(4000, 31, Flight::anywhere);
  std::vector<RayHit> expected, hits;
  const std::uint64_t refitted = last_tests_of_rays(scene, "bottom_up", expected);
  for (const char* id : {"drift_rebuild", "partial_rebuild", "lbvh_drift"}) {
    EXPECT_LT(last_tests_of_rays(scene, id, hits), refitted / 3) << id;
    EXPECT_EQ(hits, expected) << id;
  }
}

TEST(Restructuring, SortsTheTreesOfTheFirstFrame) {
  const Scene<float> scene = flying_triangles(4000, 31, Flight::anywhere);
  std::uint64_t tests[2];
  PairBuffer found[2];
  for (const bool sorted : {false, true}) {
    const std::map<std::string, std::string> params{{"start", sorted ? "sorted" : "given"}};
    Session<float> session(scene, {&find_strategy("drift_rebuild"), params, {}});
    PhaseTimes times;
    session.reset(30);
    session.query(found[sorted], times);
    std::sort(found[sorted].begin(), found[sorted].end());
    tests[sorted] = session.strategy().counters()[Counter::box_tests];
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_LT(tests[1], tests[0] / 3);
}

TEST(TreeAge, TellsHowTheSurplusOfAFrameGrows) {
  TreeAge age;
  EXPECT_EQ(age.growth(), 0);
  const auto play = [&](int frames, int growth) {
    age.renew();
    for (int frame = 0; frame < frames; ++frame) {
      age.add(5000 + std::uint64_t(growth * frame), 0);
      age.end_frame();
    }
  };
  play(100, 30);
  EXPECT_NEAR(age.growth(), 30, 1);
  play(50, 90);
  EXPECT_NEAR(age.growth(), 30, 1) << "of the tree before";
  play(51, 10);
  EXPECT_NEAR(age.growth(), 10, 1);
}

INSTANTIATE_TEST_SUITE_P(Eager, Restructuring, testing::Range(std::size_t(0), eager().size()),
                         [](const auto& test) {
                           return eager()[test.param].id + "_" + std::to_string(test.param);
                         });

}  // namespace
}  // namespace kbvh::test::restructuring_test
