// Insertion and deletion below the strategies: their effects on a scene, its plans and its playback, what is
// refused, and how much a kinetic tree repairs.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <string>

#include "core/contract/registry.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/judge/oracle.hpp"
#include "core/judge/plan_script.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::geometry_change_test {
namespace {

using Change = GeometryChange<double>;

struct Refused {
  const char* name;
  Change change;
  const char* says;
};

TEST(GeometryChange, WhatIsWrongIsRefusedAndNothingChanges) {
  const auto test = synthetic_scene<double>("soups");
  Playback<double> playback(test.scene);
  ChangingScene<double> changing(test.scene);
  playback.seek(0.3);
  playback.evaluate_all();
  Change first;
  first.removed_primitives = {{0, 4}};
  first.removed_vertices = {{0, 12}, {0, 13}};
  first.vertices.resize(2);
  changing.apply(first, playback);

  const std::uint32_t vertices = changing.scene().bodies[0].plans.vertex_count();
  const std::uint32_t primitives = changing.scene().bodies[0].primitives.count();
  const double infinity = std::numeric_limits<double>::infinity();
  Change::NewVertex infinite, no_knot;
  infinite.position[1] = infinity;
  no_knot.plan.times = {0.3};
  no_knot.plan.positions = {0, 0, 0};
  const std::vector<Refused> cases{
      {"body of a vertex", {.vertices = {{2}}}, "body 2 of 2"},
      {"position", {.vertices = {infinite}}, "vertex 452, axis y"},
      {"knot in the past", {.vertices = {no_knot}}, "does not follow"},
      {"body of a primitive", {.primitives = {{7, {0}}}}, "body 7 of 2"},
      {"no vertex", {.primitives = {{0, {}}}}, "has no vertex"},
      {"unknown vertex", {.primitives = {{0, {0, 1, vertices}}}}, "refers to vertex 452, but there are 452"},
      {"removed vertex", {.primitives = {{0, {0, 12, 1}}}}, "refers to vertex 12, which is removed"},
      {"vertex removed now",
       {.primitives = {{0, {14}}}, .removed_vertices = {{0, 14}}},
       "refers to vertex 14, which is removed"},
      {"unknown primitive",
       {.removed_primitives = {{0, primitives}}},
       "primitive 150 of body 0 does not exist"},
      {"new primitive",
       {.primitives = {{0, {0}}}, .removed_primitives = {{0, primitives}}},
       "primitive 150 of body 0 does not exist"},
      {"removed before", {.removed_primitives = {{0, 4}}}, "primitive 4 of body 0 was removed before"},
      {"twice", {.removed_primitives = {{1, 3}, {0, 3}, {1, 3}}}, "primitive 3 of body 1 is removed twice"},
      {"unknown vertex removed",
       {.removed_vertices = {{0, vertices}}},
       "vertex 452 of body 0 does not exist"},
      {"vertex removed before", {.removed_vertices = {{0, 13}}}, "vertex 13 of body 0 was removed before"},
      {"vertex twice", {.removed_vertices = {{0, 14}, {0, 14}}}, "vertex 14 of body 0 is removed twice"},
      {"used vertex", {.removed_vertices = {{0, 0}}}, "vertex 0 of body 0 is still used by 1 corners"},
      {"body of what is removed", {.removed_primitives = {{3, 0}}}, "body 3 of 2"},
  };
  const std::uint64_t before = hash(changing.scene());
  for (const Refused& one : cases) {
    Change change = one.change;
    // Something right before this one, and right next to it, that must not happen.
    change.removed_primitives.insert(change.removed_primitives.begin(), {1, 7});
    change.vertices.insert(change.vertices.begin(), Change::NewVertex{1});
    try {
      changing.apply(change, playback);
      ADD_FAILURE() << one.name << " was not refused";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(one.says), std::string::npos)
          << one.name << ": " << error.what();
    }
    EXPECT_EQ(hash(changing.scene()), before) << one.name;
    EXPECT_EQ(changing.scene().bodies[1].plans.vertex_count(), playback.plans(1).vertex_count());
    EXPECT_EQ(playback.plans(1).vertex_count(), test.scene.bodies[1].plans.vertex_count());
  }
  const PlanChange<double> late{.body = 0, .vertex = 12};
  EXPECT_THROW(changing.check_plans({&late, 1}), std::invalid_argument);
  // A vertex may be removed together with its primitive.
  Change last{.removed_primitives = {{0, 0}}, .removed_vertices = {{0, 0}, {0, 1}, {0, 2}}};
  changing.apply(last, playback);
  EXPECT_EQ(changing.scene().bodies[0].primitives.live_count(), 148u);
}

