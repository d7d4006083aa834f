// Two spheres expand, and vertices turn round where triangles meet (Z&W s.9): the changes are recorded once
// from the oracle and replayed to every strategy that declares plan_changes, whose pairs are then compared
// with the oracle on every frame. In CI 320 triangles each and 100 frames; with KBVH_SLOW=1 2k, 10k and 40k
// triangles over up to 1000 frames (KBVH_SPHERES=triangles:frames,... chooses others).

#include <gtest/gtest.h>

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "experiments/scenes/reversal.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test {
namespace {

struct Size {
  std::uint32_t triangles, frames;
};

std::vector<Size> sizes() {
  const char* slow = std::getenv("KBVH_SLOW");
  if (slow == nullptr || *slow == '\0' || std::string(slow) == "0") return {{320, 100}};
  std::vector<Size> list;
  const char* chosen = std::getenv("KBVH_SPHERES");
  std::istringstream text(chosen == nullptr ? "2000:1000,10000:1000,40000:300" : chosen);
  char separator = 0;
  for (Size size{}; text >> size.triangles >> separator >> size.frames; text >> separator)
    list.push_back(size);
  return list;
}

experiments::LoadedScene spheres(const Size& size) {
  experiments::SceneSpec spec;
  spec.builtin = "reversing_spheres";
  spec.options.triangles = size.triangles;
  spec.options.keyframes = size.frames;
  return experiments::load(spec);
}

template <class S>
void every_strategy_equals_the_oracle(const Size& size) {
  const auto loaded = spheres(size);
  const Scene<S> scene = experiments::assemble<S>(loaded);
  const PlanScript<S> script = experiments::record_reversals(scene, *loaded.reversal);
  const std::vector<double> frames = experiments::frames_of(*loaded.reversal);
  // The scene has reversals, to the end.
  ASSERT_FALSE(script.empty());
  EXPECT_GT(script.steps.back().time, 0.8 * frames.back());
  Oracle<S> oracle(scene, {}, hash(script));  // each frame's truth is computed once for all
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.plan_changes || entry.factory<S>() == nullptr) continue;
    if (entry.info.max_primitive_pairs != 0 && size.triangles > 1000) continue;
    Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
    const auto begin = std::chrono::steady_clock::now();
    const Verification result =
        verify(session, std::span<const double>(frames), oracle, &script, {.areas = Areas::left_out});
    EXPECT_EQ(result.first_violation, "") << entry.info.id << " on " << scene.name;
    EXPECT_EQ(result.frames, frames.size());
    if (entry.info.guarantee != Guarantee::approximate) {
      EXPECT_EQ(result.missed + result.extra + result.missed_candidates, 0u) << entry.info.id;
    }
    std::printf("  %-24s %-6s %-26s %5.1f s, %llu pairs, %llu missed, %llu extra, events %llu\n",
                scene.name.c_str(), sizeof(S) == 4 ? "float" : "double", entry.info.id.c_str(),
                std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
                (unsigned long long)result.pairs, (unsigned long long)result.missed,
                (unsigned long long)result.extra,
                (unsigned long long)session.strategy().counters()[Counter::certificates_failed]);
    std::fflush(stdout);
  }
  std::printf("%s, %s: %zu frames, %zu changes at %zu of them\n", scene.name.c_str(),
              sizeof(S) == 4 ? "float" : "double", frames.size(), script.changes_until(frames.back()),
              script.steps.size());
}

TEST(ReversingSpheres, EveryStrategyEqualsTheOracleOnEveryFrame) {
  for (const Size& size : sizes()) {
    every_strategy_equals_the_oracle<float>(size);
    every_strategy_equals_the_oracle<double>(size);
  }
}

// The rule: outward vertices turn on contact, inward ones at the lowest radius, and no others turn.
TEST(ReversingSpheres, VerticesTurnByTheRule) {
  const auto loaded = spheres({320, 200});
  const Scene<double> scene = experiments::assemble<double>(loaded);
  const auto script = experiments::record_reversals(scene, *loaded.reversal);
  std::vector<std::vector<int>> turns(2, std::vector<int>(scene.bodies[0].plans.vertex_count()));
  Playback<double> playback(scene);
  for (const auto& step : script.steps) {
    playback.seek(step.time);
    for (const auto& change : step.changes) {
      const double* x = playback.position(change.body, change.vertex);
      const auto& centre = loaded.reversal->centres[change.body];
      double along = 0, square = 0;
      for (std::size_t d = 0; d < 3; ++d) {
        along += change.velocity[d] * (x[d] - centre[d]);
        square += (x[d] - centre[d]) * (x[d] - centre[d]);
      }
      int& turned = turns[change.body][change.vertex];
      EXPECT_EQ(along < 0, turned % 2 == 0) << "vertex " << change.vertex << " at " << step.time;
      if (turned % 2 == 1) {
        EXPECT_LE(std::sqrt(square), loaded.reversal->lowest_radius + 1e-12);
      }
      ++turned;
    }
    playback.change_plans(step.time, step.changes);
  }
  EXPECT_GT(*std::max_element(turns[0].begin(), turns[0].end()), 4);  // some go to and fro
  EXPECT_EQ(*std::min_element(turns[1].begin(), turns[1].end()), 0);  // the far side never meets anything
}

TEST(ReversingSpheres, AreRecordedOnce) {
  const auto loaded = spheres({320, 40});
  const Scene<float> scene = experiments::assemble<float>(loaded);
  const auto folder =
      std::filesystem::temp_directory_path() / ("kbvh-online-" + std::to_string(std::uint64_t(::getpid())));
  std::filesystem::create_directories(folder);
  const auto recorded = experiments::recorded_reversals(scene, *loaded.reversal, folder);
  EXPECT_EQ(hash(recorded), hash(experiments::record_reversals(scene, *loaded.reversal)));
  std::filesystem::path file;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) file = entry.path();
  ASSERT_FALSE(file.empty());
  int asked = 0;
  const auto count = [&](const std::string&, double) { ++asked; };
  EXPECT_EQ(hash(experiments::recorded_reversals(scene, *loaded.reversal, folder, count)), hash(recorded));
  EXPECT_EQ(asked, 0) << "taken from the folder";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 5);
  EXPECT_EQ(hash(experiments::recorded_reversals(scene, *loaded.reversal, folder, count)), hash(recorded));
  EXPECT_GT(asked, 0) << "a damaged file is made again";
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace kbvh::test
