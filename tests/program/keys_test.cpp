// The key of a result contains everything that affects it: every field of a plan, a scene, a script and the
// parameters is altered in turn, and a different key is expected.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>
#include <sstream>

#include "complaint.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/results/record.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/study/contact_measurement.hpp"
#include "experiments/study/plan.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::keys_test {
namespace {

using nlohmann::json;

const json here{
    {"cpu", "c"}, {"compiler", "g"}, {"flags", "-O2"}, {"build_type", "Release"}, {"kernels", "sse"}};

/// Returns the keys of one table, made as a study makes them.
template <class S>
void add_keys(const Study& study, const LoadedScene& loaded, const json& machine,
              std::set<std::string>& keys) {
  const Scene<S> scene = assemble<S>(loaded);
  const PlanScript<S> script = script_of(scene, loaded);
  std::vector<std::string> notes;
  const auto contestants = expand(study.strategies, study.params, study.builder, notes);
  std::vector<std::uint32_t> per_keyframe = study.per_keyframe;
  if (has_own_frames(loaded) || study.asks.continuous) per_keyframe = {1};
  for (const std::uint32_t l : per_keyframe) {
    const std::size_t most = study.frames_limit > 0 ? study.frames_limit : SIZE_MAX;
    std::vector<double> frames =
        study.asks.continuous ? overlaid_keyframes(scene) : frames_of(scene, loaded, script, l, most);
    frames.resize(std::min(frames.size(), most));
    const json about = scene_record(scene, loaded, l, std::span<const double>(frames), script);
    for (const ContestantSpec& spec : contestants)
      keys.insert(configuration_key("p", about, strategy_record(spec), study, machine));
  }
}

std::set<std::string> keys_of(const json& value, const std::filesystem::path& folder = {}) {
  std::set<std::string> keys;
  for (const Study& study : read_plan(value, "p.json", folder).studies)
    for (const SceneSpec& spec : study.scenes) {
      const LoadedScene loaded = load(spec);
      for (const std::string& scalar : study.scalars)
        scalar == "float" ? add_keys<float>(study, loaded, here, keys)
                          : add_keys<double>(study, loaded, here, keys);
    }
  return keys;
}

/// Returns another value of the same kind that a plan may hold; null if there is none, or if it has no
/// effect.
json other(const std::string& key, const json& value) {
  static const std::set<std::string> free{"name",  "description", "optional", "id",
                                          "shape", "builtin",     "file",     "motion"};
  static const std::map<std::string, json> words{
      {"median", "sah"},   {"portable", "auto"},       {"z:30", "z:31"},        {"float", "double"},
      {"given", "points"}, {"shuffled", "renumbered"}, {"pairs", "candidates"}, {"edges", "faces"},
      {"cloth", "ball"},   {"ball", "cloth"},          {"sides", "ball"}};
  if (free.contains(key)) return nullptr;
  if (value.is_boolean()) return !value.get<bool>();
  if (value.is_string()) return words.at(value.get<std::string>());
  if (key == "width") return 4;
  if (key == "triangles" || key == "obstacle") return 4 * value.get<int>();  // as few as their patterns allow
  if (value.is_number_integer()) return value.get<int>() == 1 && key == "body" ? 0 : value.get<int>() + 1;
  return value.get<double>() + 0.001;
}

/// Alters every leaf in turn, and expects different keys.
void expect_every_field_counts(const json& plan, const std::filesystem::path& folder = {}) {
  const std::set<std::string> usual = keys_of(plan, folder);
  ASSERT_FALSE(usual.empty());
  EXPECT_EQ(keys_of(plan, folder), usual) << "keys are not stable";
  std::size_t altered = 0;
  json root = plan;
  const std::function<void(json&, const std::string&, const std::string&)> visit =
      [&](json& at, const std::string& key, const std::string& path) {
        if (at.is_object()) {
          for (auto& [name, member] : at.items()) visit(member, name, path + "." + name);
          return;
        }
        if (at.is_array()) {
          for (std::size_t i = 0; i < at.size(); ++i) visit(at[i], key, path + "[" + std::to_string(i) + "]");
          return;
        }
        const json kept = at;
        const json changed = other(key, at);
        if (changed.is_null()) return;
        at = changed;
        ++altered;
        const std::set<std::string> keys = keys_of(root, folder);
        EXPECT_FALSE(keys.empty()) << path;
        EXPECT_NE(keys, usual) << path << ": " << kept << " and " << changed << " have the same key";
        at = kept;
      };
  visit(root, "", "");
  EXPECT_GT(altered, 0u);
}

const json strategies = json::parse(R"([{"id": "bottom_up", "params": {"kernels": "portable"},
    "builder": {"method": "median", "width": 8, "leaf_size": 4}}])");

