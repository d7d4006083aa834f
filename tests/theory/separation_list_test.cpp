// The separation list between events (claim T13, Definition 2): equal to a traversal from scratch, with
// rational arithmetic, at instants between the events of a clip.
#include <gtest/gtest.h>

#include <cstdio>
#include <set>

#include "core/contract/registry.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/separation/kinetic_collision.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::separation_list_test {
namespace {

using theory::exact;
using theory::Rational;

template <class S>
Rational value_at(const Piece<S>& piece, const Rational& t) {
  const theory::ExactLine line = theory::exact_line(piece);
  return line.x0 + line.slope * (t - line.t0);
}

/// Returns a side of a box at t, widened as in the list: at the knots of its piece.
template <class S>
Piece<S> side_piece(const FlightPlans<S>& plans, std::uint32_t vertex, int axis, int widening, double t) {
  Piece<S> piece = plans.piece_after(vertex, axis, t);
  const auto widened = [&](S x) { return widening > 0 ? widened_up(x) : S(-widened_up(S(-x))); };
  if (widening != 0) {
    piece.x0 = widened(piece.x0);
    if (piece.kind == PieceKind::chord || piece.x1 != 0) piece.x1 = widened(piece.x1);
  }
  return piece;
}

/// Returns whether a is below b at t, in rationals unless doubles are clearly sufficient.
template <class S>
bool below(const Piece<S>& a, const Piece<S>& b, double t) {
  double difference = 0, scale = 0;
  for (const auto& [piece, sign] : {std::pair(a, -1), std::pair(b, 1)}) {
    const double x0 = double(piece.x0), x1 = double(piece.x1), elapsed = t - piece.t0;
    const double way =
        piece.kind == PieceKind::ray ? x1 * elapsed : (x1 - x0) * (elapsed / (piece.t1 - piece.t0));
    difference += sign * (x0 + way);
    scale += std::abs(x0) + std::abs(x1) + std::abs(way);
  }
  if (std::abs(difference) > 1e-9 * scale) return difference > 0;
  return value_at(a, exact(t)) < value_at(b, exact(t));
}

using ListEntry = std::tuple<std::uint32_t, std::uint32_t, bool>;  // nodes, overlapping leaves?

template <class S, class Collision>
class Auditor {
 public:
  Auditor(const Collision& collision, const SceneView<S>& scene) : collision_(collision), scene_(scene) {}

  /// Compares list and traversal at t, at which there is no event; returns the difference, or nothing.
  std::string compare(double t) {
    for (std::uint32_t i = 0; i < scene_.pairs().size(); ++i) {
      std::set<ListEntry> fresh, kept;
      const auto& body_pair = scene_.pairs()[i];
      if (!collision_.forest().tree(body_pair.first).topology().empty() &&
          !collision_.forest().tree(body_pair.second).topology().empty())
        traverse(body_pair, 0, 0, t, fresh);
      std::size_t overlapping = 0;
      for (const auto& pair : collision_.list().pairs())
        if (pair.used && pair.children == collision_.list().none && pair.bodies == i) {
          kept.insert({pair.a, pair.b, pair.overlapping});
          overlapping += pair.overlapping;
        }
      if (fresh != kept)
        return "t = " + std::to_string(t) + ": a traversal finds " + std::to_string(fresh.size()) +
               " entries, the list has " + std::to_string(kept.size()) + ", or others";
      if (overlapping != collision_.list().leaf_pairs(i).size())
        return "leaf pairs are not those of the list";
      for (const auto& leaf : collision_.list().leaf_pairs(i))
        if (kept.count({leaf.a, leaf.b, true}) == 0) return "a leaf pair that is not in the list";
      entries += kept.size();
    }
    ++audits;
    return {};
  }
  std::uint64_t audits = 0, entries = 0;