// The caller's array has no place for more vertices; primitives may come and go.
TEST(GeometryChange, BodiesWhosePositionsAreHandedInGetNoVertices) {
  Scene<float> scene = synthetic_scene<float>("static_obstacle").scene;
  const std::uint32_t count = scene.bodies[0].plans.vertex_count();
  const float* const at = scene.bodies[0].plans.keyframe(0);
  std::vector<float> positions(at, at + std::size_t(3) * count);
  scene.bodies[0].plans = FlightPlans<float>::handed_in(count, positions);
  positions.push_back(0);
  Playback<float> playback(scene);
  playback.hand_in(0, positions.data());
  ChangingScene<float> changing(scene);
  GeometryChange<float> added;
  added.vertices.resize(1);
  try {
    changing.apply(added, playback);
    ADD_FAILURE() << "was not refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("body 0, whose positions are handed in"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(changing.scene().bodies[0].plans.vertex_count(), count);
  EXPECT_EQ(playback.plans(0).vertex_count(), count);
  GeometryChange<float> changed;
  changed.removed_primitives.push_back({0, 0});
  changed.primitives.push_back({0, {0, 1, 2}});
  changing.apply(changed, playback);
  EXPECT_EQ(changing.scene().bodies[0].primitives.live_count(), scene.bodies[0].primitives.live_count());
}

TEST(GeometryChange, NewVerticesFollowTheirPlans) {
  const auto test = synthetic_scene<float>("static_obstacle");
  Playback<float> playback(test.scene);
  for (std::uint32_t body = 0; body < 2; ++body) {
    const std::uint32_t old = playback.plans(body).vertex_count();
    playback.seek(1.25);
    playback.evaluate_all();
    PlanChange<float> plan;
    plan.times = {2.25};
    plan.positions = {1, 2, 3};
    plan.velocity[2] = 4;
    const float start[3] = {0, -0.0f, 1};
    playback.add_vertex(body, plan, start);
    EXPECT_FALSE(std::signbit(playback.position(body, old)[1]));
    EXPECT_TRUE(playback.all_current(body));
    EXPECT_EQ(playback.plans(body).keyframed_count(), old);
    for (const double t : {1.25, 1.75, 2.25, 4.25}) {
      playback.seek(t);
      // Mixed lists and all at once give the same positions.
      const std::vector<std::uint32_t> some{old, 3, 5, old, 7};
      std::vector<float> listed(3 * std::size_t(old + 1), -1), all(3 * std::size_t(old + 1), -2);
      playback.plans(body).evaluate(t, some, listed.data());
      playback.plans(body).evaluate(t, all.data());
      for (const std::uint32_t v : some)
        for (std::size_t axis = 0; axis < 3; ++axis)
          EXPECT_EQ(listed[3 * v + axis], all[3 * v + axis]) << "t = " << t << ", vertex " << v;
      const float z = t <= 1.25 ? 1.f : t <= 1.75 ? 2.f : t <= 2.25 ? 3.f : 11.f;
      EXPECT_EQ(playback.position(body, old)[2], z) << t;
      EXPECT_GE(playback.plans(body).speed_bound(t), t < 2.25 ? 3.0 : 4.0);
    }
  }
}

TEST(GeometryChange, TheOracleKnowsWhatHoldsAfterEach) {
  for (const char* name : {"geometry_changes", "geometry_changes_ties", "self_geometry_changes"}) {
    const auto test = synthetic_scene<float>(name, 3);
    const auto frames = test.frames.empty() ? frame_times(test.scene, 3) : test.frames;
    Oracle<float> oracle(test.scene, {}, hash(test.script));
    std::size_t made = 0, different = 0;
    for (int round = 0; round < 2; ++round) {  // in the second round all answers are remembered
      Playback<float> playback(test.scene);
      ChangingScene<float> changing(test.scene);
      ScriptCursor<float> cursor(&test.script);
      std::uint32_t changes = 0;
      for (const double t : frames) {
        playback.seek(t);
        const auto before = brute_force_pairs(changing.scene(), playback);
        EXPECT_EQ(oracle.pairs(playback, changing.scene(), changes), before) << name << " at " << t;
        const auto* step = cursor.at(t);
        if (step == nullptr) continue;
        if (!step->changes.empty()) playback.change_plans(t, step->changes);
        if (step->geometry.empty()) continue;
        changing.apply(step->geometry, playback);
        const auto after = brute_force_pairs(changing.scene(), playback);
        EXPECT_EQ(oracle.pairs(playback, changing.scene(), ++changes), after) << name << " at " << t;
        ++made;
        different += before != after;
      }
    }
    EXPECT_GT(made, 4u) << name;
    EXPECT_GT(different, 0u) << name << ": no change begins or ends a pair at once";
  }
}

// ---- Locality (Z&W s.4: certificates are repaired locally)
// -------------------------------------------------

/// A wavy sheet of 2 side^2 triangles over two keyframes.
Scene<float> sheet(std::uint32_t side) {
  Scene<float> scene;
  Body<float> body;
  std::vector<float> positions;
  Random random(side);
  for (int keyframe = 0; keyframe < 2; ++keyframe)
    for (std::uint32_t y = 0; y <= side; ++y)
      for (std::uint32_t x = 0; x <= side; ++x)
        for (const double c : {double(x), double(y), 0.5 * random.unit()})
          positions.push_back(float(c + 0.2 * random.unit()));
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t v = y * (side + 1) + x;
      const std::uint32_t lower[3] = {v, v + 1, v + side + 1}, upper[3] = {v + 1, v + side + 2, v + side + 1};
      body.primitives.add(lower);
      body.primitives.add(upper);
    }
  body.plans = FlightPlans<float>((side + 1) * (side + 1), {0, 1}, std::move(positions));
  scene.bodies.push_back(std::move(body));
  return scene;
}

