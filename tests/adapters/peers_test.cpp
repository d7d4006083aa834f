// Peers (contestants from other libraries) keep their declared promises on scenes that are difficult for
// them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/judge/probe_oracle.hpp"
#include "core/judge/verify.hpp"
#include "scenes.hpp"
#include "tests/support/ray_sets.hpp"
#include "tests/support/rolled_sheet.hpp"

namespace {
using namespace kbvh;

/// The families of peers in this build.
const std::vector<std::string> peers{KBVH_PEERS};

bool is_peer(const Info& info) {
  return std::find(peers.begin(), peers.end(), info.family) != peers.end();
}

/// Every combination of words that the parameters admit.
std::vector<std::map<std::string, std::string>> settings(const Info& info) {
  std::vector<std::map<std::string, std::string>> all{{}};
  for (const Parameter& parameter : info.parameters) {
    std::vector<std::map<std::string, std::string>> more;
    for (const auto& one : all)
      for (const std::string& word : parameter.allowed) {
        more.push_back(one);
        more.back()[parameter.name] = word;
      }
    if (!more.empty()) all = std::move(more);
  }
  return all;
}

std::string describe(const Info& info, const std::map<std::string, std::string>& params) {
  std::string text = info.id;
  for (const auto& [key, value] : params) text += " " + key + "=" + value;
  return text;
}

/// Calls the check for every peer, under all its settings, that can play the scene.
template <class S, class Check>
void for_each_peer(const Scene<S>& scene, Check&& check) {
  for (const StrategyEntry& entry : registry())
    if (is_peer(entry.info) && entry.factory<S>() != nullptr && unsuitable_bodies(entry.info, scene).empty())
      for (const auto& params : settings(entry.info)) check(Contestant{&entry, params, {}});
}

TEST(Peers, EveryLibraryHasContestants) {
  for (const std::string& family : peers)
    EXPECT_TRUE(std::any_of(registry().begin(), registry().end(),
                            [&](const StrategyEntry& entry) { return entry.info.family == family; }))
        << "no contestant has the family '" << family << "' that adapters/CMakeLists.txt names";
}

template <class S>
void keeps_guarantee(std::uint32_t frames_per_keyframe) {
  const std::vector<Scene<S>> scenes = adapters_test::awkward_scenes<S>();
  std::map<std::string, std::size_t> played;
  for (const Scene<S>& scene : scenes) {
    Oracle<S> oracle(scene);
    const auto frames = frame_times(scene, frames_per_keyframe);
    for_each_peer(scene, [&](const Contestant& contestant) {
      ++played[describe(contestant.entry->info, contestant.params)];
      SCOPED_TRACE(describe(contestant.entry->info, contestant.params) + " on '" + scene.name + "'");
      Session<S> session(scene, contestant);
      const Verification found = verify<S>(session, frames, oracle);
      EXPECT_TRUE(found.holds()) << found.first_violation;
      EXPECT_EQ(found.missed_candidates, 0u);
      EXPECT_EQ(found.audit.protrusion, 0);
      EXPECT_GT(session.strategy().bytes(), 0u);
    });
  }
  // A peer may decline a kind of body, but must not decline the test.
  for (const auto& [peer, count] : played) EXPECT_GE(2 * count, scenes.size()) << peer;
  for (const StrategyEntry& entry : registry()) {
    if (!is_peer(entry.info) || entry.factory<S>() == nullptr) continue;
    for (const auto& params : settings(entry.info))
      EXPECT_TRUE(played.contains(describe(entry.info, params))) << describe(entry.info, params);
  }
}

TEST(Peers, KeepTheirGuaranteeInFloat) {
  keeps_guarantee<float>(3);
}
TEST(Peers, KeepTheirGuaranteeInDouble) {
  keeps_guarantee<double>(3);
}

/// Bodies of lattice points at random scales and offsets: nearly all touch, and nearly all numbers are
/// rounded.
template <class S>
void never_lose_contacts(std::uint32_t seeds) {
  std::uint64_t pairs = 0;
  for (std::uint32_t seed = 0; seed < seeds; ++seed) {
    const double scale = std::ldexp(1 + .1 * (seed % 7), int(seed % 60) - 30);
    const double offset = seed % 3 == 0 ? 0 : scale * std::ldexp(1.3, int(seed % 20));
    const auto scene = adapters_test::lattice<S>(seed, scale, offset);
    Oracle<S> oracle(scene);
    const auto frames = frame_times(scene, 2);
    for_each_peer(scene, [&](const Contestant& contestant) {
      SCOPED_TRACE(describe(contestant.entry->info, contestant.params) + ", seed " + std::to_string(seed));
      Session<S> session(scene, contestant);
      const Verification found = verify<S>(session, frames, oracle);
      ASSERT_TRUE(found.holds()) << found.first_violation;
      ASSERT_EQ(found.missed_candidates, 0u);
      pairs += found.pairs;
    });
  }
  EXPECT_GT(pairs, 100 * seeds);
}

TEST(Peers, NeverLoseContactsInFloat) {
  never_lose_contacts<float>(60);
}
TEST(Peers, NeverLoseContactsInDouble) {
  never_lose_contacts<double>(20);
}

TEST(Peers, RefuseToGoBackInTime) {
  const auto scene = adapters_test::awkward_scenes<float>()[0];
  for_each_peer(scene, [&](const Contestant& contestant) {
    SCOPED_TRACE(contestant.entry->info.id);
    Session<float> session(scene, contestant);
    PhaseTimes times;
    session.reset(1);
    session.advance(2, times);
    EXPECT_THROW(session.advance(1.5, times), std::invalid_argument);
    session.reset(0);  // only starting over may go back in time
    EXPECT_NO_THROW(session.advance(.5, times));
  });
}

TEST(Peers, FollowPlanChangesOfBodiesAtRest) {
  auto scene = adapters_test::scene<float>(
      "rest", {adapters_test::grid<float>(4, .25f, 3, {0, 0}), adapters_test::grid<float>(4, .25f, 3, {1})});
  PlanScript<float> script;
  script.steps.push_back({.25, {}});
  for (std::uint32_t v = 0; v < 25; ++v) {
    PlanChange<float> change;
    change.body = 1;
    change.vertex = v;
    change.velocity[2] = -2;
    script.steps[0].changes.push_back(change);
  }
  std::vector<double> frames{0, .25, .5, .75, 1};
  for_each_peer(scene, [&](const Contestant& contestant) {
    SCOPED_TRACE(contestant.entry->info.id);
    Session<float> session(scene, contestant);
    Oracle<float> oracle(scene);
    const Verification found = verify<float>(session, frames, oracle, &script);
    EXPECT_TRUE(found.holds()) << found.first_violation;
    EXPECT_GT(found.pairs, 0u);
  });
}

TEST(Peers, AnswerTheSameAfterStartingOver) {
  const auto scene = adapters_test::awkward_scenes<float>()[1];
  for_each_peer(scene, [&](const Contestant& contestant) {
    SCOPED_TRACE(contestant.entry->info.id);
    Session<float> session(scene, contestant);
    PhaseTimes times;
    PairBuffer first, second;
    session.reset(0);
    session.advance(1.5, times);
    session.query(first, times);
    session.advance(3, times);
    session.reset(0);
    session.advance(1.5, times);
    session.query(second, times);
    std::sort(first.begin(), first.end());
    std::sort(second.begin(), second.end());
    EXPECT_EQ(first, second);
    EXPECT_FALSE(first.empty());
  });
}

/// Returns two soups that pass through each other within the cube of this half-side around the origin, or, if
/// `aside`, in a corner of it.
template <class S>
Scene<S> soups_within(double most, bool aside) {
  const double scale = aside ? most / 8 : most / 1.25, offset = aside ? most - most / 6 : 0;
  return adapters_test::scene<S>(
      "at the limit", {adapters_test::soup<S>({.scale = scale, .offset = offset, .size = .25, .seed = 31}),
                       adapters_test::soup<S>({.scale = scale, .offset = offset, .size = .25, .seed = 32})});
}

/// Within its range a peer answers, also with its own test of triangles; beyond it, the peer reports that
/// before it plays.
template <class S>
void range_is_kept() {
  std::size_t limited = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!is_peer(entry.info) || entry.factory<S>() == nullptr) continue;
    const double most = std::min(entry.info.max_coordinate, double(admissible_magnitude<S>));
    for (const bool aside : {false, true}) {
      const Scene<S> scene = soups_within<S>(most, aside);
      Oracle<S> oracle(scene);
      for (const auto& params : settings(entry.info)) {
        SCOPED_TRACE(describe(entry.info, params) + (aside ? " aside" : ""));
        ASSERT_EQ(unsuitable_bodies(entry.info, scene), "");
        Session<S> session(scene, {&entry, params, {}});
        const Verification found = verify<S>(session, frame_times(scene, 3), oracle);
        EXPECT_TRUE(found.holds()) << found.first_violation;
        EXPECT_EQ(found.missed, 0u);
        EXPECT_EQ(found.extra, 0u);
        EXPECT_GT(found.pairs, 0u);
      }
    }
    if (!(entry.info.max_coordinate < double(admissible_magnitude<S>))) continue;
    ++limited;
    SCOPED_TRACE(entry.info.id);
    const Scene<S> beyond = soups_within<S>(2 * most, false);
    EXPECT_TRUE(unsuitable_bodies(entry.info, beyond).starts_with("takes coordinates up to "));
    EXPECT_THROW(Session<S>(beyond, {&entry, {}, {}}), ConfigError);
    // A motion that leaves the range later: by a change of plans, at a knot of the new plan, or by positions
    // handed in.
    Scene<S> scene = soups_within<S>(most / 4, false);
    PhaseTimes times;
    PlanChange<S> change{.body = 1, .vertex = 2};
    change.velocity[1] = S(most);
    {
      Session<S> session(scene, {&entry, {}, {}});
      session.reset(0);
      session.change_plans(std::span(&change, 1), times);
      session.advance(.5, times);
      EXPECT_THROW(session.advance(2.5, times), std::invalid_argument);
      session.advance(.6, times);
      PlanScript<S> script;
      script.steps.push_back({0, {change}});
      const std::vector<double> short_clip{0, .5}, long_clip{0, .5, 2.5};
      EXPECT_EQ(out_of_range(entry.info, scene, script, std::span<const double>(short_clip)), "");
      const std::string why = out_of_range(entry.info, scene, script, std::span<const double>(long_clip));
      EXPECT_NE(why.find("but vertex 2 of body 1 is at y = "), std::string::npos) << why;
      change.times = {1.0};
      change.positions = {0, 0, S(1.5 * most)};
      EXPECT_THROW(session.change_plans(std::span(&change, 1), times), std::invalid_argument);
    }
    std::vector<S> given(scene.bodies[1].plans.keyframe(0),
                         scene.bodies[1].plans.keyframe(0) + 3 * scene.bodies[1].plans.vertex_count());
    scene.bodies[1].plans = FlightPlans<S>::handed_in(scene.bodies[1].plans.vertex_count(), given);
    Session<S> session(scene, {&entry, {}, {}});
    session.reset(0);
    given.push_back(0);
    given[4] = S(-1.5 * most);
    EXPECT_THROW(session.hand_in(1, given.data()), std::invalid_argument);
    if (!entry.info.can.rays) continue;
    Ray<S> ray{};
    ray.origin[2] = S(1.5 * most);
    ray.direction[2] = -1;
    ray.length = std::numeric_limits<S>::infinity();
    RayHit hit;
    EXPECT_THROW(
        session.probe(RayProbes<S>{RayQuery::closest, std::span<const Ray<S>>(&ray, 1), std::span(&hit, 1)},
                      times),
        std::invalid_argument);
  }
  EXPECT_GT(limited, 0u);
}