 private:
  void traverse(const BodyPair& bodies, std::uint32_t a, std::uint32_t b, double t,
                std::set<ListEntry>& list) const {
    const auto &tree_a = collision_.forest().tree(bodies.first),
               &tree_b = collision_.forest().tree(bodies.second);
    const TopologyNode na = tree_a.topology().nodes[a], nb = tree_b.topology().nodes[b];
    const bool meet = overlap(bodies, a, b, t);
    if (!meet || (na.is_leaf() && nb.is_leaf())) {
      list.insert({a, b, meet});
      return;
    }
    for (std::uint32_t i = na.is_leaf() ? a : na.first();
         i < (na.is_leaf() ? a + 1 : na.first() + na.count()); ++i)
      for (std::uint32_t j = nb.is_leaf() ? b : nb.first();
           j < (nb.is_leaf() ? b + 1 : nb.first() + nb.count()); ++j)
        traverse(bodies, i, j, t, list);
  }
  bool overlap(const BodyPair& bodies, std::uint32_t a, std::uint32_t b, double t) const {
    const auto& forest = collision_.forest();
    const auto &plans_a = forest.clock().plans(bodies.first), &plans_b = forest.clock().plans(bodies.second);
    const std::uint32_t* ra = forest.tree(bodies.first).realisers(a);
    const std::uint32_t* rb = forest.tree(bodies.second).realisers(b);
    for (int axis = 0; axis < 3; ++axis)
      if (below(side_piece(plans_a, ra[2 * axis + 1], axis, 1, t),
                side_piece(plans_b, rb[2 * axis], axis, 0, t), t) ||
          below(side_piece(plans_b, rb[2 * axis + 1], axis, 0, t),
                side_piece(plans_a, ra[2 * axis], axis, -1, t), t))
        return false;
    return true;
  }
  const Collision& collision_;
  SceneView<S> scene_;
};

constexpr std::string_view avl = AvlQueue<float>::name, segment_heap = SegmentHeapQueue<float>::name;

struct Kinds {
  std::uint64_t overlap = 0, parents = 0, leaves = 0, changes = 0, geometry = 0;
  bool operator==(const Kinds&) const = default;
};

/// Plays a scene event by event on queues of a kind (AnyEventQueue) and performs about `audits` audits.
template <class S>
Kinds play(const std::string& name, const BuilderConfig& builder, std::uint64_t audits,
           std::string_view queue, int look_ahead = OverlapClock<S>::usual_look_ahead) {
  using Collision = KineticCollision<S, AnyEventQueue>;
  const auto test = synthetic_scene<S>(name, 2);
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 2) : test.frames;
  Kinds kinds;
  std::uint64_t every = 1, compared = 0;
  bool wanted = false;
  // The first run counts the events; the second audits between the requested number of them.
  for (const bool auditing : {false, true}) {
    ChangingScene<S> changing(test.scene);
    const SceneView<S> view(changing.scene());
    Playback<S> playback(test.scene);
    playback.seek(frames.front());
    Counters count;
    Collision collision(view, ClipMotion<S>(playback), build_topologies(view, playback, builder), count,
                        look_ahead, queue);
    collision.reset(frames.front());
    count = {};
    Auditor<S, Collision> auditor(collision, view);
    auto step = test.script.steps.begin();
    std::uint64_t events = 0, geometry = 0;
    ListEdit edits;
    for (const double t : frames) {
      while (collision.due(t)) {
        const double after = collision.after_next();
        collision.handle_next();
        ++events;
        wanted = wanted || events % every == 0;
        if (!auditing || !wanted || collision.due(after)) continue;
        wanted = false;
        EXPECT_EQ(auditor.compare(after), "") << name;
      }
      const double after = std::nextafter(t, 1e300);
      if (auditing && !collision.due(after)) {
        EXPECT_EQ(auditor.compare(after), "") << name;
      }
      for (; step != test.script.steps.end() && step->time <= t; ++step) {
        playback.seek(t);
        playback.change_plans(t, step->changes);
        collision.plans_changed(t, step->changes);
        if (step->geometry.empty()) continue;
        changing.apply(step->geometry, playback);
        const ListEdit edit =
            collision.geometry_changed(t, view, ClipMotion<S>(playback), body_changes(view, step->geometry));
        edits.removed += edit.removed;
        edits.decided += edit.decided;
        ++geometry;
        wanted = true;  // and once more after the next event
        if (auditing && !collision.due(after)) {
          EXPECT_EQ(auditor.compare(after), "") << name << ", after a change of geometry";
        }
      }
    }
    every = std::max<std::uint64_t>(1, events / audits);
    compared = auditor.audits;
    const Counters& table = count;
    kinds = {table[Counter::overlap_events], table[Counter::parents_apart_events],
             table[Counter::leaves_apart_events], table[Counter::bound_change_events], geometry};
    if (auditing && geometry != 0)
      std::printf("%s: %llu changes of geometry: %llu pairs removed, %llu decided\n", name.c_str(),
                  (unsigned long long)geometry, (unsigned long long)edits.removed,
                  (unsigned long long)edits.decided);
    if (auditing)
      std::printf(
          "%s: %llu audits of %llu entries in all; events: overlap %llu, parents %llu, leaves %llu, "
          "changes %llu; list at most %llu\n",
          name.c_str(), (unsigned long long)compared, (unsigned long long)auditor.entries,
          (unsigned long long)kinds.overlap, (unsigned long long)kinds.parents,
          (unsigned long long)kinds.leaves, (unsigned long long)kinds.changes,
          (unsigned long long)table[Counter::list_peak]);
  }
  return kinds;
}

