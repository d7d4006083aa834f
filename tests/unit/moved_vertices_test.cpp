// The vertices that moved since the last frame: the lists that plans give are exactly those whose positions
// change, and the refit of what moved computes the boxes of a whole refit, in exactly the nodes above them.

#include "core/scene/moved_vertices.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/contract/takes_moved_vertices.hpp"
#include "core/judge/audit.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/plan_changes.hpp"
#include "tests/support/random.hpp"

namespace kbvh::test::moved_vertices_test {
namespace {

using Vertices = std::vector<std::uint32_t>;

/// A body of single vertices of which about a share moves by whole units in each of some segments.
template <class S>
Body<S> restless(Random& random, std::uint32_t vertices, std::uint32_t keyframes, double share) {
  std::vector<double> times;
  std::vector<S> positions;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(k);
    for (std::uint32_t v = 0; v < vertices; ++v) {
      const bool moves = k > 0 && random.below(1000) < 1000 * share;
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const S before = k == 0 ? S(random.below(50)) : positions[positions.size() - 3 * vertices];
        positions.push_back(before + (moves && axis == v % 3 ? S(1 + random.below(4)) : S(0)));
      }
    }
  }
  Body<S> body;
  body.primitives.kind = PrimitiveKind::points;
  for (std::uint32_t v = 0; v < vertices; ++v) body.primitives.add(Vertices{v});
  body.plans = FlightPlans<S>(vertices, std::move(times), std::move(positions));
  return body;
}

/// The vertices whose positions change between two times, sampled at sixteenths of a second.
template <class S>
Vertices changed(const FlightPlans<S>& plans, double from, double to) {
  std::vector<S> first(3 * plans.vertex_count() + 1), now(first.size());
  std::set<std::uint32_t> found;
  plans.evaluate(from, first.data());
  for (double t = from; t <= to; t += 0.0625) {
    plans.evaluate(t, now.data());
    for (std::uint32_t v = 0; v < plans.vertex_count(); ++v)
      if (!std::equal(now.begin() + 3 * v, now.begin() + 3 * v + 3, first.begin() + 3 * v)) found.insert(v);
  }
  return {found.begin(), found.end()};
}

template <class S>
void expect_the_changed_ones(double share, std::size_t& listed, std::size_t& unlisted) {
  Random random(7);
  for (int round = 0; round < 30; ++round) {
    Scene<S> scene;
    scene.bodies.push_back(restless<S>(random, 300, 5, share));
    Playback<S> playback(scene);
    MovedVertices<S> moved{SampledMotion<S>(playback)};
    double from = -0.5;
    playback.seek(from);
    for (int frame = 0; frame < 24; ++frame) {
      if (round % 2 == 1 && frame % 3 == 1) {
        // Some vertices get plans of their own: at rest, on a ray, and resting between two knots.
        std::vector<PlanChange<S>> changes;
        for (int i = 0; i < 4; ++i) {
          PlanChange<S> change;
          change.vertex = random.below(300);
          change.velocity[i % 3] = S(random.below(2));
          const S* const at = playback.position(0, change.vertex);
          for (double t : {0.5, 1.0})
            if (i == 3) {
              change.times.push_back(from + t);
              for (int axis = 0; axis < 3; ++axis) change.positions.push_back(at[axis] + S(1));
            }
          changes.push_back(std::move(change));
        }
        playback.change_plans(from, changes);
        moved.forget(0);
      }
      const double to = from + 0.125 * random.below(round % 3 == 0 ? 12 : 4);
      playback.seek(to);
      const Vertices expected = changed(playback.plans(0), from, to);
      const auto found = moved.since(0, from);
      if (expected.size() > 300 / 4) {
        EXPECT_FALSE(found) << "from " << from << " to " << to;
        ++unlisted;
      } else {
        ASSERT_TRUE(found) << "from " << from << " to " << to << ": " << expected.size();
        Vertices sorted(found->begin(), found->end());
        std::sort(sorted.begin(), sorted.end());
        EXPECT_EQ(sorted, expected) << "from " << from << " to " << to;
        listed += expected.size();
      }
      from = to;
    }
  }
}

TEST(MovedVertices, OfPlansAreThoseWhosePositionsChange) {
  std::size_t listed = 0, unlisted = 0;
  expect_the_changed_ones<float>(0.04, listed, unlisted);
  expect_the_changed_ones<double>(0.04, listed, unlisted);
  EXPECT_GT(listed, 2000u);
}

TEST(MovedVertices, MoreThanAQuarterAreNotListed) {
  std::size_t listed = 0, unlisted = 0;
  expect_the_changed_ones<float>(0.3, listed, unlisted);
  expect_the_changed_ones<double>(0.9, listed, unlisted);
  EXPECT_GT(unlisted, 200u);
}

