// Bodies over one vertex set: every strategy answers as for bodies with copies of the vertices, but for pairs
// of primitives with a common vertex, which are no pairs. Positions exist once, and changes of plans and of
// vertices that are made for one body reach all.

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/facade/world.hpp"
#include "core/judge/audit.hpp"
#include "core/parallel/workers.hpp"
#include "core/topology/renumber.hpp"
#include "tests/conformance/check.hpp"
#include "tests/conformance/vertex_set_scenes.hpp"

namespace kbvh::test::vertex_sets_test {
namespace {

template <class S>
class VertexSets : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(VertexSets, Scalars);

TYPED_TEST(VertexSets, AnswerLikeCopiesWithoutIncidentPairs) {
  using S = TypeParam;
  for (const TestScene<S>& test : all_scenes<S>()) {
    const Truth truth = truth_of(test);
    EXPECT_GT(truth.pairs_of_sets, 50u) << test.scene.name;
    EXPECT_GT(truth.incident, 50u) << test.scene.name;
    std::size_t took_part = 0;
    for (const StrategyEntry& entry : registry()) {
      if (!skipped(entry, test).empty() || !unsuitable_bodies(entry.info, test.scene).empty()) continue;
      ++took_part;
      Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
      EXPECT_EQ(difference(session, test, truth), "") << entry.info.id << " on " << test.scene.name;
    }
    EXPECT_GT(took_part, 5u) << test.scene.name;
  }
}

TYPED_TEST(VertexSets, BothOraclesAgree) {
  using S = TypeParam;
  for (const TestScene<S>& test : all_scenes<S>()) {
    const Truth truth = truth_of(test);
    Playback<S> playback(test.scene);
    ChangingScene<S> changing(test.scene);
    auto step = test.script.steps.begin();
    for (std::size_t f = 0; f < test.frames.size(); ++f) {
      playback.seek(test.frames[f]);
      EXPECT_EQ(brute_force_pairs(changing.scene(), playback), truth.frames[f]) << test.scene.name;
      EXPECT_EQ(sweep_pairs(changing.scene(), playback), truth.frames[f]) << test.scene.name;
      for (; step != test.script.steps.end() && step->time <= test.frames[f]; ++step) {
        playback.change_plans(test.frames[f], step->changes);
        if (!step->geometry.empty()) changing.apply(step->geometry, playback);
      }
    }
  }
}

TYPED_TEST(VertexSets, SpansNameNoIncidentPairs) {
  using S = TypeParam;
  TestScene<S> test = panels<S>();
  test.frames = frame_times(test.scene, 4);
  const Truth truth = truth_of(test);
  std::size_t strategies = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.spans || !skipped(entry, test).empty()) continue;
    ++strategies;
    Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    session.reset(test.frames[0]);
    SpanBuffer spans;
    for (std::size_t f = 1; f < test.frames.size(); ++f) {
      spans.clear();
      session.spans(test.frames[f], spans);
      std::set<PrimitivePair> named;
      for (const PairSpan& span : spans) {
        named.insert(span.pair);
        EXPECT_FALSE(test.scene.same_vertices(span.pair.body_a, span.pair.body_b) &&
                     have_common_vertex(test.scene, span.pair))
            << entry.info.id << ", " << text(span.pair);
      }
      for (const PrimitivePair& pair : truth.frames[f])
        EXPECT_TRUE(named.contains(pair)) << entry.info.id << " lacks " << text(pair);
    }
  }
  EXPECT_GT(strategies, 0u);
}

