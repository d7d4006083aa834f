// Every contestant on real motion: published sequences, our own cloth, several bodies; float and double; l =
// 1, 7, 30. Exact contestants equal the oracle, peers contain it and equal it after kbvh's test, and
// approximate ones are listed with the pairs that they miss and add. In CI about 20 frames of the scenes of
// up to 4k triangles; with KBVH_SLOW=1 everything.

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "core/scene/self_pairs.hpp"
#include "tests/conformance/check.hpp"
#include "tests/conformance/real_scenes.hpp"

namespace kbvh::test {
namespace {

bool slow() {
  return std::getenv("KBVH_SLOW") != nullptr;
}

class RealScenes : public testing::TestWithParam<RealScene> {
 protected:
  bool ran_ = false;
  template <class S>
  void run(std::uint32_t l) {
    const std::size_t keyframes = slow() ? 0 : l == 1 ? 20 : l == 7 ? 4 : 2;
    const auto loaded = load_real_scene(GetParam().name, keyframes, slow() ? 0 : 4500);
    if (loaded.meshes.empty()) return;
    ran_ = true;
    const Scene<S> scene = experiments::assemble<S>(loaded);
    const std::vector<double> frames = frame_times(scene, l);
    Oracle<S> oracle(scene);  // shared: each frame's truth is computed once for all contestants
    std::uint64_t contestants = 0, pairs = 0;
    for (const StrategyEntry& entry : registry()) {
      if (entry.factory<S>() == nullptr) continue;
      if (has_self_pairs(scene.pairs) && !entry.info.can.self_pairs) continue;
      if (entry.info.max_primitive_pairs != 0 && slow()) continue;  // quadratic: quick scenes only
      Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
      const Verification result =
          verify<S>(session, std::span<const double>(frames), oracle, nullptr, {.areas = Areas::left_out});
      EXPECT_EQ(result.first_violation, "") << entry.info.id << " on " << scene.name << ", l = " << l;
      if (entry.info.guarantee != Guarantee::approximate) {
        EXPECT_EQ(result.missed + result.extra + result.repeated + result.missed_candidates, 0u)
            << entry.info.id;
        EXPECT_EQ(result.audit.protrusion, 0) << entry.info.id;
      } else {
        std::printf("  %-28s %-6s l=%-3u %-24s missed %llu, extra %llu of %llu\n", scene.name.c_str(),
                    sizeof(S) == 4 ? "float" : "double", l, entry.info.id.c_str(),
                    (unsigned long long)result.missed, (unsigned long long)result.extra,
                    (unsigned long long)result.pairs);
      }
      EXPECT_EQ(result.frames, frames.size());
      ++contestants;
      pairs = result.pairs;
    }
    std::printf("%-30s %-6s l=%-3u %6zu frames, %llu pairs, %llu contestants\n", scene.name.c_str(),
                sizeof(S) == 4 ? "float" : "double", l, frames.size(), (unsigned long long)pairs,
                (unsigned long long)contestants);
    std::fflush(stdout);
  }
};

TEST_P(RealScenes, EveryContestantKeepsItsGuarantee) {
  if (GetParam().needs_data && !std::filesystem::exists(data_folder()))
    GTEST_SKIP() << "no data folder at " << data_folder() << "; set KBVH_DATA";
  for (std::uint32_t l : {1u, 7u, 30u}) {
    run<float>(l);
    run<double>(l);
  }
  if (!ran_) GTEST_SKIP() << "too large for a quick run; KBVH_SLOW=1 runs it";
}

INSTANTIATE_TEST_SUITE_P(All, RealScenes, testing::ValuesIn(real_scenes()), [](const auto& test) {
  std::string name = test.param.name;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
});

}  // namespace
}  // namespace kbvh::test
