// The suite can fail for refits of what moved, in their simplest form: without a fault, and with one seeded
// fault each.

#include <gtest/gtest.h>

#include "core/families/wide/dirty_nodes.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "core/scene/moved_vertices.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/plan_changes.hpp"

namespace kbvh::test::moved_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  forgotten_vertex,  // one vertex is missing in the list of those that moved
  forgotten_root,    // nodes are refitted below the root only
  forgotten_change,  // lists outlive a change of plans
  stale_list,        // the list of the first frame is used for all
};

template <class S, Fault fault>
class Dirty : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  Dirty(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
        const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        moved_(motion),
        dirty_(scene.body_count()),
        lists_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      dirty_[body].assign(this->hierarchies_[body], moved_.vertex_count(body));
  }
  void reset_to(double t) override {
    moved_.start_over();
    for (auto& list : lists_) list.reset();
    Base::reset_to(t);
  }

 private:
  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    Base::follow_plans(t, changes);
    if (fault == Fault::forgotten_change) return;
    for (const PlanChange<S>& change : changes) moved_.forget(change.body);
  }
  void update(std::uint32_t body) override {
    auto moved = moved_.since(body, this->previous_time());
    if (!moved) return this->refit(body);
    auto& list = lists_[body];
    if (fault != Fault::stale_list || !list) list.emplace(moved->begin(), moved->end());
    if (fault == Fault::forgotten_vertex && !list->empty()) list->pop_back();
    auto& hierarchy = this->hierarchies_[body];
    std::span<const std::uint32_t> nodes = dirty_[body].find(*list);
    if (fault == Fault::forgotten_root && !nodes.empty()) nodes = nodes.first(nodes.size() - 1);
    wide_refit_kernels<S>(hierarchy.kernels())
        .listed(hierarchy.width())(hierarchy.arrays(), this->sampled_.positions(body), nodes.data(),
                                   std::uint32_t(nodes.size()));
  }

  MovedVertices<S> moved_;
  std::vector<DirtyNodes<S>> dirty_;
  std::vector<std::optional<std::vector<std::uint32_t>>> lists_;
};

template <class S>
using Sound = Dirty<S, Fault::none>;
template <class S>
using ForgottenVertex = Dirty<S, Fault::forgotten_vertex>;
template <class S>
using ForgottenRoot = Dirty<S, Fault::forgotten_root>;
template <class S>
using ForgottenChange = Dirty<S, Fault::forgotten_change>;
template <class S>
using StaleList = Dirty<S, Fault::stale_list>;

/// A grid of which single vertices rise, others in every segment, over one that rests until some of its
/// vertices get plans of their own.
template <class S>
TestScene<S> test_scene(std::uint32_t l) {
  TestScene<S> test;
  test.scene.bodies.push_back(
      placed_grid<S>(10, 5, [](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
        double height = 0.02;
        for (std::uint32_t past = 1; past <= k; ++past) height += (i + 3 * j) % 17 == past ? -0.05 : 0;
        return axis == 0 ? i / 10.0 : axis == 1 ? j / 10.0 : height;
      }));
  test.scene.bodies.push_back(
      placed_grid<S>(10, 1, [](std::uint32_t, std::uint32_t i, std::uint32_t j, int axis) -> double {
        return axis == 0 ? 0.03 + i / 10.0 : axis == 1 ? 0.02 + j / 10.0 : 0;
      }));
  test.scene.pairs = all_pairs(test.scene.bodies);
  test.frames = frame_times(test.scene, l);
  const double begin = test.frames[test.frames.size() / 4], later = test.frames[test.frames.size() / 2];
  test.script.steps.push_back({begin, {flies<S>(1, 50, 0, 0, S(0.125)), flies<S>(1, 20, S(0.25), 0, 0)}});
  test.script.steps.push_back({later, {flies<S>(1, 50, 0, 0, 0), flies<S>(1, 90, 0, S(0.5), 0)}});
  return test;
}

template <template <class> class Strategy>
std::string violation(const char* id) {
  Info info;
  info.id = id;
  info.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  const StrategyEntry entry = make_entry<Strategy>(info);
  const BuilderConfig& builder = entry.info.topology.preferred;
  return check(entry, test_scene<float>(7), 7, {}, builder) + "|" +
         check(entry, test_scene<double>(7), 7, {}, builder);
}

void expect_caught(const std::string& violations) {
  const std::size_t bar = violations.find('|');
  EXPECT_NE(violations.substr(0, bar).find("protrudes"), std::string::npos) << "in float: " << violations;
  EXPECT_NE(violations.substr(bar + 1).find("protrudes"), std::string::npos) << "in double: " << violations;
}

TEST(MovedFaults, ASoundRefitOfWhatMovedPasses) {
  EXPECT_EQ(violation<Sound>("sound"), "|");
}
TEST(MovedFaults, AVertexForgotten) {
  expect_caught(violation<ForgottenVertex>("forgotten_vertex"));
}
TEST(MovedFaults, TheRootForgotten) {
  expect_caught(violation<ForgottenRoot>("forgotten_root"));
}
TEST(MovedFaults, AChangeOfPlansForgotten) {
  expect_caught(violation<ForgottenChange>("forgotten_change"));
}
TEST(MovedFaults, AListThatIsNotOfThisFrame) {
  expect_caught(violation<StaleList>("stale_list"));
}

}  // namespace
}  // namespace kbvh::test::moved_faults_test
