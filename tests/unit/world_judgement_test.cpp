// Through the façade: audits, verdicts and the truth at a frame are those of the judge; positions that are
// handed in are read in place; strategies are described in the words of result files.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "core/contract/registry.hpp"
#include "core/facade/world.hpp"
#include "core/judge/verify.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/support/world_of.hpp"

namespace kbvh::test::world_judgement_test {
namespace {

const std::vector<std::uint32_t> triangle{0, 1, 2};

// Judgement through the façade is that of the judge: a sound strategy holds, and a faulty answer is counted.
template <class S>
void expect_the_same_judgement(const char* id) {
  const TestScene<S> test = synthetic_scene<S>("soups", 3);
  const World world = world_of(test.scene);
  const std::vector<double> frames = world.frame_times(3);
  EXPECT_EQ(frames, frame_times(test.scene, 3));
  const StrategyEntry& entry = find_strategy(id);
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  Oracle<S> oracle(test.scene);
  const Verification expected = verify(session, frames, oracle);
  const WorldVerdict found = world.verify(id, frames);
  EXPECT_EQ(found.holds, expected.holds());
  EXPECT_EQ(found.first_violation, expected.first_violation);
  EXPECT_EQ(found.frames, expected.frames);
  EXPECT_EQ(found.pairs, expected.pairs);
  EXPECT_EQ(found.candidates, expected.candidates);
  EXPECT_EQ(found.missed, expected.missed);
  EXPECT_EQ(found.extra, expected.extra);
  EXPECT_EQ(found.audited, expected.audited);
  EXPECT_EQ(found.audit.nodes, expected.audit.nodes);
  EXPECT_EQ(found.audit.looseness, expected.audit.looseness());
  EXPECT_GT(found.pairs, 0u);
}
TEST(World, JudgesAsTheJudgeDoes) {
  for (const char* id : {"bottom_up", "drift_boxes", "brute_force", "bottom_up_approximate"}) {
    SCOPED_TRACE(id);
    expect_the_same_judgement<float>(id);
    expect_the_same_judgement<double>(id);
  }
}

TEST(World, AuditsAndKnowsTheTruthAtAFrame) {
  const TestScene<float> test = synthetic_scene<float>("soups", 3);
  World world = world_of(test.scene);
  const std::vector<double> frames = world.frame_times(3);
  world.start("drift_boxes", {}, frames[0]);
  std::vector<WorldPair> pairs, truth;
  WorldAudit audit;
  std::size_t seen = 0;
  const auto sorted = [](std::vector<WorldPair>& list) {
    const auto key = [](const WorldPair& pair) {
      return std::array{pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b};
    };
    std::sort(list.begin(), list.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
    return list;
  };
  for (const double t : frames) {
    world.advance(t);
    world.pairs(pairs);
    ASSERT_TRUE(world.audit(0, audit));
    EXPECT_EQ(audit.invalid, 0u);
    EXPECT_EQ(audit.protrusion, 0);
    EXPECT_EQ(audit.first_fault, "");
    EXPECT_GT(audit.nodes, 0u);
    world.true_pairs(truth);
    EXPECT_EQ(sorted(pairs), truth);
    seen += truth.size();
    const WorldPositions positions = world.current_positions(0);
    std::vector<double> copy;
    world.positions(0, copy);
    ASSERT_EQ(copy.size(), std::size_t(3) * positions.vertices);
    ASSERT_EQ(positions.precision, Precision::float32);
    for (std::size_t i = 0; i < copy.size(); ++i)
      ASSERT_EQ(copy[i], double(static_cast<const float*>(positions.data)[i]));
  }
  EXPECT_GT(seen, 0u);
  World hidden = world_of(test.scene);
  hidden.start("brute_force");
  EXPECT_FALSE(hidden.audit(0, audit));
}

TEST(World, PositionsThatAreHandedInStayWhereTheyLie) {
  World world;
  world.add_body("a", {triangle}, triangle_at(0));
  world.add_body("b", {triangle}, triangle_at(1));
  world.start("bottom_up");
  const std::vector<float> mine = triangle_at(0, true);
  world.set_positions(1, std::span<const float>(mine));
  world.advance(1);
  EXPECT_EQ(world.current_positions(1).data, mine.data());
  EXPECT_EQ(world.current_positions(1).vertices, 3u);
}

TEST(World, DescribesStrategiesInTheWordsOfResults) {
  const std::vector<WorldStrategy> list = World::strategy_descriptions();
  ASSERT_EQ(list.size(), registry().size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Info& info = registry()[i].info;
    EXPECT_EQ(list[i].guarantee == "exact", info.guarantee == Guarantee::exact) << info.id;
    EXPECT_EQ(list[i].tightness == "tight", info.tightness == Tightness::tight) << info.id;
    const auto& words = list[i].abilities;
    EXPECT_EQ(std::find(words.begin(), words.end(), "spans") != words.end(), info.can.spans) << info.id;
    EXPECT_EQ(std::find(words.begin(), words.end(), "changes") != words.end(), info.can.changes) << info.id;
    EXPECT_EQ(std::find(words.begin(), words.end(), "curves") != words.end(), info.can.curves) << info.id;
    EXPECT_EQ(list[i].method.empty(), info.topology.own) << info.id;
    EXPECT_EQ(list[i].primitives.size(), info.primitives.size()) << info.id;
    ASSERT_EQ(list[i].parameters.size(), info.parameters.size());
    for (std::size_t p = 0; p < info.parameters.size(); ++p) {
      EXPECT_EQ(list[i].parameters[p].least, info.parameters[p].least) << info.id;
      EXPECT_EQ(list[i].parameters[p].most, info.parameters[p].most) << info.id;
    }
  }
}

TEST(World, RefusesToVerifyWhatCannotBeVerified) {
  World world;
  world.add_body("a", {triangle}, triangle_at(0));
  world.add_body("b", {triangle}, triangle_at(1));
  const std::vector<double> frames{0, 1}, backwards{1, 0}, none;
  EXPECT_THROW(world.verify("bottom_up", frames), std::invalid_argument);
  World known = world_of(synthetic_scene<float>("soups", 3).scene);
  EXPECT_THROW(known.verify("bottom_up", backwards), std::invalid_argument);
  EXPECT_THROW(known.verify("bottom_up", none), std::invalid_argument);
  EXPECT_THROW(known.verify("nobody", frames), ConfigError);
  EXPECT_THROW(known.verify("bottom_up", frames, {}, {{"width", "3"}}), ConfigError);
  EXPECT_THROW(known.frame_times(0), std::invalid_argument);
  std::vector<WorldPair> pairs;
  EXPECT_THROW(known.true_pairs(pairs), std::logic_error);
}

}  // namespace
}  // namespace kbvh::test::world_judgement_test
