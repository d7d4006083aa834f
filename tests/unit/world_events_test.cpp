// The façade's view of event-driven strategies, and its descriptions of strategies.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <string>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "core/facade/world.hpp"
#include "core/judge/session.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/world_of.hpp"

namespace kbvh::test::world_events_test {
namespace {

/// A strip of triangles whose vertices cross each other on every axis, and a strip in its way.
struct Strips {
  World world{Precision::float64};
  static constexpr std::uint32_t vertices = 24;

  explicit Strips(const std::string& strategy, const std::map<std::string, std::string>& params = {}) {
    std::vector<std::uint32_t> indices;
    for (std::uint32_t i = 0; i + 2 < vertices; ++i) indices.insert(indices.end(), {i, i + 1, i + 2});
    std::vector<double> moving, rest;
    for (const double t : {0.0, 1.0, 2.0})
      for (std::uint32_t i = 0; i < vertices; ++i) {
        const double fast = double((7 * i) % 11) - 5;
        moving.insert(moving.end(), {i + t * fast, (i % 2) + 0.3 * t * double((5 * i) % 7), t * fast * 0.2});
        if (t == 0) rest.insert(rest.end(), {2.5 * i, double(i % 3) - 1, 0.25 * (i % 5)});
      }
    world.add_body("moving", {indices}, std::vector<double>{0, 1, 2}, std::span<const double>(moving));
    world.add_body("rest", {indices}, std::vector<double>{0}, std::span<const double>(rest));
    world.start(strategy, params, 0, {{"leaf_size", "1"}});
  }
};

/// Expects that every box is that of the realisers; sides without one are the parent's.
void expect_boxes_of_realisers(World& world, std::uint32_t body) {
  WorldHierarchy tree;
  std::vector<std::uint32_t> realisers;
  std::vector<double> positions;
  ASSERT_TRUE(world.hierarchy(body, tree));
  ASSERT_TRUE(world.realisers(body, realisers));
  world.positions(body, positions);
  ASSERT_EQ(realisers.size(), 6 * tree.nodes.size());
  for (std::size_t i = 0; i < tree.nodes.size(); ++i)
    for (std::size_t side = 0; side < 6; ++side) {
      const WorldNode &node = tree.nodes[i], &parent = tree.nodes[node.parent];
      const std::uint32_t vertex = realisers[6 * i + side];
      const std::size_t axis = side / 2;
      const double bound = side % 2 == 0 ? node.lower[axis] : node.upper[axis];
      const double expected = vertex != world_no_vertex ? positions[3 * vertex + axis]
                              : side % 2 == 0           ? parent.lower[axis]
                                                        : parent.upper[axis];
      ASSERT_EQ(bound, expected) << "node " << i << ", side " << side;
    }
}

TEST(WorldEvents, RealisersGiveTheBoxesBeforeAndAfterEdits) {
  std::size_t seen = 0;
  for (const WorldStrategy& strategy : World::strategy_descriptions()) {
    if (!strategy.events || !strategy.has_float64) continue;
    SCOPED_TRACE(strategy.id);
    // Queries of the BoxTree read tighter boxes than those that nodes inherit, unless configured otherwise.
    const bool inherits = strategy.id == "kinetic_boxtree";
    Strips strips(strategy.id, inherits ? std::map<std::string, std::string>{{"leaf_boxes", "inherited"}}
                                        : std::map<std::string, std::string>{});
    World& world = strips.world;
    std::vector<WorldPair> pairs;
    for (const double t : {0.0, 0.4, 1.0}) {
      world.advance(t);
      world.pairs(pairs);
      for (const std::uint32_t body : {0U, 1U}) expect_boxes_of_realisers(world, body);
    }
    ++seen;
    if (!strategy.geometry_changes) continue;
    WorldEdit edit;
    for (std::uint32_t i = 0; i < 12; ++i) edit.removed_primitives.push_back({0, i});
    world.change_geometry(edit);
    edit = {};
    for (std::uint32_t i = 0; i < 9; ++i)
      edit.vertices.push_back({0, {-double(i), 0.5 * i, double(i % 2)}, {double(i), -1, 0.5}});
    for (std::uint32_t i = 0; i < 9; i += 3)
      edit.primitives.push_back(
          {0, {Strips::vertices + i, Strips::vertices + i + 1, Strips::vertices + i + 2}});
    world.change_geometry(edit);
    WorldStep step;
    WorldHierarchy tree;
    for (const double t : {1.2, 1.9}) {
      while (world.step_event(t, step)) {
        ASSERT_TRUE(world.hierarchy(step.event.body, tree));
        const auto names = [&](const WorldNode& node) { return node.event_node == step.event.node; };
        if (step.event.kind == WorldEvent::Kind::bound) {
          ASSERT_EQ(std::count_if(tree.nodes.begin(), tree.nodes.end(), names), 1);
        }
      }
      world.advance(t);
      world.pairs(pairs);
      for (const std::uint32_t body : {0U, 1U}) expect_boxes_of_realisers(world, body);
    }
  }
  EXPECT_GE(seen, 4u);
  std::vector<std::uint32_t> realisers{1};
  EXPECT_FALSE(Strips("bottom_up").world.realisers(0, realisers));
  EXPECT_TRUE(realisers.empty());
}

TEST(WorldEvents, PositionsAtAnotherTimeAreThoseOfThatFrame) {
  Strips ahead("bottom_up"), behind("bottom_up");
  std::vector<double> expected, found;
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.5}) {
    ahead.world.advance(t);
    ahead.world.positions(0, expected);
    behind.world.positions(0, t, found);
    EXPECT_EQ(found, expected) << t;
    EXPECT_EQ(behind.world.time(), 0);
  }
  EXPECT_THROW(behind.world.positions(2, 0.5, found), std::invalid_argument);
  EXPECT_THROW(behind.world.positions(0, std::numeric_limits<double>::infinity(), found),
               std::invalid_argument);
  World handed_in(Precision::float64);
  handed_in.add_body("unknown", {std::vector<std::uint32_t>{0, 1, 2}}, std::vector<double>(9));
  handed_in.add_body("other", {std::vector<std::uint32_t>{0, 1, 2}}, std::vector<double>(9));
  handed_in.start("bottom_up");
  EXPECT_THROW(handed_in.positions(0, 0.5, found), std::logic_error);
}

