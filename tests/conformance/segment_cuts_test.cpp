// Segments cut into pieces, by number or until boxes are tight enough: guarantees hold, looseness follows the
// bound.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>

#include "tests/conformance/check.hpp"

namespace kbvh::test::segment_cuts_test {
namespace {

const std::array<const char*, 2> strategies{"linear_bounds", "interval_join"};

template <class S>
void keep_guarantees(const std::map<std::string, std::string>& params) {
  for (const std::string& scene : synthetic_scene_names())
    for (const char* id : strategies) {
      const TestScene<S> test = synthetic_scene<S>(scene, 5);
      const StrategyEntry& entry = find_strategy(id);
      EXPECT_EQ(check(entry, test, 5, params, entry.info.topology.preferred), "") << id << " on " << scene;
    }
}

TEST(SegmentCuts, KeepGuaranteesInFloat) {
  keep_guarantees<float>({{"max_looseness", "0.01"}});
  keep_guarantees<float>({{"pieces", "3"}});
}
TEST(SegmentCuts, KeepGuaranteesInDouble) {
  keep_guarantees<double>({{"max_looseness", "0.01"}});
}

// Fractions of a segment that round to 0 or to 1, for every strategy.
template <class S>
void keep_guarantees_beside_keyframes() {
  for (const std::string scene : {"sheets", "soups"}) {
    TestScene<S> test = synthetic_scene<S>(scene, 1);
    std::set<double> frames;
    for (const double t : test.frames.empty() ? frame_times(test.scene, 1) : test.frames)
      for (const double other : {t, std::nextafter(t, -1e9), std::nextafter(t, 1e9)})
        if (other >= 0) frames.insert(other);
    test.frames.assign(frames.begin(), frames.end());
    for (const StrategyEntry& entry : registry())
      if (skipped(entry, test).empty()) {
        EXPECT_EQ(check(entry, test, 1, {}, entry.info.topology.preferred), "")
            << entry.info.id << " on " << scene;
      }
  }
}
TEST(FramesBesideKeyframes, KeepGuaranteesInFloat) {
  keep_guarantees_beside_keyframes<float>();
}
TEST(FramesBesideKeyframes, KeepGuaranteesInDouble) {
  keep_guarantees_beside_keyframes<double>();
}

double looseness(const std::string& scene, const std::map<std::string, std::string>& params) {
  const TestScene<double> test = synthetic_scene<double>(scene, 8);
  const StrategyEntry& entry = find_strategy("linear_bounds");
  Session<double> session(test.scene, {&entry, params, entry.info.topology.preferred});
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 8) : test.frames;
  return verify(session, std::span<const double>(frames), shared_oracle(test),
                test.script.steps.empty() ? nullptr : &test.script)
      .audit.looseness();
}

// The bound holds in the middle of the first piece of each segment; over all frames no strategy becomes
// looser.
TEST(SegmentCuts, MakeLooseBoxesTighter) {
  int much_tighter = 0;
  for (const std::string& scene : synthetic_scene_names()) {
    const double whole = looseness(scene, {}), cut = looseness(scene, {{"max_looseness", "0.001"}});
    EXPECT_LE(cut, whole * 1.001 + 1e-12) << scene;
    if (whole > 0.02 && cut < whole / 4) ++much_tighter;
  }
  EXPECT_GE(much_tighter, 1);
}

}  // namespace
}  // namespace kbvh::test::segment_cuts_test
