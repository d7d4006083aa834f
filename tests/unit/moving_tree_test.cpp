// A tree whose subtrees move: sound after every move, with exact boxes; a search finds the best of all
// places, and its gain equals the gain of the move; every instruction set finds the same.

#include "core/families/restructure/moving_tree.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/topology/builders.hpp"
#include "tests/support/polygon_soups.hpp"

namespace kbvh::test::moving_tree_test {
namespace {

template <class S>
struct Soup {
  explicit Soup(std::uint32_t primitives, const BuilderConfig& config, std::uint64_t seed,
                KernelSet kernels = active_kernel_set())
      : random(seed), scene(polygon_soups<S>(primitives, random)) {
    const FlightPlans<S>& plans = scene.bodies[0].plans;
    positions.assign(plans.keyframe(0), plans.keyframe(0) + std::size_t(3) * plans.vertex_count());
    positions.push_back(0);
    tree.assign(build_topology(shapes(), positions.data(), config), shapes(), kernels);
    tree.refit(positions.data());
  }
  const Primitives& shapes() const { return scene.bodies[0].primitives; }
  void shake(double by) {
    for (S& x : positions) x += S(by * (random.unit() - 0.5));
    tree.refit(positions.data());
  }

  /// Moves all vertices of one primitive to the first of another.
  void jump(std::uint32_t primitive, std::uint32_t to) {
    for (const std::uint32_t v : shapes()[primitive])
      std::copy_n(positions.begin() + 3 * shapes()[to][0], 3, positions.begin() + 3 * v);
    tree.refit(positions.data());
  }

  Random random;
  Scene<S> scene;
  std::vector<S> positions;
  MovingTree<S> tree;
};

/// Returns the first fault of a tree with current boxes, or an empty text.
template <class S>
std::string fault(const Soup<S>& soup) {
  if (std::string why = soup.tree.check(); !why.empty()) return why;
  std::vector<Box<double>> boxes;
  const Topology topology = soup.tree.topology(boxes);
  if (std::string why = check_topology(topology, soup.shapes()); !why.empty()) return why;
  for (std::uint32_t n = 0; n < topology.size(); ++n) {
    const TopologyNode node = topology.nodes[n];
    Box<double> expected;
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
      if (!node.is_leaf())
        expected.extend(boxes[k]);
      else
        for (const std::uint32_t v : soup.shapes()[topology.primitives[k]]) {
          const S* const p = soup.positions.data() + std::size_t(3) * v;
          const double point[3] = {double(p[0]), double(p[1]), double(p[2])};
          expected.extend(point);
        }
    if (!(boxes[n] == expected)) return "the box of node " + std::to_string(n);
  }
  return {};
}

/// The sum over all nodes, but the leaves, of half their surface.
template <class S>
double cost(const MovingTree<S>& tree) {
  std::vector<Box<double>> boxes;
  const Topology topology = tree.topology(boxes);
  double sum = 0;
  for (std::uint32_t n = 0; n < topology.size(); ++n)
    if (!topology.nodes[n].is_leaf()) sum += surface_area(boxes[n]) / 2;
  return sum;
}

struct Place {
  std::uint32_t node, lane;
};
template <class S>
std::vector<Place> children(const MovingTree<S>& tree) {
  std::vector<Place> all;
  if (tree.node_count() == 0) return all;
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const std::uint32_t n = open.back();
    open.pop_back();
    for (std::uint32_t lane = 0; lane < tree.node(n).count; ++lane) {
      all.push_back({n, lane});
      if (lane >= tree.node(n).leaf_count)
        open.push_back(tree.node(n).first_child + lane - tree.node(n).leaf_count);
    }
  }
  return all;
}
template <class S>
std::vector<std::uint32_t> nodes_below(const MovingTree<S>& tree, Place place) {
  std::vector<std::uint32_t> all;
  const auto open = [&](std::uint32_t n, std::uint32_t lane) {
    if (lane >= tree.node(n).leaf_count)
      all.push_back(tree.node(n).first_child + lane - tree.node(n).leaf_count);
  };
  open(place.node, place.lane);
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::uint32_t lane = 0; lane < tree.node(all[i]).count; ++lane) open(all[i], lane);
  return all;
}
/// Returns the places to which a child can move, except its current one.
template <class S>
std::vector<Place> places(const MovingTree<S>& tree, Place child) {
  const auto below = nodes_below(tree, child);
  const auto is_below = [&](std::uint32_t n) {
    return std::find(below.begin(), below.end(), n) != below.end();
  };
  const bool dissolves = tree.node(child.node).count == 2;
  std::vector<Place> all;
  if (child.node == 0 && dissolves) return all;
  std::optional<std::uint32_t> last;
  for (const Place place : children(tree)) {
    if (is_below(place.node)) continue;
    if (place.node != last && place.node != child.node && tree.node(place.node).count < 8)
      all.push_back({place.node, MovingTree<S>::into});
    last = place.node;
    if (place.node == child.node && (place.lane == child.lane || dissolves)) continue;
    if (dissolves && place.lane >= tree.node(place.node).leaf_count &&
        tree.node(place.node).first_child + place.lane - tree.node(place.node).leaf_count == child.node)
      continue;
    all.push_back(place);
  }
  return all;
}
/// A move without a search. An infinite price of lanes keeps all nodes of more than one child.
template <class S>
ReinsertionSearch<S> order(Place child, Place to) {
  ReinsertionSearch<S> job{};
  job.node = child.node;
  job.lane = child.lane;
  job.target = to.node;
  job.target_lane = to.lane;
  job.gain = 1;
  job.lane_price = std::numeric_limits<S>::infinity();
  return job;
}