/// Bodies on curves: positions are those of the flight plans, and pairs those of a session.
template <class S>
void expect_curves_to_be_played(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  const std::vector<double> frames = frame_times(scene, 4);
  for (const char* const id : {"bottom_up", "kinetic_aabb", "kinetic_separation_list"}) {
    const StrategyEntry& entry = find_strategy(id);
    Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
    World world = world_of(scene);
    world.start(id, {}, frames[0]);
    session.reset(frames[0]);
    PairBuffer expected;
    PhaseTimes times;
    std::vector<WorldPair> pairs;
    std::vector<double> positions;
    for (const double t : frames) {
      session.advance(t, times);
      world.advance(t);
      session.query(expected, times);
      world.pairs(pairs);
      EXPECT_EQ(pairs.size(), expected.size()) << id << " on " << name << ", t = " << t;
      for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
        std::vector<S> of_plans(std::size_t(3) * scene.bodies[body].plans.vertex_count());
        scene.bodies[body].plans.evaluate(t, of_plans.data());
        world.positions(body, positions);
        EXPECT_TRUE(std::equal(of_plans.begin(), of_plans.end(), positions.begin(), positions.end()))
            << id << " on " << name << ", t = " << t;
      }
    }
  }
}

TEST(WorldEvents, VerticesMayMoveOnCurves) {
  for (const char* const name : {"curved_gravity", "curved_mixed"}) {
    expect_curves_to_be_played<float>(name);
    expect_curves_to_be_played<double>(name);
  }
  World world(Precision::float64);
  const std::vector<std::uint32_t> triangle{0, 1, 2};
  const std::vector<double> rest(9), moving(18), times{0, 1}, bends(9, 1), too_many(18, 1);
  const auto add = [&](const WorldCurves& curves) {
    return world.add_body("arc", {triangle}, times, std::span<const double>(moving), curves);
  };
  EXPECT_THROW(add({too_many, {}}), std::invalid_argument);
  EXPECT_THROW(add({{}, std::span(bends).first(8)}), std::invalid_argument);
  EXPECT_THROW(
      world.add_body("still", {triangle}, std::vector<double>{0}, std::span<const double>(rest), {bends, {}}),
      std::invalid_argument);
  EXPECT_EQ(add({bends, {}}), 0u);
  world.add_body("still", {triangle}, std::vector<double>{0}, std::span<const double>(rest));
  EXPECT_THROW(world.start("auto"), ConfigError);  // foresees lines only
  world.start("bottom_up");
  world.advance(0.5);
  std::vector<double> positions;
  world.positions(0, positions);
  EXPECT_EQ(positions, std::vector<double>(9, 0.25));
}

