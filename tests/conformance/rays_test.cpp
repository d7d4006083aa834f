// Rays at frames: every strategy that declares them, against every primitive, on every synthetic scene,
// between queries of pairs. Peers with their own test are counted, not judged.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/kernels/kernel_set.hpp"
#include "tests/conformance/ray_check.hpp"

namespace kbvh::test::rays_test {
namespace {

class Rays : public testing::TestWithParam<std::string> {};

TEST_P(Rays, MeetWhatEveryPrimitiveSays) {
  const auto run = [&]<class S>(const TestScene<S>& test) {
    Truth<S> truth;
    std::uint64_t hits = 0;
    for (const StrategyEntry& entry : registry()) {
      if (!entry.info.can.rays) continue;
      const std::string where =
          entry.info.id + " on " + test.scene.name + (sizeof(S) == 4 ? ", float" : ", double");
      EXPECT_EQ(rays_violation(entry, test, entry.info.topology.preferred, {}, truth, hits), "") << where;
    }
  };
  run(synthetic_scene<float>(GetParam()));
  if (in_both_scalars()) run(synthetic_scene<double>(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Scenes, Rays, testing::ValuesIn(all_synthetic_names()),
                         [](const auto& test) { return test.param; });

// The other paths: every set of kernels, width and leaf size, lazy work of every kind, kinds of volumes.
TEST(RaysInEveryWay, MeetWhatEveryPrimitiveSays) {
  using Params = std::map<std::string, std::string>;
  const std::pair<const char*, Params> ways[] = {
      {"bottom_up", {}},
      {"hybrid", {{"levels", "0"}}},
      {"hybrid", {{"levels", "1"}, {"below", "top_down"}}},
      {"inflated_lazy", {{"bound", "scan"}}},
      {"inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.5"}}},
      {"kinetic_calendar", {}},
      {"kinetic_aabb", {}},
      {"kinetic_separation_list", {}},
      {"linear_bounds", {}},
      {"interval_join", {}},
      {"interval_join_ahead", {}},
      {"drift_boxes", {}},
      {"drift_boxes_bounded", {}},
      {"drift_boxes", {{"lists", "never"}}},
      {"auto", {}},
      {"bottom_up_volumes", {{"volume", "sphere"}}},
      {"bottom_up_volumes", {{"volume", "obb"}}},
  };
  const auto test = synthetic_scene<float>("soups");
  Truth<float> truth;
  std::uint64_t hits = 0;
  for (const KernelSet set : supported_kernel_sets()) {
    use_kernel_set(set);
    for (const auto& [id, params] : ways) {
      const StrategyEntry& entry = find_strategy(id);
      for (const std::uint32_t width : {2U, 8U})
        for (const std::uint32_t leaf : {1U, 3U}) {
          const auto& widths = entry.info.topology.widths;
          if (std::find(widths.begin(), widths.end(), width) == widths.end()) continue;
          EXPECT_EQ(
              rays_violation(entry, test, {.method = BuildMethod::sah, .width = width, .leaf_size = leaf},
                             params, truth, hits),
              "")
              << id << ", " << name(set) << ", width " << width << ", leaf size " << leaf;
        }
    }
  }
  use_kernel_set(supported_kernel_sets().back());
  EXPECT_GT(hits, 1000U);
}

TEST(RaysOfStrategies, AreAnsweredByAllWithAHierarchyOfBoxes) {
  std::vector<std::string> able;
  for (const StrategyEntry& entry : registry())
    if (entry.info.can.rays) able.push_back(entry.info.id);
  for (const char* id : {"bottom_up",
                         "hybrid",
                         "inflated_lazy",
                         "rebuild",
                         "lbvh",
                         "ploc",
                         "rotations",
                         "selective_restructuring",
                         "tsah",
                         "kdop",
                         "kinetic_aabb",
                         "kinetic_kdop",
                         "kinetic_boxtree",
                         "kinetic_envelope",
                         "linear_bounds",
                         "interval_join",
                         "interval_join_ahead",
                         "drift_boxes",
                         "drift_boxes_bounded",
                         "auto",
                         "brute_force"})
    EXPECT_NE(std::find(able.begin(), able.end(), id), able.end()) << id;
  for (const char* id : {"sweep", "hash_grid"}) EXPECT_FALSE(find_strategy(id).info.can.rays) << id;
}

TEST(RaysOfStrategies, AreCheckedBeforeTheyAreFollowed) {
  const auto test = synthetic_scene<float>("soups");
  const StrategyEntry& entry = find_strategy("bottom_up");
  Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes ignored;
  session.reset(frame_times(test.scene, 1)[0]);
  const std::vector<Ray<float>> one{{{0, 0, 0}, {1, 0, 0}}};
  std::vector<RayHit> hits(2, RayHit{7, 7, 7});
  EXPECT_THROW(session.probe(RayProbes<float>{RayQuery::closest, one, std::span<RayHit>(hits)}, ignored),
               std::invalid_argument);
  const std::vector<Ray<float>> wrong{{{0, 0, 0}, {1, 0, 0}}, {{0, 0, 0}, {1, 0, 0}, -1}};
  EXPECT_THROW(session.probe(RayProbes<float>{RayQuery::closest, wrong, std::span<RayHit>(hits)}, ignored),
               std::invalid_argument);
  EXPECT_EQ(hits[0], (RayHit{7, 7, 7}));  // no partial result
  EXPECT_THROW(session.strategy().probe_at(
                   1e6, RayProbes<float>{RayQuery::closest, one, std::span<RayHit>(hits).first(1)}),
               std::invalid_argument);
}

}  // namespace
}  // namespace kbvh::test::rays_test