TEST(Peers, StateTheirRangeInFloat) {
  range_is_kept<float>();
}
TEST(Peers, StateTheirRangeInDouble) {
  range_is_kept<double>();
}

/// Bullet's margin of 1.0 is the reason for scaling its scene; the parameter shows the difference.
TEST(Bullet, ScalingKeepsFalsePairsOfSmallMeshesAway) {
  const auto found = std::find_if(registry().begin(), registry().end(),
                                  [](const StrategyEntry& entry) { return entry.info.id == "bullet_bvh"; });
  if (found == registry().end()) GTEST_SKIP() << "built without Bullet";
  const auto scene =
      adapters_test::scene<float>("millimetres", {adapters_test::soup<float>({.scale = 1e-3, .seed = 22}),
                                                  adapters_test::soup<float>({.scale = 1e-3, .seed = 23})});
  Oracle<float> oracle(scene);
  const auto candidates = [&](const std::string& scale) {
    Session<float> session(scene, {&*found, {{"scale", scale}}, {}});
    return verify<float>(session, frame_times(scene, 2), oracle).candidates;
  };
  EXPECT_GT(candidates("none"), 3 * candidates("fit"));
}

/// Returns a strip that runs around an axis once and a quarter, in a plane but for a tilt, and cuts its
/// beginning.
Scene<float> overlapping_strip() {
  constexpr std::uint32_t n = 40;
  Scene<float> scene;
  scene.bodies.push_back(test::placed_grid<float>(
      n, 2, [](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
        const double turn = 2.5 * 3.14159265358979 * i / n, radius = 0.5 + 0.5 * j / n;
        if (axis == 2) return (i < 32 ? -0.05 : 0.05) * (radius - 0.75) + 0.01 * k;
        return radius * (axis == 0 ? std::cos(turn) : std::sin(turn));
      }));
  scene.pairs = {{0, 0}};
  return scene;
}