TEST(Keys, SeeEveryFieldOfAScriptedScene) {
  expect_every_field_counts({{"scenes", json::parse(R"([{"name": "a",
      "bodies": [{"shape": "waving_sheet", "triangles": 50, "keyframes": 4, "name": "sheet", "scale": 1.5,
                  "rotate": ["z:30"], "translate": [0.1, 0.0, 0.0], "self": false, "as": "given"},
                 {"shape": "sphere", "triangles": 80, "centre": [0.0, 0.0, 0.5], "radius": 0.5}],
      "script": {"frames": 10, "rate": 20, "steps": [{"time": 0.05, "changes": [
        {"body": 1, "vertex": 0, "times": [0.06, 0.1], "positions": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
         "velocity": [0.0, 0.0, 1.0]},
        {"body": 0, "vertex": 3, "velocity": [0.0, 0.0, 1.0]}]}]}}])")},
                             {"strategies", strategies},
                             {"scalars", {"float"}},
                             {"repetitions", 2},
                             {"oracle_every", 1}});
}

TEST(Keys, SeeEveryFieldOfBodiesOfElements) {
  expect_every_field_counts({{"scenes", json::parse(R"([{"name": "a", "radius": 0.25, "self": false,
      "pairs": [["cloth", "ball"], ["sides", "sides"]],
      "bodies": [{"shape": "waving_sheet", "triangles": 50, "keyframes": 4, "self": false, "name": "cloth"},
                 {"shape": "sphere", "triangles": 80, "name": "ball"},
                 {"elements": "edges", "of": "cloth", "name": "sides"}]}])")},
                             {"strategies", strategies},
                             {"scalars", {"float"}}});
}

/// Plans that together have every key of a study that can be altered to another of its kind.
std::vector<json> plans_of_every_key() {
  std::vector<json> plans;
  plans.push_back({{"name", "n"},
                   {"description", "d"},
                   {"scenes", json::parse(R"([{"builtin": "random_soups", "triangles": 50, "obstacle": 40,
                                 "keyframes": 3, "seed": 7, "order": "shuffled", "self": false}])")},
                   {"strategies", strategies},
                   {"l", {3}},
                   {"scalars", {"float"}},
                   {"repetitions", 2},
                   {"interval_width", 0.25},
                   {"seconds", 2.0},
                   {"frames_limit", 3},
                   {"oracle_every", 1},
                   {"continuous", false}});
  plans.push_back({{"scenes", json::parse(R"([{"builtin": "random_soups", "triangles": 50,
                                 "obstacle": 40, "keyframes": 3}])")},
                   {"strategies", strategies},
                   {"changes", "pairs"},
                   {"l", {3}},
                   {"scalars", {"float"}}});
  plans.push_back({{"scenes", json::parse(R"([{"builtin": "reversing_spheres", "triangles": 80,
                                 "obstacle": 80, "keyframes": 6}])")},
                   {"strategies", strategies}});
  return plans;
}

TEST(Keys, SeeEveryFieldOfAPlan) {
  for (const json& plan : plans_of_every_key()) expect_every_field_counts(plan);
}

// A new key of plans does not stay out of these tests, nor perhaps out of the keys of results, unnoticed.
TEST(Keys, AreTestedWithEveryKeyThatAPlanMayHave) {
  const std::string told = complaint([] { read_plan({{"no such key", 1}}, "p.json", {}); });
  const std::string before = "known are ";
  std::size_t begin = told.find(before);
  ASSERT_NE(begin, std::string::npos) << told;
  begin += before.size();
  const std::set<std::string> elsewhere{
      "studies", "targets", "live",    // these do not belong to a configuration
      "params",  "builder",            // in `strategies`; SeeEveryParameterOfEveryStrategy
      "rays",    "within",  "kernels"  // tests/program/asked.py
  };
  std::set<std::string> altered;
  for (const json& plan : plans_of_every_key())
    for (const auto& [key, value] : plan.items()) altered.insert(key);
  std::istringstream known(told.substr(begin, told.find(';', begin) - begin));
  std::size_t count = 0;
  for (std::string key; std::getline(known >> std::ws, key, ','); ++count)
    EXPECT_TRUE(altered.count(key) + elsewhere.count(key) == 1)
        << "the key '" << key << "' of plans: add it to plans_of_every_key; configuration_key "
        << "(experiments/results/record.cpp) must contain it if it affects results";
  EXPECT_GT(count, 15u) << told;
}

TEST(Keys, SeeHowAFileIsPlayed) {
  const TemporaryFolder folder;
  const io::AnimatedMesh mesh = scenes::waving_sheet(50, 4);
  io::save_obj(mesh, folder / "a.obj");
  io::save_pc2(mesh, folder / "a.pc2", 30);
  expect_every_field_counts(
      {{"scenes", json::parse(R"([{"bodies": [{"file": "a.obj", "motion": "a.pc2", "fps": 25, "as": "given"},
                                              {"shape": "sphere", "triangles": 80}]}])")},
       {"strategies", strategies}},
      folder.path());
}