/// A seam is no contact: panels that rest touch each other there and nowhere else.
TYPED_TEST(VertexSets, SeamsAreNoContacts) {
  using S = TypeParam;
  const Sheet sheet(4);
  const std::span<const Corners> faces(sheet.faces);
  std::vector<S> flat;
  for (int keyframe = 0; keyframe < 2; ++keyframe)
    for (std::uint32_t y = 0; y < 4; ++y)
      for (std::uint32_t x = 0; x < 4; ++x)
        for (const std::uint32_t c : {x, y, x * y}) flat.push_back(S(c) + S(keyframe));
  Scene<S> scene;
  scene.bodies.push_back(first_body("left", primitives(PrimitiveKind::polygons, faces.first(7)),
                                    FlightPlans<S>(16, {0, 1}, std::move(flat))));
  add_body_over(scene, 0, "right", primitives(PrimitiveKind::polygons, faces.subspan(7)));
  scene.pairs = {{0, 1}};
  const auto contacts = [](const Scene<S>& played) {
    const StrategyEntry& entry = find_strategy("bottom_up");
    Session<S> session(played, {&entry, {}, entry.info.topology.preferred});
    session.reset(0);
    ContactBuffer found;
    PhaseTimes ignored;
    session.contacts(1, found, ignored);
    EXPECT_FALSE(session.swept_pairs().empty());  // neighbours' other features could touch
    return found.size();
  };
  EXPECT_EQ(contacts(scene), 0u);
  for (Body<S>& body : scene.bodies) body.vertex_set = own_vertices;
  EXPECT_GT(contacts(scene), 10u);
}

// ---- Once for all bodies

TYPED_TEST(VertexSets, HavePositionsOnce) {
  using S = TypeParam;
  const TestScene<S> test = elements<S>(Level::boxes, Numbers::any, Asked::of_two_bodies);
  EXPECT_EQ(test.scene.vertex_count(), 25u);
  for (const std::uint32_t threads : {1u, std::min(2u, most_threads())}) {
    Playback<S> playback(test.scene);
    playback.use_threads(threads);
    EXPECT_EQ(playback.body_count(), 3u);
    playback.seek(0.25);
    EXPECT_FALSE(playback.all_current(2));
    const std::uint32_t some[] = {3, 4};
    playback.fetch(1, some);
    EXPECT_EQ(playback.fetched(), 2u);
    EXPECT_EQ(playback.position(0, 3), playback.positions(2) + 9);
    EXPECT_EQ(playback.position(2, 4), playback.positions(1) + 12);
    EXPECT_EQ(playback.fetched(), 2u);
    playback.evaluate_all();
    std::vector<S> expected(3 * 25 + 1);
    test.scene.bodies[1].plans.evaluate(0.25, expected.data());
    for (std::uint32_t body = 0; body < 3; ++body) {
      EXPECT_EQ(playback.positions(body), playback.positions(0));
      EXPECT_TRUE(playback.all_current(body));
      EXPECT_EQ(&playback.plans(body), &playback.plans(0));
    }
    EXPECT_TRUE(std::equal(expected.begin(), expected.end() - 1, playback.positions(0)));
  }
}

TYPED_TEST(VertexSets, TakePositionsHandedInOnce) {
  using S = TypeParam;
  const Sheet sheet(5);
  const FlightPlans<S> plans = folding<S>(sheet, Numbers::any);
  const auto keyframe = [&](std::size_t k) {
    return std::vector<S>(plans.keyframe(k), plans.keyframe(k) + 75);
  };
  const auto indices = [](const std::vector<Corners>& lists) {
    Corners all;
    for (const Corners& corners : lists) all.insert(all.end(), corners.begin(), corners.end());
    return all;
  };
  const Corners faces = indices(sheet.faces), edges = indices(sheet.edges);
  Corners offsets;
  for (std::uint32_t e = 0; e <= sheet.edges.size(); ++e) offsets.push_back(2 * e);
  for (const char* id : {"bottom_up", "dirty_refit", "lbvh", "sweep"}) {
    World world(sizeof(S) == 4 ? Precision::float32 : Precision::float64);
    const std::vector<S> start = keyframe(0);
    EXPECT_EQ(world.add_body("faces", {faces}, std::span<const S>(start)), 0u);
    EXPECT_THROW(world.add_body_over(1, "edges", {edges, offsets}), std::invalid_argument);
    const Corners beyond{24, 25};
    EXPECT_THROW(world.add_body_over(0, "edges", {beyond, std::span(offsets).first(2)}),
                 std::invalid_argument);
    EXPECT_EQ(world.add_body_over(0, "edges", {edges, offsets}), 1u);
    world.add_pair(1, 0);
    world.start(id);
    EXPECT_THROW(world.add_body_over(0, "late", {edges, offsets}), std::logic_error);
    std::vector<WorldPair> pairs, truth;
    std::size_t all = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::vector<S> now = keyframe(k);
      if (k < 2) {
        world.set_positions(k % 2 == 0 ? 1 : 0, std::span<const S>(now));
      } else {
        // Only some vertices move: lists for one body are true of the other as well.
        std::vector<S> some = keyframe(1);
        const Corners moved{6, 12, 13};
        for (const std::uint32_t v : moved) std::copy_n(now.begin() + 3 * v, 3, some.begin() + 3 * v);
        world.set_positions(0, std::span<const S>(some), moved);
      }
      world.advance(double(k + 1));
      world.pairs(pairs);
      world.true_pairs(truth);
      const auto before = [](const WorldPair& a, const WorldPair& b) {
        return std::pair(a.primitive_a, a.primitive_b) < std::pair(b.primitive_a, b.primitive_b);
      };
      std::sort(pairs.begin(), pairs.end(), before);
      EXPECT_EQ(pairs, truth) << id << ", " << k;
      all += pairs.size();
      for (std::uint32_t body = 0; body < 2; ++body) {
        WorldAudit audit;
        if (!world.audit(body, audit)) continue;
        EXPECT_EQ(audit.invalid, 0u) << id << ", " << audit.first_fault;
      }
    }
    EXPECT_GT(all, 5u);
  }
}

