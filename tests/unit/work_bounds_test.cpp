// The work of every strategy on scenes with large numbers: where two sheets have a gap far larger than the
// rounding errors, no strategy costs much more than a refit, wherever the scene lies and whatever else a body
// contains. Loops over the registry.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/contract/registry.hpp"
#include "tests/support/play.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::work_bounds_test {
namespace {

constexpr std::uint32_t sheet_side = 33, keyframes = 4, frames_per_keyframe = 4;
/// A strategy may make this many times the box tests of a refit and its leaves.
constexpr std::uint64_t allowed = 20;

struct Work {
  std::uint64_t box_tests = 0, candidates = 0;
  std::size_t bytes = 0;
};

/// Plays a scene, and sums the work of all frames.
template <class S>
Work work_of(const StrategyEntry& entry, const Scene<S>& scene) {
  Work work;
  Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes times;
  PairBuffer pairs;
  std::uint64_t before = 0;
  const auto query = [&] {
    session.query(pairs, times);
    const Counters counters = session.strategy().counters();
    work.candidates = counters[Counter::triangle_tests];
    before = counters[Counter::box_tests];
  };
  session.reset(0);
  query();
  for (std::uint32_t f = 1; f <= (keyframes - 1) * frames_per_keyframe; ++f) {
    session.advance(f / double(frames_per_keyframe), times);
    query();
  }
  work.box_tests = before;
  work.bytes = session.strategy().bytes();
  return work;
}

template <class S>
std::uint64_t leaves_of(const Scene<S>& scene) {
  const StrategyEntry& entry = find_strategy("bottom_up");
  std::uint64_t leaves = 0;
  for (const Body<S>& body : scene.bodies)
    leaves += (body.primitives.count() + entry.info.topology.preferred.leaf_size - 1) /
              entry.info.topology.preferred.leaf_size;
  return leaves;
}

/// Returns the comment at the top of the file that registers a strategy, in one line; nothing if there is
/// none.
std::string description_of(const std::string& id) {
  for (const char* folder : {"strategies", "adapters"})
    for (const auto& file :
         std::filesystem::directory_iterator(std::filesystem::path(KBVH_SOURCE_DIR) / folder)) {
      if (file.path().extension() != ".cpp") continue;
      std::ifstream in(file.path());
      std::stringstream all;
      all << in.rdbuf();
      if (all.str().find("id = \"" + id + "\"") == std::string::npos &&
          all.str().find("(\"" + id + "\",") == std::string::npos)
        continue;
      std::string text, line;
      all.seekg(0);
      while (std::getline(all, line) && line.rfind("//", 0) == 0)
        text += line.size() > 3 ? line.substr(2) : std::string();
      return text;
    }
  return {};
}

/// Whether a strategy's description states when and why it makes more tests.
bool admits_it(const std::string& id) {
  return description_of(id).find("20 times the box tests of `bottom_up`") != std::string::npos;
}

template <class S>
void expect_bounded_work(const char* scalar) {
  for (const std::string& name : far_scene_names()) {
    const Scene<S> far = far_scene<S>(name, sheet_side, keyframes, FarPart::far),
                   near = far_scene<S>(name, sheet_side, keyframes, FarPart::near);
    const Work refit = work_of(find_strategy("bottom_up"), far);
    const std::uint64_t frames = 1 + (keyframes - 1) * frames_per_keyframe,
                        most = allowed * (refit.box_tests + frames * leaves_of(far));
    for (const StrategyEntry& entry : registry()) {
      if (entry.factory<S>() == nullptr || entry.info.guarantee == Guarantee::approximate) continue;
      if (entry.info.max_primitive_pairs != 0) continue;  // quadratic, and never run on larger scenes
      const Work work = work_of(entry, far), without = work_of(entry, near);
      const std::string where = entry.info.id + " on " + name + " in " + scalar +
                                ", where the same without " + "large numbers takes " +
                                std::to_string(without.box_tests) + " box tests and " +
                                std::to_string(without.candidates) + " candidates";
      if (!admits_it(entry.info.id)) {
        EXPECT_LE(work.box_tests, most) << where;
        EXPECT_LE(work.candidates, allowed * (refit.candidates + frames * leaves_of(far))) << where;
      }
      EXPECT_LE(work.bytes, 4 * without.bytes + (1U << 20)) << where;
    }
  }
}

TEST(WorkBounds, OfLargeNumbersInFloat) {
  expect_bounded_work<float>("float");
}
TEST(WorkBounds, OfLargeNumbersInDouble) {
  expect_bounded_work<double>("double");
}

}  // namespace
}  // namespace kbvh::test::work_bounds_test
