// What holds for every strategy, whatever it does.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test {
namespace {

TEST(EveryStrategy, ASilentInstanceCountsNothing) {
  const Scene<float> scene = grids<float>(24, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(0.3 * i); });
  std::size_t found = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred}, CountingPolicy::silent);
    PhaseTimes times;
    PairBuffer pairs;
    session.reset(0);
    for (const double t : {0.5, 1.0, 1.5, 1.75}) {
      session.advance(t, times);
      session.query(pairs, times);
      found += pairs.size();
    }
    const Counters counters = session.strategy().counters();
    for (std::size_t c = 0; c < counters.values.size(); ++c) {
      const Counter counter = Counter(c);
      if (counter == Counter::triangle_tests || counter == Counter::triangle_tests_exact ||
          counter == Counter::bytes)
        continue;
      EXPECT_EQ(counters[counter], 0u) << entry.info.id << ", " << name(counter);
    }
  }
  EXPECT_GT(found, 0u);
}

TEST(EveryStrategy, RefusesTimesThatAreNone) {
  const Scene<float> scene = grids<float>(12, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(1.3 * i); });
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::size_t found = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred}, CountingPolicy::silent);
    PhaseTimes times;
    PairBuffer pairs, expected;
    session.reset(0);
    session.advance(0.5, times);
    session.query(expected, times);
    for (const double t : {std::nan(""), infinity, -infinity}) {  // and one that is over:
      EXPECT_THROW(session.advance(0.25, times), std::invalid_argument) << entry.info.id;
      EXPECT_THROW(session.advance(t, times), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.reset(t), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.strategy().advance(t), std::invalid_argument) << entry.info.id << ", t = " << t;
      EXPECT_THROW(session.strategy().reset(t), std::invalid_argument) << entry.info.id << ", t = " << t;
    }
    session.advance(0.5, times);  // and nothing has happened
    session.query(pairs, times);
    EXPECT_EQ(pairs.size(), expected.size()) << entry.info.id;
    found += pairs.size();
  }
  EXPECT_GT(found, 0u);
}

}  // namespace
}  // namespace kbvh::test