/// Cones prove nothing without a test of the contour, and Bullet has none: it skips a strip that cuts its own
/// beginning. The oracle counts what is missed. Without cones the tree misses nothing.
TEST(Bullet, ConesLosePairsWithinABody) {
  const auto played = [](const char* id, const Scene<float>& scene) {
    Session<float> session(scene, {&find_strategy(id), {}, {}});
    Oracle<float> oracle(scene);
    return verify<float>(session, frame_times(scene, 4), oracle);
  };
  if (std::find(peers.begin(), peers.end(), "bullet") == peers.end()) GTEST_SKIP() << "built without Bullet";
  const Scene<float> strip = overlapping_strip(), roll = test::rolled_sheet<float>(30, 2, 0.5, 0.05);
  for (const Scene<float>* scene : {&strip, &roll}) {
    const Verification all = played("bullet_dbvt", *scene);
    EXPECT_TRUE(all.holds()) << all.first_violation;
    EXPECT_EQ(all.missed, 0u);
    EXPECT_GT(all.pairs, 100u);
  }
  const Verification none = played("bullet_cones", strip), some = played("bullet_cones", roll);
  EXPECT_TRUE(none.holds()) << none.first_violation;
  EXPECT_EQ(none.candidates, 0u);
  EXPECT_EQ(none.missed, none.pairs);
  EXPECT_EQ(none.audit.protrusion, 0);
  // Normals in all directions: the root is entered.
  EXPECT_TRUE(some.holds()) << some.first_violation;
  EXPECT_LT(some.missed, some.pairs);
  EXPECT_EQ(some.extra, 0u);
}

