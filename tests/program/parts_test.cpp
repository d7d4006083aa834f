// The parts of the program: plans, parameters, placements, result files, keys, tables.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <tuple>

#include "experiments/common/json_reader.hpp"
#include "experiments/common/text.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/results.hpp"
#include "experiments/results/table.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/measure.hpp"
#include "experiments/study/plan.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments {
namespace {

using nlohmann::json;

template <class Error = io::InputError>
std::string complaint(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& problem) {
    return problem.what();
  }
  return "nothing was thrown";
}

std::string plan_complaint(const std::string& text) {
  return complaint([&] { read_plan(parse_json(text, "p.json"), "p.json", {}); });
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not contain '" << part << "'";
}

// --- text ---------------------------------------------------------------------------------------------

TEST(Text, Assignments) {
  const auto assignment = parse_assignment("queue=a=b");
  ASSERT_TRUE(assignment);
  EXPECT_EQ(assignment->first, "queue");
  EXPECT_EQ(assignment->second, "a=b");
  EXPECT_EQ(parse_assignment("key=")->second, "");
  EXPECT_FALSE(parse_assignment("no assignment"));
  EXPECT_FALSE(parse_assignment("=value"));
}

TEST(Text, Counts) {
  for (const auto& [count, noun, text] :
       std::vector<std::tuple<std::uint64_t, std::string, std::string>>{{0, "frame", "0 frames"},
                                                                        {1, "frame", "1 frame"},
                                                                        {1, "query", "1 query"},
                                                                        {2, "query", "2 queries"},
                                                                        {3, "body", "3 bodies"},
                                                                        {2, "key", "2 keys"},
                                                                        {1, "vertex", "1 vertex"},
                                                                        {4, "vertex", "4 vertices"},
                                                                        {2, "mesh", "2 meshes"},
                                                                        {2, "box", "2 boxes"},
                                                                        {2, "control net", "2 control nets"}})
    EXPECT_EQ(counted(count, noun), text);
}

TEST(Text, UnknownNames) {
  EXPECT_EQ(no_such("scene", "shrit", {"shirt", "dress"}),
            "there is no scene 'shrit'; known are shirt, dress; did you mean 'shirt'?");
  EXPECT_EQ(no_such("scene", "cloth", {"shirt", "dress"}),
            "there is no scene 'cloth'; known are shirt, dress");
  const std::vector<std::string> many(30, "long_name");
  EXPECT_EQ(no_such("scene", "cloth", many, "`x` shows them"), "there is no scene 'cloth'; `x` shows them");
  EXPECT_EQ(no_such("scene", "long_nam", many, "`x` shows them"),
            "there is no scene 'long_nam'; did you mean 'long_name'?");
}

TEST(Text, NearestNames) {
  const std::vector<std::string> known{"bottom_up", "bottom_up_budget", "top_down", "sphere",
                                       "uv_sphere", "interval_join",    "l"};
  for (const auto& [word, meant] :
       std::vector<std::pair<std::string, std::string>>{{"botom_up", "bottom_up"},
                                                        {"bottom-up", "bottom_up"},
                                                        {"Bottom_Up", "bottom_up"},
                                                        {"topdown", "top_down"},
                                                        {"shpere", "sphere"},
                                                        {"spere", "sphere"},
                                                        {"bottom_up", "bottom_up"},
                                                        {"interval", "interval_join"},
                                                        {"L", "l"}})
    EXPECT_EQ(nearest_of(word, known).value_or("nothing"), meant) << word;
  for (const char* word : {"", "x", "cloth", "bo", "rebuild", "/tmp/mesh.obj"})
    EXPECT_FALSE(nearest_of(word, known)) << word << ": " << *nearest_of(word, known);
  EXPECT_FALSE(nearest_of(std::string(100000, 'a'), {std::string(100000, 'a')}));
  EXPECT_EQ(suggestion("shpere", known), "; did you mean 'sphere'?");
  EXPECT_EQ(suggestion("cloth", known), "");
}