struct Cost {
  double insertion = 0, removal = 0;  ///< certificates, mean
  std::uint64_t most = 0;
};

Cost repairs(std::uint32_t side) {
  const Scene<float> original = sheet(side);
  ChangingScene<float> changing(original);
  Playback<float> playback(original);
  const SceneView<float> view(changing.scene());
  playback.seek(0.5);
  Counters count;
  Topologies topologies = build_topologies(view, playback, {.width = 2, .leaf_size = 1});
  const std::uint64_t depth = *std::max_element(topologies[0].depths.begin(), topologies[0].depths.end());
  KineticForest<float, AvlQueue<float>> forest(view, ClipMotion<float>(playback), std::move(topologies),
                                               count);
  forest.reset(0.5);
  Random random(3);
  Cost cost;
  const int operations = 200;
  const auto made = [&](const GeometryChange<float>& change) {
    changing.apply(change, playback);
    count = {};
    forest.geometry_changed(playback.time(), view, ClipMotion<float>(playback), body_changes(view, change));
    const std::uint64_t certificates = count[Counter::certificates_made];
    cost.most = std::max(cost.most, certificates);
    // One side of a node needs one certificate, that of a triangle's leaf two; two leaves are touched, and
    // fewer than `depth` + 2 nodes above them.
    EXPECT_LE(certificates, 6 * (2 * 2 + depth + 2)) << "2 x " << side << "^2 triangles";
    return double(certificates);
  };
  for (int i = 0; i < operations; ++i) {
    GeometryChange<float> insertion;
    const std::uint32_t first = view.vertex_count(0);
    float at[3] = {float(side * 0.5 * (1 + random.unit())), float(side * 0.5 * (1 + random.unit())), 0};
    for (int corner = 0; corner < 3; ++corner) {
      GeometryChange<float>::NewVertex vertex;
      for (int axis = 0; axis < 3; ++axis) vertex.position[axis] = at[axis] + float(random.unit());
      for (float& v : vertex.plan.velocity) v = float(random.unit());
      insertion.vertices.push_back(vertex);
    }
    insertion.primitives.push_back({0, {first, first + 1, first + 2}});
    cost.insertion += made(insertion) / operations;
    GeometryChange<float> removal;
    std::uint32_t id = 0;
    do id = random.below(view.primitives(0).count());
    while (!view.primitives(0).alive(id));
    removal.removed_primitives.push_back({0, id});
    cost.removal += made(removal) / operations;
  }
  return cost;
}

