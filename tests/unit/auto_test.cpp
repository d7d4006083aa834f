// What `auto` chooses where the choice is clear, that it says so, and that it answers like everybody else
// while it changes its mind.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test {
namespace {

constexpr auto slow = [](std::uint32_t i) { return 0.02 + 0.001 * i; };

/// Plays frames of one length over the clip of two keyframe intervals, next to a refit.
template <class S, class AtFrame>
std::string chosen(const Scene<S>& scene, int frames, AtFrame&& at_frame) {
  Play<S> play(scene, "auto", {}), refit(scene, "bottom_up", {});
  for (int f = 1; f <= frames; ++f) {
    play.frame(2.0 * f / frames);
    refit.frame(2.0 * f / frames);
    std::sort(play.pairs.begin(), play.pairs.end());
    std::sort(refit.pairs.begin(), refit.pairs.end());
    EXPECT_EQ(play.pairs, refit.pairs) << "frame " << f;
    at_frame(play);
    at_frame(refit);
  }
  return play.session.strategy().choice();
}
template <class S>
std::string chosen(const Scene<S>& scene, int frames) {
  return chosen(scene, frames, [](auto&) {});
}

TEST(Auto, JoinsOverSegmentsOfManyFrames) {
  const Scene<float> scene = grids<float>(40, 0.3, slow);
  const std::string choice = chosen(scene, 200);
  EXPECT_TRUE(choice.find("interval_join for 199 frames") != std::string::npos ||
              choice.find("interval_join for 200 frames") != std::string::npos)
      << choice;
}

TEST(Auto, DoesNotJoinWithOneFrameForASegment) {
  const Scene<float> scene = grids<float>(40, 0.3, slow);
  const std::string choice = chosen(scene, 2);
  EXPECT_EQ(choice.find("interval_join"), std::string::npos) << choice;
}

TEST(Auto, DoesNotJoinWherePlansChangeAtEveryFrame) {
  const Scene<double> scene = grids<double>(20, 0.3, slow);
  std::uint32_t vertex = 0;
  PlanChange<double> change;
  const std::string choice = chosen(scene, 200, [&](Play<double>& play) {
    change.vertex = vertex++ / 2 % 400;  // the same for both
    change.velocity[2] = 0.01;
    play.session.change_plans({&change, 1}, play.times);
  });
  // Before the first change it may have joined for one frame.
  const auto joined = choice.find("interval_join for ");
  EXPECT_TRUE(joined == std::string::npos || choice.find("interval_join for 1 frame ") == joined ||
              choice.find("interval_join for 1 frame,") == joined)
      << choice;
  EXPECT_NE(choice.find("plans changed at 1 of frames"), std::string::npos) << choice;
}

TEST(Auto, StartsOverAndChoosesTheSameAgain) {
  const Scene<float> scene = grids<float>(30, 0.3, slow);
  Play<float> play(scene, "auto", {});
  std::string first;
  for (int round = 0; round < 2; ++round) {
    play.session.reset(0);
    EXPECT_EQ(play.session.strategy().choice(), "");
    play.session.query(play.pairs, play.times);
    for (int f = 1; f <= 40; ++f) {
      play.session.advance(0.05 * f, play.times);
      play.session.query(play.pairs, play.times);
    }
    if (round == 0) first = play.session.strategy().choice();
  }
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(play.session.strategy().choice(), first);
}

TEST(NestedStrategies, KnowNoMoreOfTheFutureThanTheirOwner) {
  const Scene<float> scene = grids<float>(4, 0.3, slow);
  Playback<float> playback(scene);
  const SceneView<float> view(scene);
  const StrategyEntry& entry = find_strategy("interval_join");
  const Params params(entry.info.id, entry.info.parameters, {});
  const Topologies topologies = build_topologies(view, playback, entry.info.topology.preferred);
  EXPECT_THROW(NestedStrategies<float>::create(entry, view, SteppedMotion<float>(playback), topologies,
                                               params, CountingPolicy::silent),
               ConfigError);
  EXPECT_NO_THROW(NestedStrategies<float>::create(entry, view, ClipMotion<float>(playback), topologies,
                                                  params, CountingPolicy::silent));
}

}  // namespace
}  // namespace kbvh::test