TEST(VertexSetsOfScenes, AreChecked) {
  const TestScene<float> test = elements<float>(Level::boxes, Numbers::any, Asked::of_two_bodies);
  EXPECT_NO_THROW(validate(test.scene));
  EXPECT_NE(hash(test.scene), hash(unshared(test).scene));
  Scene<float> other_number = test.scene;
  for (Body<float>& body : other_number.bodies) body.vertex_set = 77;
  EXPECT_EQ(hash(test.scene), hash(other_number));
  Scene<float> copies = test.scene;
  copies.bodies[2].plans = folding<float>(Sheet(5), Numbers::any);  // equal, but not shared
  EXPECT_THROW(validate(copies), std::invalid_argument);
  // A second set gets a number of its own.
  Scene<float> two = panels<float>().scene;
  EXPECT_EQ(add_body_over(two, 1, "again", two.bodies[1].primitives), 3u);
  EXPECT_TRUE(two.same_vertices(1, 3));
  EXPECT_FALSE(two.same_vertices(0, 1));
  EXPECT_EQ(two.first_of_set(3), 1u);
  // Even if the first set has the largest number.
  Scene<float> largest = panels<float>().scene;
  for (Body<float>& body : largest.bodies)
    if (body.vertex_set != own_vertices) body.vertex_set = own_vertices - 1;
  EXPECT_EQ(add_body_over(largest, 1, "again", largest.bodies[1].primitives), 3u);
  EXPECT_TRUE(largest.same_vertices(1, 3));
  EXPECT_FALSE(largest.same_vertices(0, 1));
}

TYPED_TEST(VertexSets, KeepTheirPairsUnderOtherIds) {
  using S = TypeParam;
  for (const TestScene<S>& test : all_scenes<S>()) {
    const Scene<S>& scene = test.scene;
    const RenumberedScene<S> renumbered = renumber_in_leaf_order(scene, {.leaf_size = 4});
    validate(renumbered.scene);
    const auto& bodies = renumbered.scene.bodies;
    for (std::uint32_t a = 0; a < bodies.size(); ++a) {
      EXPECT_EQ(renumbered.old_vertex[a], renumbered.old_vertex[scene.first_of_set(a)]);
      for (std::uint32_t b = 0; b < bodies.size(); ++b)
        EXPECT_EQ(renumbered.scene.same_vertices(a, b), scene.same_vertices(a, b));
      // New ids follow the leaves of the first body over the vertices.
      std::uint32_t next = 0;
      for (const std::uint32_t v : bodies[scene.first_of_set(a)].primitives.vertices) {
        EXPECT_LE(v, next);
        next = std::max(next, v + 1);
      }
    }
    Playback<S> before(scene), after(renumbered.scene);
    std::size_t all = 0;
    for (const double t : test.frames) {
      before.seek(t);
      after.seek(t);
      PairBuffer pairs = brute_force_pairs(renumbered.scene, after);
      for (PrimitivePair& pair : pairs) {
        pair.primitive_a = renumbered.old_primitive[pair.body_a][pair.primitive_a];
        pair.primitive_b = renumbered.old_primitive[pair.body_b][pair.primitive_b];
        if (pair.body_a == pair.body_b && pair.primitive_a > pair.primitive_b)
          std::swap(pair.primitive_a, pair.primitive_b);
      }
      sort_pairs(pairs);
      all += pairs.size();
      EXPECT_EQ(pairs, brute_force_pairs(scene, before)) << scene.name << " at " << t;
    }
    EXPECT_GT(all, 50u) << scene.name;
  }
}