TEST(GeometryChange, KineticTreeRepairsLocally) {
  Cost smallest, largest;
  for (const std::uint32_t side : {8u, 16u, 32u, 64u, 96u}) {
    const Cost cost = repairs(side);
    std::printf("%u triangles: certificates per insertion %.1f, per removal %.1f, most %llu\n",
                2 * side * side, cost.insertion, cost.removal, (unsigned long long)cost.most);
    if (side == 8) smallest = cost;
    largest = cost;
  }
  // With 144 times as many triangles.
  EXPECT_LT(largest.insertion, 2 * smallest.insertion);
  EXPECT_LT(largest.removal, 2 * smallest.removal);
}

// ---- Queues
// ------------------------------------------------------------------------------------------------

/// Returns the number of comparisons.
template <class Queue>
std::uint64_t expect_growth_keeps_order(std::string_view kind = {}) {
  const auto test = synthetic_scene<double>("soups");
  Playback<double> playback(test.scene);
  EventClock<double> clock({&playback.plans(0), &playback.plans(1)});
  clock.start();
  Queue queue(clock, 10);
  // Like the structures: a choice must not forget this.
  const std::vector<double> cuts{0, 0.25, 0.5, 0.75, 1};
  if constexpr (requires { queue.split_at(cuts); }) queue.split_at(cuts);
  if constexpr (requires { queue.choose(kind); }) queue.choose(kind);
  Random random(4);
  std::map<std::uint32_t, double> expected;  // time by slot
  std::uint32_t slots = 10;
  double next_time = 0;
  for (std::uint32_t round = 0; round < 30; ++round) {
    for (int i = 0; i < 20; ++i) {
      Event event;
      event.slot = random.below(slots);
      // Different times, in random order.
      event.hint = std::fmod(next_time += 617, 100'003) / 100'003;
      event.begin = 0;
      event.end = 1;
      queue.schedule(event);
      expected[event.slot] = event.hint;
      const std::uint32_t other = random.below(slots);
      EXPECT_EQ(queue.cancel(other), expected.erase(other) == 1);
    }
    EXPECT_EQ(queue.slots(), slots);
    slots += round % 7 + 1;
    queue.grow(slots);
  }
  std::vector<std::pair<double, std::uint32_t>> order, popped;
  for (const auto& [slot, time] : expected) order.emplace_back(time, slot);
  std::sort(order.begin(), order.end());
  while (!queue.empty()) {
    popped.emplace_back(queue.top().hint, queue.top().slot);
    queue.pop();
  }
  EXPECT_EQ(popped, order);
  EXPECT_GT(order.size(), 20u);
  return queue.steps();
}
TEST(GeometryChange, QueuesGrow) {
  const std::map<std::string, std::uint64_t> steps{
      {SegmentHeapQueue<double>::name, expect_growth_keeps_order<SegmentHeapQueue<double>>()},
      {AvlQueue<double>::name, expect_growth_keeps_order<AvlQueue<double>>()},
      {BinaryHeapQueue<double>::name, expect_growth_keeps_order<BinaryHeapQueue<double>>()}};
  EXPECT_EQ(steps.size(), AnyQueue<double>::names().size());
  // A queue whose kind was chosen makes as many comparisons as that kind, and all kinds differ.
  std::set<std::uint64_t> different;
  for (const auto& [kind, compared] : steps) {
    EXPECT_EQ(expect_growth_keeps_order<AnyQueue<double>>(kind), compared) << kind;
    different.insert(compared);
  }
  EXPECT_EQ(different.size(), steps.size());
}

}  // namespace
}  // namespace kbvh::test::geometry_change_test
