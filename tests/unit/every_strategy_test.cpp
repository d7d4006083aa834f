// Properties of every strategy.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test::every_strategy_test {
namespace {

// A timed instance leaves out only statistics within a peer's library.
TEST(EveryStrategy, ATimedInstanceCountsTheSame) {
  const Scene<float> scene = grids<float>(24, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(0.3 * i); });
  std::uint64_t triangle_tests = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    Counters counters[2];
    for (const Use use : {Use::verified, Use::timed}) {
      Session<float> session(scene, {&entry, {}, entry.info.topology.preferred}, use);
      PhaseTimes times;
      PairBuffer pairs;
      session.reset(0);
      for (const double t : {0.5, 1.0, 1.5, 1.75}) {
        session.advance(t, times);
        session.query(pairs, times);
      }
      counters[use == Use::timed] = session.strategy().counters();
    }
    triangle_tests += counters[0][Counter::triangle_tests];
    for (std::size_t c = 0; c < counters[0].values.size(); ++c) {
      if (entry.info.family == "fcl" &&
          (Counter(c) == Counter::box_tests || Counter(c) == Counter::vertex_reads))
        EXPECT_LE(counters[1].values[c], counters[0].values[c]) << entry.info.id << ", " << name(Counter(c));
      else
        EXPECT_EQ(counters[1].values[c], counters[0].values[c]) << entry.info.id << ", " << name(Counter(c));
    }
    ASSERT_EQ(counters[1].named.size(), counters[0].named.size()) << entry.info.id;
    for (std::size_t c = 0; c < counters[0].named.size(); ++c)
      EXPECT_EQ(counters[1].named[c].value, counters[0].named[c].value)
          << entry.info.id << ", " << counters[0].named[c].name;
  }
  EXPECT_GT(triangle_tests, 0u);
}

/// Copies of two grids that cut each other, far from the other copies; only the pairs within a copy.
Scene<float> couples(std::uint32_t count) {
  Scene<float> scene;
  for (std::uint32_t i = 0; i < count; ++i) {
    scene.bodies.push_back(
        grid<float>(8, 4.0 * i, 0, 3, [](std::uint32_t k) { return 0.1 * std::sin(0.9 * k); }));
    scene.bodies.push_back(grid<float>(8, 4.0 * i + 0.1, 0.01, 1, [](std::uint32_t) { return 0.0; }));
    scene.pairs.push_back({2 * i, 2 * i + 1});
  }
  return scene;
}

// A budget applies to a frame, not to a pair of bodies. Without one, or with a sufficient one, an answer is
// complete.
TEST(EveryStrategy, ABudgetIsForAFrame) {
  const Scene<float> one = couples(1), many = couples(12);
  std::size_t with_budget = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr || entry.info.guarantee == Guarantee::approximate) continue;
    const auto query = [&](const Scene<float>& scene, std::uint64_t most, std::uint64_t& tests,
                           std::size_t& pairs) {
      Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
      PhaseTimes times;
      PairBuffer found;
      session.reset(0);
      session.advance(0.5, times);
      const std::uint64_t before = session.strategy().counters()[Counter::box_tests];
      const QueryStatus status = session.query(found, times, Budget{most});
      tests = session.strategy().counters()[Counter::box_tests] - before;
      pairs = found.size();
      return status;
    };
    std::uint64_t tests_one = 0, tests_all = 0, tests = 0;
    std::size_t pairs_one = 0, pairs_all = 0, pairs = 0;
    const std::uint64_t unlimited = Budget{}.box_tests;
    EXPECT_TRUE(query(one, unlimited, tests_one, pairs_one).complete()) << entry.info.id;
    EXPECT_TRUE(query(many, unlimited, tests_all, pairs_all).complete()) << entry.info.id;
    EXPECT_EQ(pairs_all, 12 * pairs_one) << entry.info.id;
    if (!entry.info.can.time_budget) {
      // Strategies that do not honour a budget answer in full.
      EXPECT_TRUE(query(many, 1, tests, pairs).complete()) << entry.info.id;
      EXPECT_EQ(pairs, pairs_all) << entry.info.id;
      continue;
    }
    ++with_budget;
    const QueryStatus status = query(many, 2 * tests_one, tests, pairs);
    EXPECT_FALSE(status.complete()) << entry.info.id << ": the budget of two couples sufficed for twelve";
    EXPECT_LE(tests, 4 * tests_one) << entry.info.id << ": " << tests << " tests, of " << tests_all;
    EXPECT_LE(pairs, 4 * pairs_one) << entry.info.id;
    EXPECT_TRUE(query(many, tests_all + 12, tests, pairs).complete()) << entry.info.id;
    EXPECT_EQ(pairs, pairs_all) << entry.info.id;
  }
  EXPECT_GT(with_budget, 8u);
}

// The effects of plans before a reset are forgotten: the same clip costs the same again.
TEST(EveryStrategy, CountsTheSameAfterAReset) {
  const Scene<float> scene = grids<float>(12, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(1.3 * i); });
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr || !entry.info.can.plan_changes) continue;
    std::vector<std::map<std::string, std::string>> variants{{}};
    if (entry.info.id == "kinetic_boxtree") variants.push_back({{"rebuild", "median"}, {"check_every", "1"}});
    for (const auto& params : variants) {
      Session<float> session(scene, {&entry, params, entry.info.topology.preferred});
      PhaseTimes times;
      PairBuffer pairs;
      const auto play = [&](bool changes) {
        session.reset(0);
        const std::vector<PlanChange<float>> up{{.body = 1, .vertex = 3, .velocity = {0, 0, 0.5F}}};
        if (changes) session.change_plans(up, times);
        for (const double t : {0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75}) {
          session.advance(t, times);
          session.query(pairs, times);
        }
        return session.strategy().counters();
      };
      const Counters first = play(false);
      play(true);
      const Counters again = play(false);
      for (std::size_t c = 0; c < first.values.size(); ++c)
        if (Counter(c) != Counter::bytes) {
          EXPECT_EQ(first.values[c], again.values[c])
              << entry.info.id << (params.empty() ? "" : " with rebuild=median") << ", " << name(Counter(c));
        }
    }
  }
}

TEST(EveryStrategy, RefusesTimesThatAreNone) {
  const Scene<float> scene = grids<float>(12, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(1.3 * i); });
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::size_t found = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes times;
    PairBuffer pairs, expected;
    session.reset(0);
    session.advance(0.5, times);
    session.query(expected, times);
    for (const double t : {std::nan(""), infinity, -infinity}) {  // and a time in the past:
      EXPECT_THROW(session.advance(0.25, times), std::invalid_argument) << entry.info.id;
      EXPECT_THROW(session.advance(t, times), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.reset(t), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.strategy().advance(t), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.strategy().reset(t), std::invalid_argument) << entry.info.id << ", t = " << t;
    }
    session.advance(0.5, times);  // and has changed nothing
    session.query(pairs, times);
    EXPECT_EQ(pairs.size(), expected.size()) << entry.info.id;
    found += pairs.size();
  }
  EXPECT_GT(found, 0u);
}

}  // namespace
}  // namespace kbvh::test::every_strategy_test