TEST(MovedVertices, ACurveBetweenEqualPointsMoves) {
  std::vector<double> positions(2 * 3 * 40, 1.0);
  SegmentBends<double> bends;
  bends.bend.assign(3 * 40, 0);
  bends.twist.assign(3 * 40, 0);
  bends.bend[3 * 5 + 1] = 2;
  bends.twist[3 * 9] = 2;
  Scene<double> scene;
  Random random(1);
  scene.bodies.push_back(restless<double>(random, 40, 1, 0));
  scene.bodies[0].plans = FlightPlans<double>(40, {0, 1}, std::move(positions), {bends});
  Playback<double> playback(scene);
  MovedVertices<double> moved{SampledMotion<double>(playback)};
  playback.seek(0.5);
  const auto found = moved.since(0, 0);
  ASSERT_TRUE(found);
  EXPECT_EQ(Vertices(found->begin(), found->end()), (Vertices{5, 9}));
}

/// A grid of which the vertices (i, j) below `side` rise and fall, and one at rest.
template <class S>
Scene<S> patch(std::uint32_t n, std::uint32_t side) {
  Scene<S> scene;
  scene.bodies.push_back(
      placed_grid<S>(n, 4, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
        return axis == 0   ? double(i) / n
               : axis == 1 ? double(j) / n
                           : (i < side && j < side && k % 2 == 1 ? 0.1 + 0.01 * i : 0);
      }));
  scene.bodies.push_back(grid<S>(n, 0.3, 0.01, 1, [](std::uint32_t) { return 0.0; }));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

Vertices patch_vertices(std::uint32_t n, std::uint32_t side) {
  Vertices vertices;
  for (std::uint32_t j = 0; j < side; ++j)
    for (std::uint32_t i = 0; i < side; ++i) vertices.push_back(j * (n + 1) + i);
  return vertices;
}

/// The root, and the children of all nodes above leaves with one of the vertices.
std::uint64_t nodes_to_refit(const Topology& topology, const Primitives& primitives, const Vertices& moved) {
  std::vector<bool> marked(topology.size(), false);
  std::uint64_t count = 1;
  for (std::uint32_t leaf = 0; leaf < topology.size(); ++leaf) {
    const TopologyNode node = topology.nodes[leaf];
    if (!node.is_leaf()) continue;
    bool at_moved = false;
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
      for (const std::uint32_t v : primitives[topology.primitives[k]])
        at_moved = at_moved || std::find(moved.begin(), moved.end(), v) != moved.end();
    for (std::uint32_t n = topology.parents[leaf]; at_moved && !marked[n]; n = topology.parents[n]) {
      marked[n] = true;
      count += topology.nodes[n].count();
    }
  }
  return count;
}

template <class S>
std::uint64_t own_count(const Strategy<S>& strategy, std::string_view name) {
  std::uint64_t value = 0;
  const Counters counters = strategy.counters();
  for (const auto& named : counters.named)
    if (named.name == name) value = named.value;
  return value;
}

TEST(DirtyRefit, RefitsTheNodesAboveMovedVerticesOnly) {
  constexpr std::uint32_t n = 40, side = 4;
  const Scene<float> scene = patch<float>(n, side);
  const Vertices moved = patch_vertices(n, side);
  for (const auto& [width, leaf_size] : {std::pair(2u, 1u), {4u, 4u}, {8u, 16u}}) {
    const BuilderConfig builder{.method = BuildMethod::median, .width = width, .leaf_size = leaf_size};
    Play<float> dirty(scene, "dirty_refit", {}, builder), whole(scene, "bottom_up", {}, builder);
    const Topology topology = dirty.session.strategy().audit_view(0)->topology;
    const std::uint64_t nodes = nodes_to_refit(topology, scene.bodies[0].primitives, moved);
    ASSERT_LT(2 * nodes, topology.size()) << "the patch is no small part";
    for (int frame = 1; frame <= 16; ++frame) {
      const double t = 0.25 * frame;
      const Counters counts = dirty.frame(t);
      whole.frame(t);
      EXPECT_EQ(dirty.boxes(), whole.boxes()) << "width " << width << ", t = " << t;
      // The last keyframe is at 3; the body rests from then on.
      EXPECT_EQ(counts[Counter::nodes_visited], t <= 3 ? nodes : 0) << "width " << width << ", t = " << t;
      EXPECT_EQ(counts[Counter::values_written], 6 * counts[Counter::nodes_visited]);
      EXPECT_EQ(counts[Counter::vertex_reads] > 0, t <= 3);
      std::sort(dirty.pairs.begin(), dirty.pairs.end());
      std::sort(whole.pairs.begin(), whole.pairs.end());
      EXPECT_EQ(dirty.pairs, whole.pairs);
    }
    EXPECT_EQ(own_count(dirty.session.strategy(), "partial_refits"), 16u);
    EXPECT_EQ(own_count(dirty.session.strategy(), "vertices_moved"), 12 * moved.size());
  }
}