class SeparationLists : public testing::TestWithParam<std::string> {};

TEST_P(SeparationLists, EqualATraversalBetweenEvents) {
  const BuilderConfig binary{.width = 2, .leaf_size = 1};
  const Kinds kinds = play<float>(GetParam(), binary, 40, avl);
  play<double>(GetParam(), {.width = 4, .leaf_size = 3}, 20, BinaryHeapQueue<double>::name);
  EXPECT_EQ(kinds, play<float>(GetParam(), binary, 40, segment_heap));
  // A shorter look-ahead gives the same result.
  for (const int look_ahead : {1, 2}) EXPECT_EQ(kinds, play<float>(GetParam(), binary, 20, avl, look_ahead));
}
INSTANTIATE_TEST_SUITE_P(Scenes, SeparationLists, testing::ValuesIn(synthetic_scene_names()),
                         [](const auto& param_info) { return param_info.param; });

class SeparationListsOfChangingGeometry : public testing::TestWithParam<std::string> {};

// After every insertion and deletion, and between the events that follow.
TEST_P(SeparationListsOfChangingGeometry, EqualATraversal) {
  for (const std::uint32_t width : {2u, 4u})
    for (const std::uint32_t leaf_size : {1u, 3u}) {
      const BuilderConfig builder{.width = width, .leaf_size = leaf_size};
      EXPECT_GT(play<float>(GetParam(), builder, 40, avl).geometry, 0u);
      EXPECT_GT(play<double>(GetParam(), builder, 20, segment_heap).geometry, 0u);
    }
}
INSTANTIATE_TEST_SUITE_P(Scenes, SeparationListsOfChangingGeometry, testing::ValuesIn(geometry_scene_names()),
                         [](const auto& param_info) { return param_info.param; });

