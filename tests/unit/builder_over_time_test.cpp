// A tree for several times: sound, as full as the tree by medians, the same at each build, and better over
// the clip where primitives part.

#include "core/topology/builder_over_time.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::builder_over_time_test {
namespace {

/// Short segments along x at first and along y at last, in orders without relation to each other.
struct Crossing {
  Primitives primitives;
  std::vector<double> first, last;

  explicit Crossing(std::uint32_t count) {
    Random random(5);
    primitives.offsets = {0};
    for (std::uint32_t p = 0; p < count; ++p) {
      const double x = 100 * random.unit(), y = 100 * random.unit();
      for (const double end : {0.0, 0.1}) {
        first.insert(first.end(), {x + end, random.unit(), random.unit()});
        last.insert(last.end(), {random.unit(), y + end, random.unit()});
        primitives.vertices.push_back(2 * p + (end > 0));
      }
      primitives.offsets.push_back(2 * (p + 1));
    }
  }
  std::vector<const double*> times() const { return {first.data(), last.data()}; }
};

/// Returns the surfaces of all nodes, summed over the times.
double surfaces(const Topology& topology, const Primitives& primitives,
                const std::vector<const double*>& times) {
  double sum = 0;
  for (const double* const at : times) {
    std::vector<Box<double>> boxes(topology.size());
    for (std::uint32_t node = topology.size(); node-- > 0;) {
      const TopologyNode& n = topology.nodes[node];
      if (n.is_leaf())
        for (std::uint32_t i = n.first(); i < n.first() + n.count(); ++i)
          for (const std::uint32_t v : primitives[topology.primitives[i]])
            boxes[node].extend(at + std::size_t(3) * v);
      sum += surface_area(boxes[node]);
      if (node > 0) boxes[topology.parents[node]].extend(boxes[node]);
    }
  }
  return sum;
}

TEST(BuilderOverTime, TreesAreSoundAndTheSameAtEachBuild) {
  for (const std::uint32_t count : {1u, 2u, 7u, 64u, 513u}) {
    const Crossing body(count);
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf : {1u, 4u, 16u}) {
        const BuilderConfig config{.width = width, .leaf_size = leaf};
        const auto times = body.times();
        const Topology topology = build_topology_over_time<double>(body.primitives, times, config);
        EXPECT_EQ(check_topology(topology, body.primitives), "");
        for (const TopologyNode node : topology.nodes) {
          const auto begin = topology.primitives.begin() + node.first();
          EXPECT_TRUE(!node.is_leaf() || std::is_sorted(begin, begin + node.count()));
        }
        const Topology again = build_topology_over_time<double>(body.primitives, times, config);
        EXPECT_EQ(topology.primitives, again.primitives);
        const Topology median = build_topology(body.primitives, body.first.data(), config);
        EXPECT_EQ(topology.size(), median.size()) << "as full as the tree by medians";
        EXPECT_EQ(topology.perfect, median.perfect);
      }
  }
}

TEST(BuilderOverTime, OneTimeGivesTheTreeByMedians) {
  const Crossing body(300);
  const double* const times[] = {body.first.data()};
  const BuilderConfig config{.width = 4, .leaf_size = 2};
  const Topology over_time = build_topology_over_time<double>(body.primitives, times, config);
  const Topology median = build_topology(body.primitives, body.first.data(), config);
  EXPECT_EQ(surfaces(over_time, body.primitives, {body.first.data()}),
            surfaces(median, body.primitives, {body.first.data()}));
}

TEST(BuilderOverTime, BothTimesCount) {
  const Crossing body(512);
  const BuilderConfig config{.width = 2, .leaf_size = 1};
  const auto times = body.times();
  const double both =
      surfaces(build_topology_over_time<double>(body.primitives, times, config), body.primitives, times);
  const double first =
      surfaces(build_topology(body.primitives, body.first.data(), config), body.primitives, times);
  EXPECT_LT(both, 0.6 * first);
}

TEST(BuilderOverTime, RemovedPrimitivesAndWrongInput) {
  Crossing body(20);
  const auto times = body.times();
  EXPECT_THROW(build_topology_over_time<double>(body.primitives, {}, {}), std::invalid_argument);
  EXPECT_THROW(build_topology_over_time<double>(body.primitives, times, {.width = 3}), std::invalid_argument);
  EXPECT_THROW(build_topology_over_time<double>(body.primitives, times, {.leaf_size = 17}),
               std::invalid_argument);
  const Primitives none;
  EXPECT_EQ(build_topology_over_time<double>(none, times, {}).size(), 0u);
}

}  // namespace
}  // namespace kbvh::test::builder_over_time_test
