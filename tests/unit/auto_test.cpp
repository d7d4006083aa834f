// The choices of `auto` in clear cases, that it reports them, and that it answers like all others while it
// changes its choice.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/choice/observed_ageing.hpp"
#include "core/families/choice/observed_join.hpp"
#include "core/families/choice/observed_slabs.hpp"
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

/// A search with a given number of box tests.
struct Told final : ReportsWork {
  explicit Told(std::uint64_t box_tests) : tests(box_tests) {}
  std::uint64_t last_box_tests() const override { return tests; }
  std::uint64_t tests;
};

TEST(ObservedSlabs, CompareTwoFramesInARow) {
  Observed seen;
  seen.reads = 1000;
  ObservedSlabs slabs;
  slabs.start_over(true, seen);
  slabs.prepare_choice(0, seen);
  EXPECT_EQ(plain_cost(seen), std::numeric_limits<double>::infinity()) << "nothing is known";
  // Without slabs it may be faster, so it is tried.
  slabs.slabs(100, Told(10000), true, 1, seen);
  slabs.prepare_choice(1, seen);
  EXPECT_LT(plain_cost(seen), refit_cost(seen));
  // The trial shows that slabs leave out 29 of 30 candidates.
  slabs.plain(3000, Told(9000), true, 2, seen);
  EXPECT_EQ(seen.candidates, 100);
  EXPECT_EQ(seen.boxed, 30);
  slabs.prepare_choice(2, seen);
  EXPECT_GT(plain_cost(seen), refit_cost(seen));
  EXPECT_TRUE(seen.plain_known);
  EXPECT_GT(sorted_cost(seen), plain_cost(seen)) << "new trees have no slabs";
  // Half of the candidates and of the box tests, with slabs, too.
  slabs.plain(1500, Told(4500), true, 3, seen);
  EXPECT_EQ(seen.candidates, 50);
  EXPECT_EQ(seen.plain_tests, 4500);
  EXPECT_EQ(seen.slab_tests, 5000);
  // The comparison becomes outdated, and a frame of leaf_slabs allows the next one.
  for (int choice = 0; choice < 20; ++choice) slabs.prepare_choice(100 + choice, seen);
  EXPECT_EQ(plain_cost(seen), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(seen.plain_known);
  slabs.slabs(100, Told(10000), true, 200, seen);
  slabs.prepare_choice(200, seen);
  EXPECT_FALSE(seen.plain_known) << "hoped";
  EXPECT_LT(plain_cost(seen), refit_cost(seen));
  // It also becomes outdated when candidates become many.
  slabs.plain(150, Told(9000), true, 201, seen);
  slabs.prepare_choice(201, seen);
  EXPECT_LT(plain_cost(seen), refit_cost(seen));
  slabs.plain(400, Told(20000), true, 202, seen);
  slabs.prepare_choice(202, seen);
  EXPECT_TRUE(seen.plain_known) << "a comparison lasts for some frames";
  slabs.prepare_choice(210, seen);
  EXPECT_EQ(plain_cost(seen), std::numeric_limits<double>::infinity());
}

TEST(ObservedSlabs, LeaveOutAllCandidates) {
  Observed seen;
  seen.reads = 1000;
  ObservedSlabs slabs;
  slabs.start_over(true, seen);
  slabs.slabs(0, Told(10000), true, 1, seen);
  slabs.prepare_choice(1, seen);
  EXPECT_LT(plain_cost(seen), refit_cost(seen));
  // Slabs leave out all candidates, and save thousands of tests of triangles.
  slabs.plain(3000, Told(15000), true, 2, seen);
  slabs.prepare_choice(2, seen);
  EXPECT_GT(plain_cost(seen), refit_cost(seen));
}

TEST(ObservedSlabs, PairsThatIntersectAreNotCompared) {
  Observed seen;
  ObservedSlabs slabs;
  slabs.start_over(true, seen);
  slabs.slabs(100, Told(10000), false, 1, seen);
  slabs.prepare_choice(1, seen);
  EXPECT_EQ(plain_cost(seen), std::numeric_limits<double>::infinity());
}

TEST(ObservedAgeing, KeepsWhatTheFirstSearchInNewTreesTells) {
  Observed seen;
  seen.candidates = 1000;
  seen.slab_tests = 9000;
  ObservedAgeing ageing;
  ageing.start_over(10);
  ageing.refitted(9000, 1000, 20, seen);
  ageing.look_at_refitted(30, 20, seen);  // boxes have grown by 3: up to two thirds of the tests may be saved
  EXPECT_DOUBLE_EQ(seen.aged, 2.0 / 3);
  EXPECT_DOUBLE_EQ(seen.ageing, 300);
  ageing.rebuilt(6000, 1300, 21, seen);  // one third is
  EXPECT_DOUBLE_EQ(seen.aged, 1.0 / 3);
  EXPECT_DOUBLE_EQ(seen.boxed, 1.3);
  EXPECT_DOUBLE_EQ(seen.candidates, 1000);
  EXPECT_DOUBLE_EQ(seen.slab_tests, 9000);
  ageing.rebuilt(8000, 2600, 22, seen);  // the factor stays
  EXPECT_DOUBLE_EQ(seen.aged, 1.0 / 3);
  EXPECT_DOUBLE_EQ(seen.candidates, 2000);
  EXPECT_DOUBLE_EQ(seen.slab_tests, 12000);
  ageing.refitted(9000, 0, 30, seen);  // back again, with as many tests as before
  ageing.look_at_refitted(30, 30, seen);
  EXPECT_DOUBLE_EQ(seen.aged, 1.0 / 3);
}

TEST(ObservedAgeing, ComparesTheTestsPerCandidate) {
  Observed seen;
  seen.candidates = seen.boxed = 1;
  ObservedAgeing ageing;
  ageing.start_over(10);
  seen.candidates = 4000;
  ageing.refitted(50000, 4000, 20, seen);
  ageing.look_at_refitted(20, 20, seen);
  ageing.rebuilt(20000, 1000, 21,
                 seen);  // bodies have parted: two of five tests, and of candidates
  EXPECT_DOUBLE_EQ(seen.aged, 0);
}

TEST(ObservedAgeing, DoesNotCompareWithAnOldFrame) {
  Observed seen;
  seen.candidates = 10;
  ObservedAgeing ageing;
  ageing.start_over(10);
  ageing.refitted(9000, 0, 20, seen);
  ageing.look_at_refitted(20, 20, seen);
  ageing.rebuilt(100000, 5000, 60, seen);  // thousands of contacts have begun since
  EXPECT_DOUBLE_EQ(seen.aged, 0.5);
  EXPECT_DOUBLE_EQ(seen.boxed, 1.3);
}

TEST(ObservedAgeing, ForgetsWhileRebuiltTreesAnswer) {
  Observed seen;
  ObservedAgeing ageing;
  ageing.start_over(10);
  ageing.refitted(4000, 0, 10, seen);
  ageing.look_at_refitted(40, 10, seen);
  ageing.rebuilt(1000, 0, 11, seen);
  EXPECT_DOUBLE_EQ(seen.aged, 0.75);
  for (int choice = 0; choice < 60; ++choice) ageing.look_at_rebuilt(7, false, seen);
  ageing.rebuilt(1000, 0, 400, seen);
  EXPECT_LT(seen.aged, 0.05);
  EXPECT_EQ(seen.ageing, 7);
}

TEST(ObservedAgeing, KnowsHowMuchFasterTheSurplusOfTreesThatLastGrows) {
  Observed seen;
  ObservedAgeing ageing;
  ageing.start_over(10);
  ageing.look_at_rebuilt(10, false, seen);
  EXPECT_GT(seen.sorted_ageing, 10);
  ageing.look_at_rebuilt(60, true, seen);
  EXPECT_DOUBLE_EQ(seen.sorted_ageing, 60);
  EXPECT_DOUBLE_EQ(seen.ageing, 10);
  ageing.look_at_rebuilt(90, true, seen);
  EXPECT_DOUBLE_EQ(seen.ageing, 15);
  ageing.look_at_rebuilt(20, false, seen);
  EXPECT_DOUBLE_EQ(seen.sorted_ageing, 120);
}

TEST(PredictedCosts, SortTreesThatLastAndBuildThoseThatAgeAtOnce) {
  Observed seen;
  seen.reads = seen.primitives = 10000;
  seen.slab_tests = 2e6;
  seen.aged = 0.95;
  seen.ageing = seen.sorted_ageing = 100;
  EXPECT_LT(sorted_cost(seen), rebuilt_cost(seen));
  seen.ageing = seen.sorted_ageing = 50000;
  EXPECT_LT(rebuilt_cost(seen), sorted_cost(seen));
}

/// Segments of ten frames, with contacts.
Observed meeting() {
  Observed seen;
  seen.reads = 10000;
  seen.candidates = 1000;
  seen.slab_tests = 20000;
  seen.frames_per_segment = 10;
  seen.near = true;
  return seen;
}

TEST(ObservedJoin, IsTriedAndJudgedByItsWork) {
  Observed seen = meeting();
  const double predicted = join_cost(seen);
  ObservedJoin join;
  join.start_over(seen);
  EXPECT_LT(join_cost(seen), predicted) << "it may be faster";
  join.refitted(1, seen);
  join.joined(3 * predicted, 500, 10, seen);
  EXPECT_TRUE(join.known());
  EXPECT_DOUBLE_EQ(join_cost(seen), 3 * predicted);
  for (int choice = 0; choice < 100; ++choice) join.forget(seen);
  EXPECT_NEAR(join_cost(seen), predicted, 0.01 * predicted);
}

TEST(ObservedJoin, IsComparedAgainWhereContactsChange) {
  Observed seen = meeting();
  ObservedJoin join;
  join.start_over(seen);
  join.refitted(1, seen);
  join.joined(20000, 500, 10, seen);
  join.joined(70000, 520, 10, seen);  // the same contacts, more work: its boxes have aged
  EXPECT_FALSE(join.outdated());
  EXPECT_DOUBLE_EQ(join_cost(seen), 70000);
  join.joined(90000, 1500, 10, seen);  // more contacts, not yet twice the work
  EXPECT_FALSE(join.outdated());
  EXPECT_DOUBLE_EQ(join_cost(seen), 70000);
  join.joined(150000, 1600, 10, seen);
  EXPECT_TRUE(join.outdated());
  seen.candidates = 5000;  // a refit has answered, and found more of them, too
  join.refitted(1, seen);
  EXPECT_FALSE(join.outdated());
  EXPECT_DOUBLE_EQ(join_cost(seen), 150000);
}

TEST(ObservedJoin, IsComparedAgainAfterAWhile) {
  Observed seen = meeting();
  ObservedJoin join;
  join.start_over(seen);
  join.refitted(1, seen);
  const double refit = refit_cost(seen);
  int frames[3];
  for (int& frame : frames) {
    join.refitted(0, seen);
    for (frame = 1; !join.outdated() && frame < 10000; ++frame) join.joined(refit, 500, frame, seen);
  }
  EXPECT_GT(frames[0], 20);
  EXPECT_GT(frames[1], 1.5 * frames[0]) << "ever more seldom";
  EXPECT_GT(frames[2], 1.5 * frames[1]);
  ObservedJoin fast;
  fast.start_over(seen);
  fast.refitted(0, seen);
  int frame = 1;
  for (; !fast.outdated(); ++frame) fast.joined(refit / 10, 500, frame, seen);
  EXPECT_GT(frame, 5 * frames[0]) << "where a refit costs many frames of the join";
}

TEST(ObservedJoin, IsNotComparedWithARefitOfBodiesThatWereApart) {
  Observed seen = meeting();
  ObservedJoin join;
  join.start_over(seen);
  seen.near = false;
  join.refitted(1, seen);
  join.joined(100, 0, 10, seen);  // apart: nothing is learned
  EXPECT_FALSE(join.known());
  seen.near = true;
  join.joined(50000, 500, 10, seen);
  EXPECT_TRUE(join.outdated());
  EXPECT_FALSE(join.known());
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
  std::string choices[2];
  for (const Use use : {Use::verified, Use::timed}) {
    Session<float> session(scene, {&find_strategy("auto"), {}, {}}, use);
    session.reset(0);
    PhaseTimes times;
    PairBuffer pairs;
    for (int f = 1; f <= 87; ++f) {
      session.advance(f / 3.0, times);
      session.query(pairs, times);
    }
    choices[use == Use::timed] = session.strategy().choice();
  }
  EXPECT_EQ(choices[0], choices[1]);
  EXPECT_NE(choices[0].find("interval_join"), std::string::npos) << choices[0];
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

// Whatever the predicted cost of a join, it is not chosen again where its counts show that a refit costs
// less: where bodies meet, and where they did not seem to meet; in segments of any length.
TEST(Auto, AJoinThatCostsMoreThanARefitIsLeft) {
  for (const double frames : {2.0, 10.0, 30.0, 100.0, 1e4})
    for (const bool near : {false, true})
      for (const double times : {1.2, 3.0, 40.0, 1e5}) {
        Observed seen;
        seen.frames_per_segment = frames;
        seen.near = near;
        seen.reads = 4000;
        seen.slab_tests = 1000;
        seen.candidates = near ? 100 : 0;
        ObservedJoin join;
        join.start_over(seen);
        join.refitted(1, seen);
        join.joined(times * refit_cost(seen), seen.candidates, 20, seen);
        EXPECT_GT(join_cost(seen), 1.1 * refit_cost(seen))
            << times << " times a refit, " << frames << " frames a segment, near: " << near;
        // The measurement of one segment does not count for ever.
        for (int choice = 0; choice < 40; ++choice) join.forget(seen);
        if (frames >= 30) {
          EXPECT_LT(join_cost(seen), refit_cost(seen)) << times << ", " << near;
        }
      }
}

}  // namespace
}  // namespace kbvh::test::auto_test
