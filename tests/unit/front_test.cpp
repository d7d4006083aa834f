// Fronts give the pairs of a fresh traversal after any jump in time, for every width and set of kernels, and
// contain the nodes that a fresh traversal visits, so that they shrink when bodies part.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/front/pair_front.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/support/wide_bodies.hpp"

namespace kbvh::test::front_test {
namespace {

/// The hierarchies of a scene, and one front for all pairs of bodies, as a strategy keeps it.
template <class S>
struct Bodies : WideBodies<S> {
  using WideBodies<S>::WideBodies;

  struct Answer {
    PairBuffer pairs{};
    std::uint64_t tests = 0, pending = 0;
  };
  Answer traversed() {
    Answer answer;
    answer.pairs = this->candidates(answer.tests);
    return answer;
  }
  Answer tracked(const Budget& budget = {}) {
    Answer answer;
    front.start_frame();
    const auto& pairs = this->scene.pairs;
    for (std::uint32_t i = 0; i < pairs.size(); ++i)
      answer.pending += front
                            .run(i, this->side(pairs[i].first), this->side(pairs[i].second), this->query,
                                 answer.pairs, answer.tests, rest_of(budget, answer.tests))
                            .pending;
    std::sort(answer.pairs.begin(), answer.pairs.end());
    return answer;
  }

  PairFront<S> front;
};

template <class S>
class FrontTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(FrontTest, Scalars);

TYPED_TEST(FrontTest, EqualsATraversalAfterAnyJump) {
  using S = TypeParam;
  Random random(3);
  std::vector<std::string> names = {"soups", "four_bodies_own_keyframes"};
  names.insert(names.end(), self_scene_names().begin(), self_scene_names().end());
  std::size_t found = 0;
  for (const std::string& name : names)
    for (const std::uint32_t width : {2U, 4U, 8U})
      for (const std::uint32_t leaf : {1U, 3U, 16U})
        for (const KernelSet set : supported_kernel_sets()) {
          const auto test = synthetic_scene<S>(name);
          if (test.script.changes_geometry()) continue;
          const BuildMethod method = leaf == 3 ? BuildMethod::sah : BuildMethod::median;
          Bodies<S> bodies(test.scene, {.method = method, .width = width, .leaf_size = leaf}, set);
          for (int round = 0; round < 6; ++round) {
            bodies.seek(test.frames[random.below(std::uint32_t(test.frames.size()))]);
            const auto expected = bodies.traversed(), own = bodies.tracked(), again = bodies.tracked();
            ASSERT_EQ(own.pairs, expected.pairs) << name << ", width " << width << ", leaves of " << leaf;
            ASSERT_EQ(again.pairs, expected.pairs) << name << ", width " << width << ", leaves of " << leaf;
            // A restarted front visits what a traversal visits.
            ASSERT_EQ(again.tests, expected.tests) << name << ", width " << width << ", leaves of " << leaf;
            found += own.pairs.size();
          }
        }
  EXPECT_GT(found, 1000U);
}

TYPED_TEST(FrontTest, ShrinksWhenBodiesPart) {
  using S = TypeParam;
  Bodies<S> bodies(grids<S>(32, 0.2, lifted), {.method = BuildMethod::median, .width = 8, .leaf_size = 4},
                   active_kernel_set());
  bodies.seek(0);
  bodies.tracked();
  const std::size_t near = bodies.front.entries().size();
  EXPECT_GT(near, 50U);
  bodies.seek(1e-3);  // the same tree of tests or a part of it, but for rounding
  const std::uint64_t made = bodies.front.descended();
  bodies.tracked();
  EXPECT_LE(bodies.front.descended() - made, near / 10);
  bodies.seek(1);
  bodies.tracked();
  EXPECT_EQ(bodies.front.entries().size(), 0U);
  EXPECT_EQ(bodies.front.climbed(), bodies.front.descended());
  bodies.seek(0);
  EXPECT_EQ(bodies.tracked().pairs, bodies.traversed().pairs);
  EXPECT_EQ(bodies.front.entries().size(), near);
}

TYPED_TEST(FrontTest, SurvivesFramesThatABudgetCut) {
  using S = TypeParam;
  const auto test = synthetic_scene<S>("soups", 7);
  Bodies<S> bodies(test.scene, {.method = BuildMethod::median, .width = 4, .leaf_size = 2},
                   active_kernel_set());
  Random random(5);
  std::size_t cut = 0;
  for (const double t : test.frames) {
    bodies.seek(t);
    const Budget budget{random.below(2) == 0 ? random.below(200) : ~std::uint64_t(0)};
    const auto expected = bodies.traversed(), own = bodies.tracked(budget);
    EXPECT_TRUE(
        std::includes(expected.pairs.begin(), expected.pairs.end(), own.pairs.begin(), own.pairs.end()));
    if (own.pending == 0)
      EXPECT_EQ(own.pairs, expected.pairs) << "t = " << t;
    else
      ++cut;
  }
  EXPECT_GT(cut, 2U);
}

}  // namespace
}  // namespace kbvh::test::front_test
