// The parts of the program: texts, plans, placements, parameters, contestants.
#include <gtest/gtest.h>

#include <tuple>

#include "complaint.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/text.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/plan.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::parts_test {
namespace {

using nlohmann::json;

std::string plan_complaint(const std::string& text) {
  return complaint([&] { read_plan(parse_json(text, "p.json"), "p.json", {}); });
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

TEST(Output, IsReceivedInsteadOfPrinted) {
  testing::internal::CaptureStdout();
  print("before ");
  {
    const PrintedText received;
    print("one ");
    print("two");
    EXPECT_EQ(received.text(), "one two");
  }
  print("after");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "before after");
}

// The identity of changed code is that of the file that contains it: this program, whichever program runs it.
TEST(Machine, IdentityNamesTheCommit) {
  EXPECT_EQ(program_identity().rfind(commit(), 0), 0u);
  EXPECT_EQ(program_identity() == commit(), !dirty() && commit() != "unknown");
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
  EXPECT_EQ(plan.studies[0].repetitions, 5u);
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
            "p.json: there is no key 'repetition'; known are builder, changes, continuous, description, "
            "frames_limit, interval_width, kernels, l, live, name, "
            "oracle_every, params, rays, repetitions, scalars, scenes, seconds, strategies, studies, "
            "targets, within; did you mean "
            "'repetitions'?");
  EXPECT_TRUE(contains(plan_complaint("{\n  \"scenes\": ]\n}"), "p.json: line 2, column 13"));
  EXPECT_TRUE(contains(plan_complaint("[]"), "p.json: expected an object"));
  EXPECT_TRUE(contains(plan_complaint("{}"), "p.json: scenes: is missing"));
  EXPECT_EQ(plan_complaint(R"({"scenes": "tablecloth", "changes": "contacts"})"),
            "p.json: changes: expected candidates, pairs or none, got 'contacts'");
  EXPECT_EQ(plan_complaint(R"({"scenes": "tablecloth", "changes": "pairs", "continuous": true})"),
            "p.json: changes: contacts between keyframes have none");
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

}  // namespace
}  // namespace kbvh::experiments::parts_test