/// More than 4096 primitives, which Embree refits subtree by subtree, and one body that is not made of
/// triangles. Checked builds also compare the roots of the two hierarchies, only one of which is collided.
TEST(Embree, RefitsEitherGeometryOfLargerBodies) {
  const auto found = std::find_if(registry().begin(), registry().end(),
                                  [](const StrategyEntry& entry) { return entry.info.id == "embree_refit"; });
  if (found == registry().end()) GTEST_SKIP() << "built without Embree";
  const auto scene = adapters_test::scene<float>(
      "passing sheet",
      {adapters_test::grid<float>(50, .04, 3, {1, .5, -1}),
       adapters_test::grid<float>(50, .04, 4, {-1, .5, 1}),
       adapters_test::soup<float>({.primitives = 400, .corners = 3, .size = .1, .seed = 24})});
  Oracle<float> oracle(scene);
  const auto frames = frame_times(scene, 4);
  std::vector<Verification> results;
  for (const char* geometry : {"user", "triangles"})
    for (const char* layout : {"compact", "default"}) {
      SCOPED_TRACE(std::string(geometry) + ", " + layout);
      Session<float> session(scene, {&*found, {{"geometry", geometry}, {"layout", layout}}, {}});
      results.push_back(verify<float>(session, frames, oracle));
      EXPECT_TRUE(results.back().holds()) << results.back().first_violation;
      EXPECT_GT(results.back().pairs, 1000u);
      EXPECT_EQ(results.back().candidates, results.front().candidates);
    }
}