TEST(Text, Numbers) {
  EXPECT_EQ(parse_number("-1.5e3"), -1500);
  for (const char* wrong : {"", "1 ", " 1", "1x", "nan", "inf", "1e999", "0x10"})
    EXPECT_FALSE(parse_number(wrong)) << wrong;
  EXPECT_EQ(parse_whole("18446744073709551615"), ~std::uint64_t(0));
  for (const char* wrong : {"", "-1", "1.0", "18446744073709551616"})
    EXPECT_FALSE(parse_whole(wrong)) << wrong;
}

TEST(Text, Split) {
  EXPECT_EQ(split("a,,b", ','), (std::vector<std::string>{"a", "", "b"}));
  EXPECT_EQ(split("", ','), std::vector<std::string>{""});
}

// --- plans --------------------------------------------------------------------------------------------

TEST(Plan, DefaultsAndSweeps) {
  const Plan plan = read_plan(parse_json(R"({"scenes": ["tablecloth",
      {"builtin": "random_soups", "triangles": [100, 200], "seed": [1, 2], "order": ["given", "shuffled"]}]})",
                                         "p.json"),
                              "p.json", {});
  ASSERT_EQ(plan.studies.size(), 1u);
  EXPECT_EQ(plan.studies[0].scenes.size(), 9u);
  EXPECT_EQ(plan.studies[0].strategies[0].id, "default");
  EXPECT_EQ(plan.studies[0].repetitions, 3u);
}

TEST(Plan, StudiesInheritAndOverride) {
  const Plan plan = read_plan(parse_json(R"({"scenes": "tablecloth", "l": [1, 10], "repetitions": 5,
      "studies": [{"l": 30}, {"name": "two", "scalars": "double", "strategies": [{"id": "x",
      "params": {"a": [1, "b"]}, "builder": {"width": [2, 8], "method": "sah"}}]}]})",
                                         "p.json"),
                              "p.json", {});
  ASSERT_EQ(plan.studies.size(), 2u);
  EXPECT_EQ(plan.studies[0].per_keyframe, std::vector<std::uint32_t>{30});
  EXPECT_EQ(plan.studies[1].per_keyframe, (std::vector<std::uint32_t>{1, 10}));
  EXPECT_EQ(plan.studies[1].repetitions, 5u);
  EXPECT_EQ(plan.studies[1].scalars, std::vector<std::string>{"double"});
  const StrategyRequest& request = plan.studies[1].strategies.at(0);
  EXPECT_EQ(request.params.at("a"), (std::vector<std::string>{"1", "b"}));
  EXPECT_EQ(request.builder.widths, (std::vector<std::uint32_t>{2, 8}));
  EXPECT_EQ(request.builder.methods, std::vector<BuildMethod>{BuildMethod::sah});
}

TEST(Plan, WhatIsGivenTwiceIsMeasuredOnce) {
  const Plan plan = read_plan(parse_json(R"({"l": [2, 10, 2], "scalars": ["float", "double", "float"],
      "scenes": ["tablecloth", "tablecloth", {"builtin": "random_soups", "triangles": [100, 100], "seed": [1, 2, 1],
                 "order": ["given", "given"]}],
      "strategies": ["bottom_up", "bottom_up"],
      "builder": {"width": [8, 8], "leaf_size": [4, 1, 4], "method": ["sah", "sah"]},
      "params": {"threads": [1, 1.0, "1"]}})",
                                         "p.json"),
                              "p.json", {});
  const Study& study = plan.studies[0];
  EXPECT_EQ(study.per_keyframe, (std::vector<std::uint32_t>{2, 10}));
  EXPECT_EQ(study.scalars, (std::vector<std::string>{"float", "double"}));
  EXPECT_EQ(study.scenes.size(), 3u);
  std::vector<std::string> notes;
  EXPECT_EQ(expand(study.strategies, study.params, study.builder, notes).size(), 2u);
}