template <class S>
void stays_sound() {
  std::uint64_t seed = 5;
  for (const std::uint32_t leaf : {1u, 4u, 16u})
    for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah}) {
      SCOPED_TRACE("leaf size " + std::to_string(leaf) + ", " + name(method));
      Soup<S> soup(150, {.method = method, .width = 8, .leaf_size = leaf}, ++seed);
      ASSERT_EQ(fault(soup), "");
      for (int step = 0; step < 250; ++step) {
        const auto all = children(soup.tree);
        const Place child = all[soup.random.below(std::uint32_t(all.size()))];
        const auto to = places(soup.tree, child);
        if (to.empty()) continue;
        auto job = order<S>(child, to[soup.random.below(std::uint32_t(to.size()))]);
        if (step % 2 == 0) job.lane_price = S(0.05);  // nodes join their parents
        soup.tree.move(job);
        if (step % 50 == 49) soup.shake(0.1);
        ASSERT_EQ(fault(soup), "") << "step " << step;
      }
    }
}
TEST(MovingTree, StaysSoundUnderAnyMoves) {
  stays_sound<float>();
  stays_sound<double>();
}

TEST(MovingTree, RefusesAPlaceBelowTheChild) {
  Soup<float> soup(100, {.method = BuildMethod::sah, .width = 8, .leaf_size = 1}, 3);
  std::size_t refused = 0;
  for (const Place child : children(soup.tree))
    for (const std::uint32_t n : nodes_below(soup.tree, child)) {
      EXPECT_THROW(soup.tree.move(order<float>(child, {n, 0})), std::invalid_argument);
      ++refused;
    }
  EXPECT_GT(refused, 20u);
  EXPECT_EQ(fault(soup), "");
}

/// Returns the child without which its node shrinks most.
template <class S>
Place outlier(MovingTree<S>& tree) {
  Place found{0, 0};
  S most = -1;
  for (const Place place : children(tree)) {
    S gains[8];
    tree.gains(place.node, gains);
    if (tree.node(place.node).count > 2 && gains[place.lane] > most) most = gains[place.lane], found = place;
  }
  return found;
}

