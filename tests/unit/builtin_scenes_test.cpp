// Every scene of the table builtin_scenes(): sound at any size, the same bits everywhere, pairs that begin
// and end, and a row in the list of scenes. A new scene needs a line in the table below.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/judge/oracle.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/support/mesh_checks.hpp"

namespace kbvh::experiments::builtin_scenes_test {
namespace {

struct Expected {
  const char* name;
  std::uint64_t hash;         ///< of the positions of all bodies: 300 triangles, 12 keyframes, seed 1
  const char* no_pairs = "";  ///< why bodies do not meet, where they need not
};

constexpr Expected table[] = {
    {"tablecloth", 712625083502136254u},
    {"shirt", 15147239916072724546u},
    {"dress", 10586835899079492839u},
    {"waving_sheet", 696115605903879268u},
    {"expanding_sphere", 2790203384580940872u},
    {"reversing_spheres", 13956685046990596026u, "their plans change at the first contact"},
    {"dragged_cloth", 712625083502136254u},
    {"passing_spheres", 17079011975079364065u},
    {"turning_box", 8102447267687650763u},
    {"random_soups", 11846437445898464522u},
    {"mixing_swarms", 10702371892230181857u},
    {"crossing_crowd", 9494436540184956811u},
    {"shattering_balls", 3969587581126391238u},
    {"flowing_soup", 3600417038905966548u},
    {"twisted_rod", 3747541360907135180u},
    {"tightening_knot", 10346962019720715169u},
    {"unrolling_yarns", 7110108111235796318u},
    {"hidden_crowd", 10858110755637235197u, "the scene is made for rays"},
    {"funnel_cloth", 9072969145540798502u},
    {"running_figures", 3996950380865853089u},
    {"morphing_ball", 14298036009457766635u},
    {"vibrating_plate", 4724932245427280551u},
    {"dented_sheet", 13120339444664770869u},
    {"thrown_cloth", 4715550687323444333u},
    {"thrown_shards", 3570337292304366965u},
};

LoadedScene loaded(const std::string& name, std::uint32_t triangles, std::uint32_t keyframes) {
  SceneSpec spec;
  spec.builtin = name;
  spec.options = {.triangles = triangles, .keyframes = keyframes};
  return load(spec);
}

std::uint64_t hash_of(const LoadedScene& scene) {
  std::vector<double> all;
  for (const io::AnimatedMesh& mesh : scene.meshes)
    all.insert(all.end(), mesh.positions.begin(), mesh.positions.end());
  return test::hash(all);
}

class BuiltinScenes : public testing::TestWithParam<std::string> {
 protected:
  // Simulated again: a file in the user's cache could be of another solver.
  static void SetUpTestSuite() {
    std::string folder = (std::filesystem::temp_directory_path() / "kbvh-scenes-XXXXXX").string();
    ASSERT_NE(::mkdtemp(folder.data()), nullptr);
    cache = folder;
    ::setenv("KBVH_CACHE", folder.c_str(), 1);
  }
  static void TearDownTestSuite() {
    std::error_code error;
    std::filesystem::remove_all(cache, error);
  }

  const Expected* expected() const {
    const auto* const found = std::find_if(std::begin(table), std::end(table),
                                           [](const Expected& e) { return e.name == GetParam(); });
    return found == std::end(table) ? nullptr : found;
  }

  inline static std::filesystem::path cache;
};

TEST_P(BuiltinScenes, AreSoundAtEverySize) {
  const BuiltinScene& scene = find_builtin_scene(GetParam());
  EXPECT_FALSE(scene.meaning.empty());
  for (const std::uint32_t triangles : {2u, 20u, 300u})
    for (const std::uint32_t keyframes : {2u, 13u}) {
      SCOPED_TRACE(std::to_string(triangles) + " triangles, " + std::to_string(keyframes) + " keyframes");
      const LoadedScene made = loaded(GetParam(), triangles, keyframes);
      ASSERT_FALSE(made.meshes.empty());
      EXPECT_EQ(made.meshes.size() == 1, scene.bodies == BodiesOf::one);
      EXPECT_TRUE(std::any_of(made.meshes.begin(), made.meshes.end(),
                              [](const io::AnimatedMesh& mesh) { return mesh.moving(); }));
      for (const io::AnimatedMesh& mesh : made.meshes) {
        // A rule that changes plans makes its own keyframes.
        const std::size_t own = mesh.keyframe_times.size();
        test::expect_sound(mesh, !mesh.moving() ? 1 : scene.reversal != nullptr ? own : keyframes);
      }
    }
}

TEST_P(BuiltinScenes, SameBitsEverywhere) {
  const std::uint64_t found = hash_of(loaded(GetParam(), 300, 12));
  const Expected* const line = expected();
  if (line == nullptr)
    FAIL() << "the scene is new: its line in the table of tests/unit/builtin_scenes_test.cpp is {\""
           << GetParam() << "\", " << found << "u}";
  EXPECT_EQ(found, line->hash) << "if the scene was changed on purpose, this is its new hash; if not, some "
                                  "flag breaks the numeric policy";
}

TEST_P(BuiltinScenes, PairsBeginAndEnd) {
  const Expected* const line = expected();
  if (line != nullptr && *line->no_pairs != '\0') GTEST_SKIP() << line->no_pairs;
  const Scene<float> scene = assemble<float>(loaded(GetParam(), 600, 60));
  std::vector<double> times;
  for (const Body<float>& body : scene.bodies)
    if (body.plans.moving()) times = {body.plans.keyframe_times().begin(), body.plans.keyframe_times().end()};
  ASSERT_GT(times.size(), 1u);
  Playback<float> playback(scene);
  std::size_t begun = 0, ended = 0;
  PairBuffer before;
  for (std::size_t f = 0; f < times.size(); ++f) {
    playback.seek(times[f]);
    playback.evaluate_all();
    PairBuffer now = sweep_pairs(scene, playback);
    if (f > 0) {
      std::vector<PrimitivePair> lost, gained;
      std::set_difference(before.begin(), before.end(), now.begin(), now.end(), std::back_inserter(lost));
      std::set_difference(now.begin(), now.end(), before.begin(), before.end(), std::back_inserter(gained));
      ended += lost.size();
      begun += gained.size();
    }
    before = std::move(now);
  }
  EXPECT_GT(begun, 0u) << "no pair begins after the first keyframe";
  EXPECT_GT(ended, 0u) << "no pair ends";
}

TEST_P(BuiltinScenes, HaveARowInTheList) {
  std::ifstream file(std::filesystem::path(KBVH_SOURCE_DIR) / "experiments" / "README.md");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t begin = text.find("\n## Built-in scenes\n"), end = text.find("\n## ", begin + 1);
  ASSERT_NE(begin, std::string::npos);
  EXPECT_NE(text.substr(begin, end - begin).find("`" + GetParam() + "`"), std::string::npos)
      << "the table of experiments/README.md has no row of this scene";
}

std::vector<std::string> names() {
  std::vector<std::string> found;
  for (const BuiltinScene& scene : builtin_scenes()) found.push_back(scene.name);
  return found;
}

INSTANTIATE_TEST_SUITE_P(All, BuiltinScenes, testing::ValuesIn(names()),
                         [](const auto& test) { return test.param; });

TEST(BuiltinScenesTable, HasNoSceneThatIsGone) {
  const std::vector<std::string> known = names();
  for (const Expected& line : table)
    EXPECT_NE(std::find(known.begin(), known.end(), line.name), known.end()) << line.name;
}

}  // namespace
}  // namespace kbvh::experiments::builtin_scenes_test