TEST(Plan, ErrorsNameFileKeyAndValue) {
  EXPECT_EQ(plan_complaint(R"({"scenes": "tablecloth", "repetition": 3})"),
            "p.json: there is no key 'repetition'; known are builder, continuous, description, frames_limit, "
            "l, name, "
            "oracle_every, params, repetitions, scalars, scenes, strategies, studies, targets; did you mean "
            "'repetitions'?");
  EXPECT_TRUE(contains(plan_complaint("{\n  \"scenes\": ]\n}"), "p.json: line 2, column 13"));
  EXPECT_TRUE(contains(plan_complaint("[]"), "p.json: expected an object"));
  EXPECT_TRUE(contains(plan_complaint("{}"), "p.json: scenes: is missing"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": []})"), "p.json: scenes: the list is empty"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": "nowhere"})"),
                       "p.json: scenes[0]: there is no built-in scene 'nowhere'; known are tablecloth"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": [{"builtin": "tablecloth", "size": 3}]})"),
                       "p.json: scenes[0]: there is no key 'size'"));
  for (const char* l : {"0", "-1", "1.5", "\"1\"", "[1, 0]", "1e99"})
    EXPECT_TRUE(contains(plan_complaint(std::string(R"({"scenes": "tablecloth", "l": )") + l + "}"),
                         "p.json: l: expected a whole number from 1 to 1000000, got "))
        << l;
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": "tablecloth", "scalars": ["half"]})"), "got 'half'"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": "tablecloth", "builder": {"method": "magic"}})"),
                       "p.json: builder: method: "));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": "tablecloth", "strategies": [{"params": {}}]})"),
                       "p.json: strategies[0]: id: is missing"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": "tablecloth", "studies": [{"ll": 1}]})"),
                       "p.json: studies[0]: there is no key 'll'"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": [{"bodies": ["sphere:diameter=3"]}]})"),
                       "p.json: scenes[0]: bodies[0]: there is no key 'diameter'"));
  EXPECT_TRUE(contains(plan_complaint(R"({"scenes": [{"bodies": [{"file": "a.obj", "shape": "box"}]}]})"),
                       "a body has either a file or a shape"));
}

TEST(Plan, FilesStartAtThePlan) {
  const auto file = [](const std::string& name) {
    const Plan plan = read_plan({{"scenes", {{{"bodies", {{{"file", name}}}}}}}}, "p.json", "/plans");
    return plan.studies[0].scenes[0].bodies[0].file.string();
  };
  EXPECT_EQ(file("a.obj"), "/plans/a.obj");
  EXPECT_EQ(file("/b/a.obj"), "/b/a.obj");
  EXPECT_TRUE(file("data:x/a.obj").ends_with("/x/a.obj"));
}

TEST(Plan, ShippedPlansAreReadable) {
  std::size_t plans = 0;
  for (const auto& entry : std::filesystem::directory_iterator(KBVH_PLANS)) {
    if (entry.path().extension() != ".json") continue;
    EXPECT_NO_THROW(load_plan(entry.path())) << entry.path();
    ++plans;
  }
  EXPECT_GT(plans, 0u);
}

// --- bodies -------------------------------------------------------------------------------------------

TEST(Body, FromText) {
  EXPECT_EQ(body_from_text(
                "cloth.obj,motion=c.pc2,fps=25,translate=1:-2:3e-1,rotate=z:90,rotate=x:45,scale=2,name=a"),
            (json{{"file", "cloth.obj"},
                  {"motion", "c.pc2"},
                  {"fps", 25.0},
                  {"translate", {1.0, -2.0, 0.3}},
                  {"rotate", {"z:90", "x:45"}},
                  {"scale", 2.0},
                  {"name", "a"}}));
  EXPECT_EQ(body_from_text("sphere:triangles=20,centre=0:0:1"),
            (json{{"shape", "sphere"}, {"triangles", 20u}, {"centre", {0.0, 0.0, 1.0}}}));
  EXPECT_EQ(body_from_text("box"), (json{{"shape", "box"}}));
  EXPECT_EQ(body_from_text("./sphere"), (json{{"file", "./sphere"}}));
  EXPECT_TRUE(contains(complaint([] { body_from_text("a.obj,scale"); }), "expected key=value, got 'scale'"));
  EXPECT_TRUE(
      contains(complaint([] { body_from_text("a.obj,translate=1:2"); }), "expected x:y:z, got '1:2'"));
  EXPECT_TRUE(contains(complaint([] { body_from_text("a.obj,fps=1,fps=2"); }), "fps: is given twice"));
  EXPECT_TRUE(contains(complaint([] { body_from_text(""); }), "begin with a file or a shape"));
}

