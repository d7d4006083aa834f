// The choices of `auto` in clear cases, that it reports them, and that it answers like all others while it
// changes its choice.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/judge/session.hpp"
#include "tests/support/flying_triangles.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::auto_test {
namespace {

constexpr auto slow = [](std::uint32_t i) { return 0.02 + 0.001 * i; };

/// Plays frames of one length over the clip of two keyframe intervals, alongside a refit.
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

// Two sheets of unit size and 0.1 apart, where numbers are 0.06 apart: boxes linear in time overlap nearly
// all others, and a whole join would list millions of pairs.
TEST(Auto, GivesUpAJoinWithoutEnd) {
  constexpr std::uint32_t side = 32;
  Scene<float> scene;
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(
        placed_grid<float>(side, 3, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) {
          const double at = axis == 2 ? 0.2 * b : (axis == 0 ? i : j) / double(side) + 0.1 * b * k;
          return 1e6 + at;
        }));
  scene.pairs = all_pairs(scene.bodies);
  constexpr int frames = 80;
  Play<float> play(scene, "auto", {}), refit(scene, "bottom_up", {});
  for (int f = 1; f <= frames; ++f)
    for (Play<float>* one : {&play, &refit}) one->frame(2.0 * f / frames);
  const std::uint64_t tests = play.session.strategy().counters()[Counter::box_tests],
                      of_refit = refit.session.strategy().counters()[Counter::box_tests],
                      leaves = 2 * (2 * side * side / 16);
  const std::string choice = play.session.strategy().choice();
  EXPECT_LE(tests, 20 * (of_refit + frames * leaves)) << choice << ", refit: " << of_refit;
  EXPECT_LE(play.session.strategy().bytes(), 16U << 20) << choice;
  Play<float> join(scene, "interval_join", {});
  join.frame(2.0 / frames);
  EXPECT_GT(join.session.strategy().counters()[Counter::box_tests], tests) << "the scene is too easy";
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

/// Plays a clip of `l` frames for each keyframe interval, alongside a refit.
std::string chosen_at_keyframes(const Scene<float>& scene, int frames, int l = 1) {
  Play<float> play(scene, "auto", {}), refit(scene, "bottom_up", {});
  for (int f = 1; f <= frames; ++f) {
    play.frame(double(f) / l);
    refit.frame(double(f) / l);
    std::sort(play.pairs.begin(), play.pairs.end());
    std::sort(refit.pairs.begin(), refit.pairs.end());
    EXPECT_EQ(play.pairs, refit.pairs) << "frame " << f;
  }
  return play.session.strategy().choice();
}

int frames_of(const std::string& choice, const std::string& id) {
  const auto found = choice.find(id + " for ");
  return found == std::string::npos ? 0 : std::stoi(choice.substr(found + id.size() + 5));
}
int frames_in_new_trees(const std::string& choice) {
  return frames_of(choice, "lbvh_drift") + frames_of(choice, "drift_rebuild");
}

TEST(Auto, RebuildsTreesThatAge) {
  const std::string choice = chosen_at_keyframes(flying_triangles(4000, 100, Flight::anywhere), 99);
  EXPECT_GT(frames_in_new_trees(choice), 60) << choice;
}

TEST(Auto, RebuildsTreesThatAgeByRaysAlone) {
  const Scene<float> scene = flying_triangles(4000, 100, Flight::anywhere);
  Play<float> play(scene, "auto", {});
  Random random(3);
  std::vector<Ray<float>> rays(200);
  for (Ray<float>& ray : rays)
    for (int axis = 0; axis < 3; ++axis) {
      ray.origin[axis] = float(3 * random.unit());
      ray.direction[axis] = float(random.unit()) - ray.origin[axis];
    }
  std::vector<RayHit> hits(rays.size());
  play.session.reset(0);
  for (int f = 0; f < 100; ++f) {
    if (f > 0) play.session.advance(f, play.times);
    play.session.probe(RayProbes<float>{RayQuery::closest, rays, hits}, play.times);
  }
  const std::string choice = play.session.strategy().choice();
  EXPECT_GT(frames_in_new_trees(choice), 60) << choice;
  EXPECT_EQ(frames_of(choice, "drift_boxes") + frames_of(choice, "interval_join"), 0) << choice;
}

TEST(Auto, LeavesAJoinWhoseTreesHaveAged) {
  const std::string choice = chosen_at_keyframes(flying_triangles(4000, 40, Flight::anywhere), 390, 10);
  EXPECT_GT(frames_of(choice, "interval_join"), 0) << choice;  // while trees are young
  EXPECT_GT(frames_in_new_trees(choice), 200) << choice;
}

TEST(Auto, SortsTreesThatLast) {
  const std::string choice = chosen_at_keyframes(flying_triangles(4000, 40, Flight::anywhere), 1170, 30);
  EXPECT_GT(frames_of(choice, "drift_rebuild"), 100) << choice;
}

TEST(Auto, DoesNotRebuildTreesThatStayYoung) {
  for (const Flight flight : {Flight::side_by_side, Flight::outwards}) {
    const std::string choice = chosen_at_keyframes(flying_triangles(4000, 100, flight, 0.1), 99);
    EXPECT_EQ(frames_in_new_trees(choice), 0) << choice;
  }
}

TEST(Auto, LeavesSlabsThatDoNotPay) {
  // Where nothing is connected, a pair of leaves has few candidates that a slab could leave out.
  const std::string choice = chosen_at_keyframes(flying_triangles(2000, 50, Flight::outwards, 0.1), 49);
  EXPECT_LE(frames_of(choice, "leaf_slabs"), 1) << choice;
  EXPECT_GE(frames_of(choice, "bottom_up"), 48) << choice;
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

TEST(Auto, ChoosesTheSameAgainWhereChangesAreAsked) {
  const Scene<float> scene = grids<float>(30, 0.3, slow);
  Play<float> play(scene, "auto", {});
  std::string first;
  PairBuffer ended;
  for (int round = 0; round < 2; ++round) {
    play.session.reset(0);
    for (int f = 0; f <= 60; ++f) {
      if (f > 0) play.session.advance(f / 30.0, play.times);
      play.session.changes(Answer::pairs, play.pairs, ended, play.times);
    }
    if (round == 0) first = play.session.strategy().choice();
  }
  EXPECT_EQ(play.session.strategy().choice(), first);
}

TEST(Auto, ChoosesTheSameWhereItIsTimed) {
  const Scene<float> scene = flying_triangles(2000, 30, Flight::anywhere);
  for (const int l : {3, 10}) {
    std::string choices[2];
    for (const Use use : {Use::verified, Use::timed}) {
      Session<float> session(scene, {&find_strategy("auto"), {}, {}}, use);
      session.reset(0);
      PhaseTimes times;
      PairBuffer pairs;
      for (int f = 1; f <= 29 * l; ++f) {
        session.advance(double(f) / l, times);
        session.query(pairs, times);
      }
      choices[use == Use::timed] = session.strategy().choice();
    }
    EXPECT_EQ(choices[0], choices[1]);
    EXPECT_GT(frames_in_new_trees(choices[0]), 0) << choices[0];
    // With three frames per segment, a join reaches the refit's work for them, and is given up.
    if (l == 10) {
      EXPECT_NE(choices[0].find("interval_join"), std::string::npos) << choices[0];
    }
  }
}

TEST(NestedStrategies, KnowNoMoreOfTheFutureThanTheirOwner) {
  const Scene<float> scene = grids<float>(4, 0.3, slow);
  Playback<float> playback(scene);
  const SceneView<float> view(scene);
  const StrategyEntry& entry = find_strategy("interval_join");
  const Params params(entry.info.id, entry.info.parameters, {});
  const Topologies topologies = build_topologies(view, playback, entry.info.topology.preferred);
  EXPECT_THROW(
      NestedStrategies<float>::create(entry, view, SteppedMotion<float>(playback), topologies, params),
      ConfigError);
  EXPECT_NO_THROW(
      NestedStrategies<float>::create(entry, view, ClipMotion<float>(playback), topologies, params));
}

// Pairs within a body are answered by the candidates that can; drifting boxes cannot.
TEST(Auto, AnswersPairsWithinABody) {
  Scene<float> scene = grids<float>(20, 0.3, slow);
  scene.pairs.push_back({0, 0});
  const std::string choice = chosen(scene, 200);
  EXPECT_GT(frames_of(choice, "interval_join"), 150) << choice;
  EXPECT_EQ(frames_of(choice, "drift_boxes"), 0) << choice;
}

/// Plays frames up to `begin`, then a sweep up to `end`, twice. Returns the choice before the last sweep.
std::string sweeps_like_a_refit(const Scene<float>& scene, int frames, double begin, double end) {
  Session<float> play(scene, {&find_strategy("auto"), {}, {}}),
      refit(scene, {&find_strategy("bottom_up"), {}, {}});
  std::string choice;
  for (int round = 0; round < 2; ++round) {
    ContactBuffer found[2];
    for (Session<float>* const session : {&play, &refit}) {
      PhaseTimes times;
      PairBuffer pairs;
      session->reset(0);
      session->query(pairs, times);
      for (int f = 1; f <= frames; ++f) {
        session->advance(begin * f / frames, times);
        session->query(pairs, times);
      }
      if (session == &play) choice = session->strategy().choice();
      ContactBuffer& contacts = found[session == &play ? 0 : 1];
      session->contacts(end, contacts, times);
      std::sort(contacts.begin(), contacts.end());
    }
    EXPECT_FALSE(found[0].empty());
    EXPECT_EQ(found[0], found[1]) << choice;
  }
  return choice;
}

TEST(Auto, AnswersSweepsWhateverAnsweredBefore) {
  // Drifting boxes answer no sweeps, so a refit does in their place.
  const Scene<float> scene = flying_triangles(1000, 100, Flight::side_by_side);
  EXPECT_GT(frames_of(sweeps_like_a_refit(scene, 3, 3, 4), "drift_boxes"), 0);
  EXPECT_GT(frames_of(sweeps_like_a_refit(flying_triangles(1000, 100, Flight::anywhere), 60, 3, 4),
                      "interval_join"),
            0);
}

}  // namespace
}  // namespace kbvh::test::auto_test