template <class S>
Place place_of(const MovingTree<S>& tree, std::uint32_t primitive) {
  for (const Place place : children(tree))
    if (place.lane < tree.node(place.node).leaf_count &&
        tree.leaf_primitives(tree.node(place.node).first_leaf + place.lane)[0] == primitive)
      return place;
  return {0, 0};
}

template <class S>
void finds_the_best() {
  std::size_t better = 0, into = 0, beside = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Soup<S> soup(40, {.method = BuildMethod::sah, .width = 8, .leaf_size = 1}, seed);
    soup.shake(0.8);
    for (int step = 0; step < 16; ++step) {
      const auto all = children(soup.tree);
      Place child = all[soup.random.below(std::uint32_t(all.size()))];
      if (step % 2 == 0) child = outlier(soup.tree);
      if (step % 4 == 3) {
        // Medians of 64 primitives fill all nodes, and one primitive jumps to another, so they need a new
        // node.
        soup = Soup<S>(64, {.method = BuildMethod::median, .width = 8, .leaf_size = 1}, 100 * seed + step);
        child = place_of(soup.tree, 0);
        soup.jump(0, 1);
      }
      const double before = cost(soup.tree);
      double best = before;
      for (const Place to : places(soup.tree, child)) {
        MovingTree<S> other = soup.tree;
        other.move(order<S>(child, to));
        best = std::min(best, cost(other));
      }
      auto found = soup.tree.best_place(child.node, child.lane, 0, 0, 1u << 30);
      const double tolerance = before * (sizeof(S) == 4 ? 1e-5 : 1e-12);
      ASSERT_NEAR(before - best, double(found.gain), tolerance);
      if (!(found.gain > S(tolerance))) continue;
      ++better;
      ++(found.target_lane == MovingTree<S>::into ? into : beside);
      found.lane_price = std::numeric_limits<S>::infinity();
      soup.tree.move(found);
      ASSERT_NEAR(cost(soup.tree), best, tolerance);
    }
  }
  EXPECT_GT(into, 5u);
  EXPECT_GT(beside, 3u);
}
TEST(MovingTree, ASearchFindsTheBestOfAllPlaces) {
  finds_the_best<float>();
  finds_the_best<double>();
}

TEST(MovingTree, EveryInstructionSetFindsTheSame) {
  std::vector<std::vector<double>> found;
  for (const KernelSet set : supported_kernel_sets()) {
    std::vector<double>& now = found.emplace_back();
    const auto add = [&]<class S>(S) {
      Soup<S> soup(300, {.method = BuildMethod::median, .width = 8, .leaf_size = 1}, 9, set);
      soup.shake(0.5);
      std::vector<S> scores;
      for (int round = 0; round < 3; ++round) {
        scores.assign(soup.tree.node_count(), 0);
        now.push_back(soup.tree.growths(soup.tree.nodes(), S(0.01), scores.data()));
        now.insert(now.end(), scores.begin(), scores.end());
        for (const Place child : children(soup.tree)) {
          if (child.lane >= soup.tree.node(child.node).count) continue;  // after a move
          const auto job = soup.tree.best_place(child.node, child.lane, S(0.06), S(0.02), 20);
          now.insert(now.end(),
                     {double(job.gain), double(job.target), double(job.target_lane), double(job.visits)});
          if (job.gain > 0) soup.tree.move(job);
        }
        EXPECT_EQ(fault(soup), "");
      }
    };
    add(float());
    add(double());
    EXPECT_EQ(now, found[0]) << name(set);
  }
}

TEST(MovingTree, TakesTreesOfOneLeafAndOfNone) {
  for (const std::uint32_t primitives : {0u, 1u, 2u}) {
    Soup<float> soup(primitives, {.method = BuildMethod::median, .width = 8, .leaf_size = 1}, 4);
    EXPECT_EQ(fault(soup), "");
    for (const Place child : children(soup.tree))
      EXPECT_EQ(soup.tree.best_place(child.node, child.lane, 0, 0, 100).gain, 0);
  }
}

}  // namespace
}  // namespace kbvh::test::moving_tree_test