/// Embree flushes denormals; code that runs after it must not be affected.
TEST(Embree, LeavesTheFloatingPointStateAlone) {
  const auto found = std::find_if(registry().begin(), registry().end(),
                                  [](const StrategyEntry& entry) { return entry.info.id == "embree_refit"; });
  if (found == registry().end()) GTEST_SKIP() << "built without Embree";
  const auto scene = adapters_test::awkward_scenes<float>()[1];
  Session<float> session(scene, {&*found, {}, {}});
  PhaseTimes times;
  PairBuffer pairs;
  volatile float denormal = 1e-40f;
  session.reset(0);
  EXPECT_NE(denormal * .5f, 0);
  for (double t : {.5, 1., 1.5}) {
    session.advance(t, times);
    EXPECT_NE(denormal * .5f, 0);
    session.query(pairs, times);
    EXPECT_NE(denormal * .5f, 0);
  }
}

/// A peer's own test of rays may differ from the exact answer, but only rarely on triangles in general
/// position.
TEST(Peers, RaysDifferFromTheTruthSeldom) {
  for (const std::uint32_t corners : {3u, 4u}) {
    const Scene<float> scene = adapters_test::scene<float>(
        "soup", {adapters_test::soup<float>({.primitives = 80, .corners = corners, .size = .5}),
                 adapters_test::soup<float>({.primitives = 60, .corners = corners, .size = .5, .seed = 2})});
    const auto frames = frame_times(scene, 2);
    for_each_peer(scene, [&](const Contestant& contestant) {
      if (!contestant.entry->info.can.rays) return;
      SCOPED_TRACE(describe(contestant.entry->info, contestant.params));
      EXPECT_EQ(contestant.entry->info.rays_guarantee, Guarantee::approximate);
      Session<float> session(scene, contestant);
      PhaseTimes ignored;
      PairBuffer pairs;
      std::size_t hits = 0, others = 0, asked = 0;
      for (std::size_t f = 0; f < frames.size(); ++f) {
        f == 0 ? session.reset(frames[0]) : session.advance(frames[f], ignored);
        if (f % 2 == 1) session.query(pairs, ignored);
        const auto rays = test::rays_at(scene, session.playback(), 100, std::uint32_t(f));
        std::vector<Ray<float>> general;  // the first kind: through the scene
        for (std::size_t i = 0; i < rays.size(); i += 8) general.push_back(rays[i]);
        std::vector<RayHit> found(general.size()), any(general.size()), truth(general.size());
        session.probe(RayProbes<float>{RayQuery::closest, general, std::span<RayHit>(found)}, ignored);
        session.probe(RayProbes<float>{RayQuery::any, general, std::span<RayHit>(any)}, ignored);
        brute_force_hits<float>(scene, session.playback(), RayQuery::closest, general,
                                std::span<RayHit>(truth));
        for (std::size_t i = 0; i < general.size(); ++i) {
          ++asked;
          hits += truth[i] ? 1 : 0;
          const bool same = bool(found[i]) == bool(truth[i]) && bool(any[i]) == bool(truth[i]) &&
                            found[i].body == truth[i].body && found[i].primitive == truth[i].primitive &&
                            (!truth[i] || std::abs(found[i].parameter / truth[i].parameter - 1) < 1e-3);
          others += same ? 0 : 1;
        }
      }
      EXPECT_GT(hits, 20u);
      EXPECT_LE(50 * others, asked);
    });
  }
}

}  // namespace