io::AnimatedMesh one_triangle() {
  io::AnimatedMesh mesh;
  mesh.name = "triangle";
  mesh.vertex_count = 3;
  mesh.primitive_offsets = {0, 3};
  mesh.primitive_vertices = {0, 1, 2};
  mesh.keyframe_times = {0, 1};
  mesh.positions = {1, 0, 0, 0, 2, 0, 0, 0, 3, /* later */ 1, 0, 1, 0, 2, 1, 0, 0, 4};
  return mesh;
}

TEST(Body, PlacementScalesTurnsThenMoves) {
  io::AnimatedMesh mesh = one_triangle();
  Placement placement;
  placement.scale = 2;
  placement.rotations = {{{0, 0, 1}, 90}, {{1, 0, 0}, 90}};
  placement.translate[0] = 10;
  place(mesh, placement);
  // x -> y -> z, y -> -x -> -x, z -> z -> -y; right angles are exact.
  const std::vector<double> expected{10, 0, 2, 6, 0, 0, 10, -6, 0, 10, -2, 2, 6, -2, 0, 10, -8, 0};
  ASSERT_EQ(mesh.positions.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(mesh.positions[i], expected[i]) << i;
}

TEST(Body, ShufflingKeepsTheGeometry) {
  const io::AnimatedMesh before = one_triangle();
  bool changed = false;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    io::AnimatedMesh after = one_triangle();
    shuffle_vertices(after, seed);
    changed |= after.primitive_vertices != before.primitive_vertices;
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t corner = 0; corner < 3; ++corner)
        for (std::size_t d = 0; d < 3; ++d)
          EXPECT_EQ(after.positions[9 * k + 3 * after.primitive_vertices[corner] + d],
                    before.positions[9 * k + 3 * before.primitive_vertices[corner] + d]);
  }
  EXPECT_TRUE(changed);
}

TEST(Scene, CoordinatesThatDoNotFitNameTheBody) {
  LoadedScene loaded;
  loaded.meshes = {one_triangle()};
  loaded.sources = {"wide.obj"};
  loaded.meshes[0].positions[4] = 1e300;
  const std::string text = complaint([&] { assemble<float>(loaded); });
  EXPECT_TRUE(contains(text, "wide.obj: body 'triangle' as float"));
}

TEST(Scene, PairsNeedSomethingThatMoves) {
  LoadedScene loaded;
  loaded.meshes = {one_triangle(), one_triangle(), one_triangle()};
  loaded.sources = {"a", "b", "c"};
  for (std::size_t i : {1u, 2u}) {
    loaded.meshes[i].keyframe_times = {0};
    loaded.meshes[i].positions.resize(9);
  }
  EXPECT_EQ(assemble<double>(loaded).pairs.size(), 2u);
}

// --- contestants --------------------------------------------------------------------------------------

TEST(Contestants, SweepsAndLabels) {
  std::vector<std::string> notes;
  BuilderRequest builder;
  builder.leaf_sizes = {1, 4};
  builder.widths = {2};
  const auto list = expand({{"bottom_up", {}, {}}, {"bottom_up", {}, {}}}, {}, builder, notes);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_NE(list[0].label, list[1].label);
  EXPECT_EQ(list[0].builder.leaf_size, 1u);
}