TEST(Keys, SeeEveryParameterOfEveryStrategy) {
  const json scene{{"name", "s"},       {"hash", "1"}, {"scalar", "float"},
                   {"per_keyframe", 1}, {"frames", 2}, {"frame_times", "3"}};
  std::set<std::string> keys;
  std::size_t configurations = 0;
  const auto add = [&](const StrategyRequest& request) {
    std::vector<std::string> notes;
    for (const ContestantSpec& spec : expand({request}, {}, {}, notes)) {
      keys.insert(configuration_key("p", scene, strategy_record(spec), Study{}, here));
      ++configurations;
    }
  };
  for (const StrategyEntry& entry : registry()) {
    add({entry.info.id, {}, {}});
    for (const Parameter& parameter : entry.info.parameters) {
      std::vector<std::string> values;
      for (const std::string& word : parameter.allowed)
        if (word != parameter.default_value) values.push_back(word);
      if (parameter.allowed.empty()) {
        const double given = std::stod(parameter.default_value);
        values.push_back(std::to_string(given + 1 <= parameter.most ? given + 1 : parameter.least));
      }
      if (!values.empty()) add({entry.info.id, {{parameter.name, values}}, {}});
    }
  }
  EXPECT_EQ(keys.size(), configurations);
}

TEST(Keys, SeeEveryNumberOfAScene) {
  LoadedScene loaded;
  loaded.name = "s";
  for (int body = 0; body < 2; ++body) {
    loaded.meshes.push_back(scenes::waving_sheet(8, 3));
    loaded.sources.push_back("x");
  }
  loaded.self = {false, false};
  std::set<std::string> keys;
  std::size_t scenes_made = 0;
  const auto add = [&] {
    const Study study;
    const std::size_t before = keys.size();
    add_keys<double>(study, loaded, here, keys);
    ++scenes_made;
    return keys.size() > before;
  };
  ASSERT_TRUE(add());
  for (std::size_t body = 0; body < 2; ++body) {
    io::AnimatedMesh& mesh = loaded.meshes[body];
    for (double& x : mesh.positions) {
      const double kept = x;
      x = std::nextafter(x, 10);
      EXPECT_TRUE(add()) << "a position";
      x = kept;
    }
    for (double& t : mesh.keyframe_times) {
      const double kept = t;
      t = std::nextafter(t, 10);
      EXPECT_TRUE(add()) << "a time";
      t = kept;
    }
    for (std::uint32_t& v : mesh.primitive_vertices) {
      const std::uint32_t kept = v;
      v = (v + 1) % mesh.vertex_count;
      EXPECT_TRUE(add()) << "a vertex of a primitive";
      v = kept;
    }
    loaded.self[body] = true;
    EXPECT_TRUE(add()) << "self";
    loaded.self[body] = false;
    const io::AnimatedMesh kept = mesh;
    mesh.primitive_offsets.erase(mesh.primitive_offsets.begin() + 1);
    EXPECT_TRUE(add()) << "where primitives begin";
    mesh = kept;
  }
  std::swap(loaded.meshes[0], loaded.meshes[1]);
  loaded.meshes[0].positions[0] += 1;
  EXPECT_TRUE(add());
  EXPECT_GT(scenes_made, 100u);
}

TEST(Keys, SeeTheMachineAndTheProgram) {
  const json scene{{"name", "s"},       {"hash", "1"}, {"scalar", "float"},
                   {"per_keyframe", 1}, {"frames", 2}, {"frame_times", "3"}};
  std::vector<std::string> notes;
  const json strategy = strategy_record(expand({{"bottom_up", {}, {}}}, {}, {}, notes).at(0));
  std::set<std::string> keys;
  std::size_t altered = 0;
  const auto add = [&](const std::string& program, const json& about, const json& who, const json& machine,
                       bool continuous = false, std::optional<Answer> changes = {}) {
    Study study;
    study.asks.continuous = continuous;
    study.asks.changes = changes;
    keys.insert(configuration_key(program, about, who, study, machine));
    ++altered;
  };
  add("p", scene, strategy, here);
  add("q", scene, strategy, here);
  add("p", scene, strategy, here, true);
  for (const Answer answer : {Answer::candidates, Answer::pairs})
    add("p", scene, strategy, here, false, answer);
  for (const auto& [name, value] : here.items()) {
    json machine = here;
    machine[name] = "another";
    add("p", scene, strategy, machine);
  }
  for (const auto& [name, value] : scene.items()) {
    json about = scene;
    about[name] = "another";
    add("p", about, strategy, here);
  }
  EXPECT_EQ(keys.size(), altered);
}

}  // namespace
}  // namespace kbvh::experiments::keys_test