TEST(VertexSetsOfScenes, RefuseVerticesThatAnotherBodyUses) {
  const auto test = panels<float>();
  const StrategyEntry& entry = find_strategy("bottom_up");
  Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  session.reset(0);
  PhaseTimes ignored;
  GeometryChange<float> change;
  change.removed_vertices = {{0, 35}};  // a corner of the right panel
  EXPECT_THROW(session.change_geometry(change, ignored), std::invalid_argument);
  change.removed_vertices = {{0, 0}, {2, 0}};
  for (std::uint32_t p = 0; p < test.scene.bodies[0].primitives.count(); ++p)
    change.removed_primitives.push_back({0, p});
  EXPECT_THROW(session.change_geometry(change, ignored), std::invalid_argument);  // one vertex, named twice
  change.removed_vertices = {{2, 0}};
  session.change_geometry(change, ignored);
  PlanChange<float> plan;
  plan.vertex = 0;
  EXPECT_THROW(session.change_plans(std::span(&plan, 1), ignored), std::invalid_argument);
}

// ---- Seeded faults

/// The contestant plays copies: it has no set whose incident pairs it could leave out.
TYPED_TEST(VertexSets, IncidentPairsThatGetThroughAreSeen) {
  using S = TypeParam;
  for (const TestScene<S>& test :
       {panels<S>(), elements<S>(Level::boxes, Numbers::any, Asked::of_two_bodies)}) {
    TestScene<S> played = test;
    played.frames = frame_times(test.scene, 4);
    const Truth truth = truth_of(played);
    const TestScene<S> copies = unshared(played);
    const StrategyEntry& entry = find_strategy("bottom_up");
    Session<S> session(copies.scene, {&entry, {}, entry.info.topology.preferred});
    EXPECT_NE(difference(session, played, truth), "");
  }
}

/// A strategy that is told of new plans for one body only keeps the old bounds of the others.
TYPED_TEST(VertexSets, PlansThatReachOneBodyOnlyAreSeen) {
  using S = TypeParam;
  TestScene<S> test = panels<S>();
  const StrategyEntry& entry = find_strategy("kinetic_aabb");
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  PlanChange<S> change;
  change.vertex = 35;  // of the right panel, body 2; told of body 0
  change.velocity[1] = S(-50);
  enum class Told : std::uint8_t { one, all };
  const auto right_is_valid = [&](Told told) {
    session.reset(0.5);
    PhaseTimes ignored;
    const std::span<const PlanChange<S>> changes(&change, 1);
    if (told == Told::all) {
      session.change_plans(changes, ignored);
    } else {
      session.playback().change_plans(0.5, changes);
      session.strategy().flight_plans_changed(0.5, changes);
    }
    session.advance(0.875, ignored);
    PairBuffer pairs;
    session.query(pairs, ignored);
    session.playback().evaluate_all();
    const auto view = session.strategy().audit_view(2);
    return audit(*view, test.scene.bodies[2].primitives, session.playback().positions(2)).invalid == 0;
  };
  EXPECT_TRUE(right_is_valid(Told::all));
  EXPECT_FALSE(right_is_valid(Told::one));
}

}  // namespace
}  // namespace kbvh::test::vertex_sets_test