TEST(Contestants, WrongUseIsRefused) {
  std::vector<std::string> notes;
  const auto refused = [&](const std::string& id, const Sweep& params, const BuilderRequest& builder) {
    return complaint<ConfigError>([&] { expand({{id, {}, {}}}, params, builder, notes); });
  };
  EXPECT_TRUE(contains(refused("bottom_upp", {}, {}),
                       "there is no strategy 'bottom_upp'; did you mean 'bottom_up'?"));
  EXPECT_TRUE(contains(refused("family:none", {}, {}), "there is no family of strategies 'none'"));
  EXPECT_TRUE(contains(refused("bottom_up", {{"speed", {"1"}}}, {}), "'speed' belongs to none"));
  EXPECT_TRUE(contains(refused("bottom_up", {{"rebuild.x", {"1"}}}, {}), "'rebuild.x' belongs to none"));
  EXPECT_TRUE(contains(refused("bottom_up_period", {}, {{}, {8}, {}}), "nodes of width 8"));
}

TEST(Contestants, ExclusionsTakeOut) {
  std::vector<std::string> notes;
  const auto list =
      expand({{"!family:refit", {}, {}}, {"all", {}, {}}, {"!brute_force", {}, {}}}, {}, {}, notes);
  EXPECT_FALSE(list.empty());
  for (const ContestantSpec& spec : list) {
    EXPECT_NE(spec.entry->info.family, "refit");
    EXPECT_NE(spec.entry->info.id, "brute_force");
  }
  EXPECT_THROW(expand({{"bottom_up", {}, {}}, {"!bottom_up", {}, {}}}, {}, {}, notes), ConfigError);
}

TEST(Contestants, EveryRegisteredStrategyHasADefaultConfiguration) {
  std::vector<std::string> notes;
  EXPECT_EQ(expand({{"all", {}, {}}}, {}, {}, notes).size(), registry().size());
  EXPECT_TRUE(notes.empty());
}

// --- results ------------------------------------------------------------------------------------------

TEST(Results, ResumeAfterATruncatedLine) {
  const TemporaryFolder folder;
  const auto out = folder / "deep/er";
  {
    ResultStore store(out);
    EXPECT_EQ(store.records(), 0u);
    store.append({{"key", "a"}, {"value", 1}});
    store.append({{"key", "b"}, {"value", 2}});
    ASSERT_NE(store.find("a"), nullptr);
  }
  const std::string whole = text_of_file(out / "results.jsonl");
  for (std::size_t cut = 1; cut < 10; ++cut) {
    write_text(out / "results.jsonl", whole.substr(0, whole.size() - cut));
    ResultStore store(out);
    EXPECT_NE(store.find("a"), nullptr);
    // Without its newline the last line is still whole; with less it is not.
    EXPECT_EQ(store.find("b") != nullptr, cut == 1) << cut;
    EXPECT_EQ(store.unreadable_lines(), cut == 1 ? 0u : 1u);
    store.append({{"key", "c"}});
    ResultStore again(out);
    EXPECT_NE(again.find("c"), nullptr);
    EXPECT_NE(again.find("a"), nullptr);
    EXPECT_EQ(again.unreadable_lines(), cut == 1 ? 0u : 1u);
  }
}

TEST(Results, NewestOfAKeyCountsAndNothingIsLost) {
  const TemporaryFolder folder;
  ResultStore store(folder.path());
  store.append({{"key", "a"}, {"value", 1}});
  store.append({{"key", "a"}, {"value", 2}});
  ResultStore again(folder.path());
  EXPECT_EQ(again.find("a")->at("value"), 2);
  EXPECT_EQ(again.records(), 2u);
}