TEST(DirtyRefit, IsAWholeRefitWhereMostMoves) {
  const Scene<double> scene = patch<double>(40, 30);
  Play<double> dirty(scene, "dirty_refit", {}), whole(scene, "bottom_up", {});
  for (int frame = 1; frame <= 12; ++frame) {
    const Counters counts = dirty.frame(0.25 * frame), expected = whole.frame(0.25 * frame);
    EXPECT_EQ(dirty.boxes(), whole.boxes());
    EXPECT_EQ(counts[Counter::nodes_visited], expected[Counter::nodes_visited]);
    EXPECT_EQ(counts[Counter::vertex_reads], expected[Counter::vertex_reads]);
  }
  EXPECT_EQ(own_count(dirty.session.strategy(), "partial_refits"), 0u);
}

TEST(DirtyRefit, FollowsPlansThatChange) {
  constexpr std::uint32_t n = 40;
  const Scene<float> scene = patch<float>(n, 4);
  Play<float> dirty(scene, "dirty_refit", {}), whole(scene, "bottom_up", {});
  const Topology topology = dirty.session.strategy().audit_view(1)->topology;
  const auto both = [&](double t) {
    const Counters counts = dirty.frame(t);
    whole.frame(t);
    EXPECT_EQ(dirty.boxes(), whole.boxes()) << "t = " << t;
    return counts[Counter::nodes_visited];
  };
  const auto change = [&](std::uint32_t vertex, float velocity) {
    const std::vector<PlanChange<float>> changes{flies<float>(1, vertex, 0, 0, velocity)};
    dirty.session.change_plans(changes, dirty.times);
    whole.session.change_plans(changes, whole.times);
  };
  EXPECT_EQ(both(4), nodes_to_refit(dirty.session.strategy().audit_view(0)->topology,
                                    scene.bodies[0].primitives, patch_vertices(n, 4)));
  EXPECT_EQ(both(4.5), 0u);
  change(77, 0.5F);
  const std::uint64_t one = nodes_to_refit(topology, scene.bodies[1].primitives, {77});
  EXPECT_EQ(both(5), one);
  EXPECT_EQ(both(5.5), one);
  change(1200, -0.5F);
  EXPECT_EQ(both(6), nodes_to_refit(topology, scene.bodies[1].primitives, {77, 1200}));
  change(77, 0);
  EXPECT_EQ(both(6.5), nodes_to_refit(topology, scene.bodies[1].primitives, {1200}));
  change(1200, 0);
  EXPECT_EQ(both(7), 0u);
  // A reset restores the plans of the scene.
  dirty.reset(0);
  whole.reset(0);
  for (const double t : {0.5, 1.5, 4.0, 5.0}) both(t);
}

TEST(DirtyRefit, FollowsGeometryThatChanges) {
  const Scene<double> scene = patch<double>(40, 4);
  Play<double> dirty(scene, "dirty_refit", {}), whole(scene, "bottom_up", {});
  const std::uint32_t old = scene.bodies[1].plans.vertex_count();
  GeometryChange<double> change;
  for (int i = 0; i < 3; ++i) {
    typename GeometryChange<double>::NewVertex vertex{.body = 1};
    vertex.position[0] = 0.4 + 0.1 * (i % 2);
    vertex.position[1] = 0.1 * i;
    vertex.plan.velocity[2] = 0.25;
    change.vertices.push_back(vertex);
  }
  change.primitives.push_back({1, {old, old + 1, old + 2}});
  change.removed_primitives = {{1, 17}, {0, 4}};
  for (Play<double>* const play : {&dirty, &whole}) {
    play->frame(0.5);
    play->session.change_geometry(change, play->times);
    play->last = play->session.strategy().counters();
  }
  for (const double t : {0.75, 1.0, 1.5, 2.75, 3.5, 4.0}) {
    const Counters counts = dirty.frame(t), expected = whole.frame(t);
    EXPECT_EQ(dirty.boxes(), whole.boxes()) << "t = " << t;
    EXPECT_LT(2 * counts[Counter::nodes_visited], expected[Counter::nodes_visited]) << "t = " << t;
  }
}