/// Two sheets of n x n quads, two triangles each, that move through each other: one level, one inclined.
Scene<float> crossing_sheets(std::uint32_t n) {
  Scene<float> scene;
  for (const int inclined : {0, 1}) {
    std::vector<float> positions;
    for (const float lift : {-0.2f, 0.2f})
      for (std::uint32_t i = 0; i <= n; ++i)
        for (std::uint32_t j = 0; j <= n; ++j) {
          const float x = float(i) / float(n) - 0.5f, y = float(j) / float(n) - 0.5f;
          positions.insert(positions.end(), {x, y, inclined != 0 ? 0.9f * x + 0.3f * y + lift : 0.0f});
        }
    Primitives primitives;
    for (std::uint32_t i = 0; i < n; ++i)
      for (std::uint32_t j = 0; j < n; ++j) {
        const std::uint32_t v = i * (n + 1) + j;
        primitives.add(std::vector<std::uint32_t>{v, v + 1, v + n + 1});
        primitives.add(std::vector<std::uint32_t>{v + 1, v + n + 2, v + n + 1});
      }
    scene.bodies.push_back({inclined != 0 ? "inclined" : "level", primitives,
                            FlightPlans<float>((n + 1) * (n + 1), {0.0, 1.0}, std::move(positions))});
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

struct Locality {
  double work, list;  ///< pairs per primitive inserted or deleted; pairs in the list
};

/// Removes the triangles of either sheet whose boxes meet the other sheet's, one at a time, and inserts them
/// again on their vertices.
Locality locality(std::uint32_t n) {
  using Collision = KineticCollision<float, AnyEventQueue>;
  const Scene<float> scene = crossing_sheets(n);
  ChangingScene<float> changing(scene);
  const SceneView<float> view(changing.scene());
  Playback<float> playback(scene);
  const double t = 0.53;  // when no two corners meet
  playback.seek(t);
  Counters count;
  Collision collision(view, ClipMotion<float>(playback),
                      build_topologies(view, playback, {.width = 2, .leaf_size = 1}), count,
                      OverlapClock<float>::usual_look_ahead, avl);
  collision.reset(t);
  Auditor<float, Collision> auditor(collision, view);
  Random random(n);
  ListEdit total;
  constexpr std::uint32_t rounds = 100;
  for (std::uint32_t i = 0; i < rounds; ++i) {
    const std::uint32_t body = i % 2;
    const auto leaves = collision.list().leaf_pairs(0);
    const auto& leaf = leaves[random.below(std::uint32_t(leaves.size()))];
    const Topology& topology = collision.forest().tree(body).topology();
    const std::uint32_t id = topology.primitives[topology.nodes[body == 0 ? leaf.a : leaf.b].first()];
    const auto vertices = view.primitives(body)[id];
    const std::vector<std::uint32_t> corners(vertices.begin(), vertices.end());
    for (const bool again : {false, true}) {
      GeometryChange<float> change;
      if (again)
        change.primitives = {{body, corners}};
      else
        change.removed_primitives = {{body, id}};
      changing.apply(change, playback);
      const ListEdit edit =
          collision.geometry_changed(t, view, ClipMotion<float>(playback), body_changes(view, change));
      total.removed += edit.removed;
      total.decided += edit.decided;
    }
    const double after = std::nextafter(t, 1.0);
    if (i % 20 != 0 || collision.due(after)) continue;
    EXPECT_EQ(auditor.compare(after), "") << n;
  }
  EXPECT_GE(auditor.audits, 4u);
  return {double(total.removed + total.decided) / (2 * rounds), double(collision.list().size())};
}

// The cost of an insertion or deletion depends on the pairs below a few nodes, not on the list.
TEST(SeparationListGeometry, ChangesAreLocal) {
  std::vector<Locality> found;
  for (const std::uint32_t n : {8u, 16u, 32u, 64u}) {
    found.push_back(locality(n));
    std::printf("%u triangles a body: %.1f pairs per change, of a list of %.0f\n", 2 * n * n,
                found.back().work, found.back().list);
  }
  EXPECT_GT(found.back().list, 6 * found.front().list);
  EXPECT_LT(found.back().work, 1.5 * found.front().work);
}

TEST(SeparationListEvents, EachKindHappensOftenInTheTestScenes) {
  Kinds all;
  for (const char* name : {"soups", "sheets", "plan_changes"}) {
    const Kinds kinds = play<float>(name, {.width = 2, .leaf_size = 1}, 1, avl);
    all.overlap += kinds.overlap;
    all.parents += kinds.parents;
    all.leaves += kinds.leaves;
    all.changes += kinds.changes;
  }
  EXPECT_GE(all.overlap, 1000u);
  EXPECT_GE(all.parents, 1000u);
  EXPECT_GE(all.leaves, 1000u);
  EXPECT_GE(all.changes, 1000u);
}

// A list that receives only some of its trees' changes is detected.
TEST(SeparationListFaults, MissedNotices) {
  const auto test = synthetic_scene<float>("sheets");
  const SceneView<float> view(test.scene);
  using Collision = KineticCollision<float, AnyEventQueue>;
  for (const std::uint64_t missed : {1u, 10u, 50u}) {  // every such notice
    Playback<float> playback(test.scene);
    Counters count;
    Collision collision(view, ClipMotion<float>(playback),
                        build_topologies(view, playback, {.width = 2, .leaf_size = 1}), count,
                        OverlapClock<float>::usual_look_ahead, avl);
    collision.reset(0);
    Auditor<float, Collision> auditor(collision, view);
    bool found = false;
    std::uint64_t events = 0;
    try {
      for (const double t : frame_times(test.scene, 4)) {
        while (collision.due(t))
          if (collision.tree_is_first() && ++events % missed == 0)
            collision.forest().handle_next();  // which is not reported to the list
          else
            collision.handle_next();
        const double after = std::nextafter(t, 1e300);
        if (!collision.due(after) && !auditor.compare(after).empty()) found = true;
        if (found) break;
      }
    } catch (const std::invalid_argument&) {  // an impossible event
      found = true;
    }
    EXPECT_TRUE(found) << "every notice of " << missed;
  }
}

TEST(Widening, ExceedsFourUnitsInTheLastPlace) {
  Random random(5);
  const auto check = [&](auto zero) {
    using S = decltype(zero);
    for (int i = 0; i < 100000; ++i) {
      const S x = S(std::ldexp(random.unit(), int(random.below(200)) - 100));
      S above = x;
      for (int k = 0; k < 4; ++k) above = std::nextafter(above, std::numeric_limits<S>::infinity());
      ASSERT_GE(widened_up(x), above) << x;
      ASSERT_LE(double(widened_up(x)) - double(x), std::abs(double(x)) * 0x1p-19 + 1e-300) << x;
    }
    const S tiny = std::numeric_limits<S>::denorm_min();
    for (const S x : {S(0), S(-0.0), tiny, -tiny, S(-2) * tiny, S(3) * tiny, S(-3) * tiny})
      ASSERT_GT(widened_up(x), x);
  };
  check(0.0f);
  check(0.0);
}

}  // namespace
}  // namespace kbvh::test::separation_list_test