TEST(Results, NestingWithoutEndIsNoRecord) {
  const TemporaryFolder folder;
  const std::string open(300000, '['), close(300000, ']');
  write_text(folder / "results.jsonl", open + "\n" + open + close + "\n{\"key\": \"a\", \"x\": " + open +
                                           close + "}\n{\"key\": \"b\", \"x\": \"[[\\\"[\"}\n");
  ResultStore store(folder.path());
  EXPECT_EQ(store.unreadable_lines(), 3u);
  EXPECT_NE(store.find("b"), nullptr);
  EXPECT_FALSE(json_or_nothing(std::string(100, '[') + std::string(100, ']')).is_discarded());
  EXPECT_TRUE(json_or_nothing(std::string(101, '[') + std::string(101, ']')).is_discarded());
}

TEST(Results, AFolderThatCannotBeMade) {
  const TemporaryFolder folder;
  write_text(folder / "file", "x");
  EXPECT_TRUE(contains(complaint([&] { ResultStore store(folder / "file/out"); }), "cannot be made"));
}

json example_scene() {
  return {{"hash", "1"}, {"scalar", "float"}, {"per_keyframe", 10}, {"frames", 591}, {"frame_times", "2"}};
}
json example_strategy() {
  return {{"id", "x"}, {"params", {{"queue", "avl"}}}, {"builder", {{"width", 2}}}, {"title", "X"}};
}
const json example_machine{{"cpu", "c"},       {"compiler", "g"}, {"flags", "-O2"}, {"build_type", "Release"},
                           {"kernels", "sse"}, {"os", "d"}};

TEST(Results, KeysAreStableAndSeeWhatMatters) {
  const Study study;
  const auto key = [&](const json& scene, const json& strategy) {
    return configuration_key(Harness::rounds, "abc", scene, strategy, study, example_machine);
  };
  const std::string usual = key(example_scene(), example_strategy());
  // Pinned: a change of this value makes every stored result be measured again.
  EXPECT_EQ(usual, "369dfdff041a777b");
  json scene = example_scene(), strategy = example_strategy();
  strategy["title"] = "another title";
  EXPECT_EQ(key(scene, strategy), usual);
  // A table and a report are of scenes by name: what was measured under another one is not in them.
  scene["name"] = "another name";
  EXPECT_NE(key(scene, example_strategy()), usual);
  scene = example_scene();
  scene["hash"] = "2";
  EXPECT_NE(key(scene, example_strategy()), usual);
  strategy["params"]["queue"] = "binary_heap";
  EXPECT_NE(key(example_scene(), strategy), usual);
  Study more = study;
  more.repetitions = 4;
  EXPECT_NE(
      configuration_key(Harness::rounds, "abc", example_scene(), example_strategy(), more, example_machine),
      usual);
  json other_kernels = example_machine;
  other_kernels["kernels"] = "portable";
  EXPECT_NE(
      configuration_key(Harness::rounds, "abc", example_scene(), example_strategy(), study, other_kernels),
      usual);
  EXPECT_NE(
      configuration_key(Harness::rounds, "abd", example_scene(), example_strategy(), study, example_machine),
      usual);
  EXPECT_NE(configuration_key(Harness::google_benchmark, "abc", example_scene(), example_strategy(), study,
                              example_machine),
            usual);
}

// --- times and tables ---------------------------------------------------------------------------------

TEST(Times, QuantilesAreOfTheMedianRepetition) {
  Measured measured;
  for (const double scale : {3.0, 1.0, 2.0}) {
    ClipTimes clip;
    for (int frame = 1; frame <= 100; ++frame) clip.frames.push_back({5, scale * frame * 1e-3, 0, 0, 0});
    measured.repetitions.push_back(clip);
  }
  const json record = times_record(measured);
  EXPECT_DOUBLE_EQ(record.at("total_p50"), 100);
  EXPECT_DOUBLE_EQ(record.at("total_p99"), 198);
  EXPECT_DOUBLE_EQ(record.at("total_worst"), 200);
  EXPECT_EQ(record.at("repetitions").size(), 3u);
  EXPECT_DOUBLE_EQ(record.at("repetitions")[0].at("update"), 151.5);
}