/// Two sessions with positions handed in, one of which is told what moved.
struct HandedIn {
  explicit HandedIn(std::uint32_t n) : scene(patch<float>(n, 4)) {
    Body<float>& body = scene.bodies[0];
    const std::uint32_t count = body.plans.vertex_count();
    std::vector<float> start(body.plans.keyframe(0), body.plans.keyframe(0) + std::size_t(3) * count);
    body.plans = FlightPlans<float>::handed_in(count, start);
    start.push_back(0);
    for (auto& array : arrays) array = start;
    session.emplace(scene, Contestant{&find_strategy("dirty_refit"), {}, {.width = 8, .leaf_size = 16}});
    session->hand_in(0, arrays[0].data());
    session->reset(0);
  }
  /// Moves vertices by `z`; tells what moved unless `told` is null. Returns the nodes that were visited.
  std::uint64_t frame(const Vertices& moved, float z, const Vertices* told) {
    std::vector<float>& next = arrays[(frames + 1) % 2];
    next = arrays[frames % 2];
    for (const std::uint32_t v : moved) next[3 * v + 2] += z;
    ++frames;
    const std::uint64_t before = session->strategy().counters()[Counter::nodes_visited];
    if (told != nullptr) {
      EXPECT_TRUE(tell_moved<float>(session->strategy(), 0, *told));
    }
    session->hand_in(0, next.data());
    session->advance(0.1 * frames, times);
    return session->strategy().counters()[Counter::nodes_visited] - before;
  }
  Audit audited() {
    return audit<float>(*session->strategy().audit_view(0), scene.bodies[0].primitives,
                        session->playback().positions(0));
  }
  Scene<float> scene;
  std::vector<float> arrays[2];
  std::optional<Session<float>> session;
  PhaseTimes times;
  std::size_t frames = 0;
};

TEST(DirtyRefit, TakesTheCallersListForOneFrame) {
  constexpr std::uint32_t n = 40;
  HandedIn play(n);
  const Topology topology = play.session->strategy().audit_view(0)->topology;
  const Vertices moved{3, 500, 501, 1100, 3}, none;
  const std::uint64_t nodes = nodes_to_refit(topology, play.scene.bodies[0].primitives, moved);
  ASSERT_LT(2 * nodes, topology.size());
  const auto expect = [&](std::uint64_t visited, std::uint64_t expected) {
    EXPECT_EQ(visited, expected) << "frame " << play.frames;
    EXPECT_EQ(play.audited().protrusion, 0) << "frame " << play.frames;
    EXPECT_EQ(play.audited().not_tight, 0u) << "frame " << play.frames;
  };
  expect(play.frame(moved, 0.3F, &moved), nodes);
  expect(play.frame(moved, 0.3F, nullptr), topology.size());
  expect(play.frame(moved, -0.7F, &moved), nodes);
  expect(play.frame(none, 0, &none), 0);
  // A list that says too much costs, but is right.
  const Vertices more{3, 500, 501, 1100, 7, 640};
  expect(play.frame(moved, 0.1F, &more), nodes_to_refit(topology, play.scene.bodies[0].primitives, more));
  // A list ends with a reset, too.
  EXPECT_TRUE(tell_moved<float>(play.session->strategy(), 0, none));
  play.session->reset(0);
  expect(play.frame(moved, 0.5F, nullptr), topology.size());
}

TEST(DirtyRefit, AListThatLacksAVertexIsSeen) {
  HandedIn play(40);
  const Vertices moved{3, 840, 1100}, told{3, 1100};
  play.frame(moved, 0.3F, &moved);
  EXPECT_EQ(play.audited().protrusion, 0);
  play.frame(moved, 0.3F, &told);
  EXPECT_NEAR(play.audited().protrusion, 0.3, 1e-6);
  // The next whole refit mends it.
  play.frame({}, 0, nullptr);
  EXPECT_EQ(play.audited().protrusion, 0);
}

TEST(DirtyRefit, RefusesVerticesThatDoNotExist) {
  HandedIn play(10);
  Strategy<float>& strategy = play.session->strategy();
  const auto complaint = [&](std::uint32_t body, const Vertices& vertices) -> std::string {
    try {
      tell_moved<float>(strategy, body, vertices);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(complaint(0, {3, 121}), "vertex 121 moved, but body 0 has 121 vertices");
  EXPECT_EQ(complaint(2, {}), "moved vertices of body 2 of 2");
  EXPECT_EQ(complaint(0, {3, 120}), "");
  Session<float> other(play.scene, {&find_strategy("bottom_up"), {}, {.width = 8, .leaf_size = 16}});
  EXPECT_FALSE(tell_moved<float>(other.strategy(), 0, {}));
}

}  // namespace
}  // namespace kbvh::test::moved_vertices_test