TEST(WorldEvents, QuestionsDoNotCount) {
  for (const WorldStrategy& strategy : World::strategy_descriptions()) {
    if (!strategy.has_float64) continue;
    SCOPED_TRACE(strategy.id);
    Strips asked(strategy.id), silent(strategy.id);
    std::vector<WorldPair> pairs;
    std::vector<double> positions;
    WorldHierarchy tree;
    for (const double t : {0.0, 0.7, 1.4}) {
      for (World* world : {&asked.world, &silent.world}) {
        world->advance(t);
        world->pairs(pairs);
      }
      for (const std::uint32_t body : {0U, 1U}) {
        asked.world.positions(body, positions);
        asked.world.hierarchy(body, tree);
      }
      const auto found = asked.world.counters(), expected = silent.world.counters();
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t i = 0; i < found.size(); ++i)
        if (found[i].name != "bytes") {
          EXPECT_EQ(found[i].value, expected[i].value) << found[i].name << ", t = " << t;
        }
    }
  }
}

TEST(WorldEvents, WatchedPairsAreThoseOfASeparationList) {
  Strips with("kinetic_separation_list"), without("kinetic_aabb");
  std::vector<WorldWatch> watched{{}};
  without.world.watched_pairs(watched);
  EXPECT_TRUE(watched.empty());
  for (const double t : {0.0, 0.7, 1.4}) {
    with.world.advance(t);
    std::vector<WorldPair> pairs;
    with.world.pairs(pairs);
    with.world.watched_pairs(watched);
    ASSERT_FALSE(watched.empty());
    EXPECT_TRUE(std::is_sorted(watched.begin(), watched.end()));
    WorldHierarchy trees[2];
    for (const std::uint32_t body : {0U, 1U}) ASSERT_TRUE(with.world.hierarchy(body, trees[body]));
    std::size_t apart = 0;
    for (const WorldWatch& pair : watched) {
      const WorldNode &a = trees[pair.body].nodes.at(pair.node),
                      &b = trees[pair.other_body].nodes.at(pair.other_node);
      bool overlap = true;
      for (int axis = 0; axis < 3; ++axis)
        overlap &= a.lower[axis] <= b.upper[axis] && b.lower[axis] <= a.upper[axis];
      EXPECT_TRUE(pair.overlapping || !overlap) << "boxes that overlap count as apart, at t = " << t;
      EXPECT_EQ(pair.listed, !pair.overlapping || (a.leaf && b.leaf));
      apart += pair.overlapping ? 0 : 1;
    }
    EXPECT_GT(apart, 0u);
  }
}

TEST(WorldEvents, DescribesEveryStrategy) {
  const auto meanings = World::counter_meanings();
  ASSERT_EQ(meanings.size(), std::size_t(Counter::count));
  EXPECT_EQ(meanings[0].second, meaning(Counter(0)));
  const std::vector<WorldStrategy> all = World::strategy_descriptions();
  ASSERT_EQ(all.size(), World::strategies().size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const WorldStrategy& described = all[i];
    EXPECT_EQ(described.id, World::strategies()[i]);
    const Info& info = find_strategy(described.id).info;
    EXPECT_EQ(described.title, info.title);
    EXPECT_EQ(described.about, about(described.id));
    EXPECT_EQ(described.events, info.can.events);
    EXPECT_EQ(described.geometry_changes, info.can.geometry_changes);
    EXPECT_EQ(described.foresight == "none", info.foresight == Foresight::none);
    ASSERT_EQ(described.parameters.size(), info.parameters.size());
    for (std::size_t p = 0; p < info.parameters.size(); ++p) {
      EXPECT_EQ(described.parameters[p].default_value, info.parameters[p].default_value);
      EXPECT_EQ(described.parameters[p].admissible, admissible(info.parameters[p]));
    }
  }
}

}  // namespace
}  // namespace kbvh::test::world_events_test