TEST(Times, MeansHaveEveryPhase) {
  ClipTimes clip;
  clip.frames = {{1, 2, 3, 4, 5, 6}, {3, 4, 5, 6, 7, 8}};
  const PhaseTimes mean = clip.mean();
  EXPECT_EQ(mean.motion, 2);
  EXPECT_EQ(mean.update, 3);
  EXPECT_EQ(mean.traversal, 4);
  EXPECT_EQ(mean.triangle_tests, 5);
  EXPECT_EQ(mean.plan_changes, 6);
  EXPECT_EQ(mean.geometry_changes, 7);
  EXPECT_DOUBLE_EQ(2 * mean.total(), clip.total());
  Measured measured;
  measured.repetitions = {clip};
  EXPECT_DOUBLE_EQ(times_record(measured).at("repetitions")[0].at("geometry_changes"), 7e3);
}

json example_record(const std::string& id, const std::string& family, double update) {
  json repetitions = json::array();
  for (const double factor : {1.0, 3.0, 2.0})
    repetitions.push_back({{"motion", 1.0},
                           {"update", factor * update},
                           {"traversal", 0.0},
                           {"triangle_tests", 0.0},
                           {"plan_changes", 0.0}});
  return {
      {"run", "r"},
      {"scene", {{"name", "s"}, {"per_keyframe", 10}, {"scalar", "float"}, {"frames", 5}, {"primitives", 7}}},
      {"strategy", {{"id", id}, {"label", id}, {"family", family}}},
      {"verified",
       {{"missed", 0}, {"extra", 1}, {"audited", true}, {"protrusion", 0.0}, {"looseness", 0.25}}},
      {"times", {{"repetitions", repetitions}}}};
}

TEST(Table, RatiosAreAgainstTheBestRefit) {
  json broken = example_record("wrong", "refit", 0.01);
  broken["times"] = nullptr;
  broken["refused"] = "it is wrong";
  const std::vector<json> records{example_record("slow", "refit", 8), example_record("fast", "refit", 4),
                                  example_record("own", "kinetic", 2), broken};
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_EQ(results_table(records),
            "s, l = 10, float: 5 frames, 7 primitives\n"
            "strategy   motion  update  query  x refit  with motion  missed  extra  protrusion  looseness\n"
            "slow            1      16      0      0.5        0.529       0      1           0       0.25\n"
            "fast            1       8      0        1            1       0      1           0       0.25\n"
            "own             1       4      0        2          1.8       0      1           0       0.25\n"
            "wrong     refused                                            0      1           0       0.25\n"
            "  wrong is refused a time: it is wrong\n");
}

// A refit of one's own is shown in the table, and no ratio is against it unless it is declared a baseline.
TEST(Table, OnlyDeclaredBaselinesAreTheDenominator) {
  std::vector<json> records{example_record("mine", "refit", 1), example_record("bottom_up", "refit", 4),
                            example_record("new", "other", 2)};
  records[0]["strategy"]["baseline"] = false;
  records[1]["strategy"]["baseline"] = true;
  records[2]["strategy"]["baseline"] = false;
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_NE(results_table(records).find("\nmine            1       2      0        4"), std::string::npos)
      << results_table(records);
  records[2]["strategy"]["baseline"] = true;
  EXPECT_EQ(best_refit(records), &records[2]);
}

TEST(Table, CountersOfAStrategysOwnAreShown) {
  std::vector<json> records{example_record("mine", "refit", 1)};
  records[0]["counters"] = {{"box_tests", 5}, {"restarts", 7}, {"never", 0}};
  EXPECT_NE(results_table(records).find("  mine counted restarts 7\n"), std::string::npos)
      << results_table(records);
}

TEST(Table, ColumnsCountCharacters) {
  EXPECT_EQ(columns({{"ä", "b"}, {"long", "2"}}), "ä     b\nlong  2\n");
}

}  // namespace
}  // namespace kbvh::experiments
