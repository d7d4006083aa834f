// Bodies of the vertices, edges and faces of other bodies, pairs of bodies by name, and scenes with a radius:
// what a plan may say, what becomes of it, and the pairs that strategies find, against all pairs of boxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "binary.hpp"
#include "complaint.hpp"
#include "core/judge/oracle.hpp"
#include "core/judge/session.hpp"
#include "core/judge/sort_pairs.hpp"
#include "experiments/scenes/scene_card.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/study/plan.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::elements_test {
namespace {

/// A sheet with its vertices and edges, of which vertices and faces, and edges, are asked for.
json sheet_with(const json& more = json::object()) {
  json scene = json::parse(R"({"name": "sheet",
      "bodies": [{"shape": "waving_sheet", "triangles": 98, "keyframes": 3, "name": "cloth"},
                 {"elements": "vertices", "of": "cloth", "name": "corners"},
                 "elements=edges,of=cloth"],
      "pairs": [["corners", "cloth"], ["cloth-edges", "cloth-edges"]]})");
  scene.update(more);
  return scene;
}

SceneSpec spec_of(const json& scene, const std::filesystem::path& folder = {}) {
  return read_scenes(scene, "p", folder).at(0);
}

std::vector<std::vector<std::uint32_t>> lists(const Primitives& primitives) {
  std::vector<std::vector<std::uint32_t>> all;
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    all.emplace_back(primitives[p].begin(), primitives[p].end());
  return all;
}

TEST(Elements, AreBodiesOverTheVerticesOfAnother) {
  const Scene<double> scene = assemble<double>(load(spec_of(sheet_with())));
  ASSERT_EQ(scene.bodies.size(), 3u);
  EXPECT_EQ(scene.bodies[1].name, "corners");
  EXPECT_EQ(scene.bodies[2].name, "cloth-edges");
  for (std::uint32_t body = 1; body < 3; ++body) {
    EXPECT_TRUE(scene.same_vertices(0, body));
    EXPECT_EQ(scene.bodies[body].plans.keyframe(1), scene.bodies[0].plans.keyframe(1)) << "one object";
    EXPECT_EQ(scene.bodies[body].primitives.kind, PrimitiveKind::polygons);
  }
  const std::uint32_t vertices = scene.bodies[0].plans.vertex_count();
  EXPECT_EQ(scene.vertex_count(), vertices);
  EXPECT_EQ(scene.bodies[1].primitives.count(), vertices);
  EXPECT_EQ(scene.bodies[1].primitives[7][0], 7u);
  // Euler's formula for a disk.
  EXPECT_EQ(scene.bodies[2].primitives.count(), vertices + scene.bodies[0].primitives.count() - 1);
  ASSERT_EQ(scene.pairs.size(), 2u);
  EXPECT_EQ(scene.pairs[0].first, 0u);
  EXPECT_EQ(scene.pairs[0].second, 1u);
  EXPECT_EQ(scene.pairs[1].first, 2u);
  EXPECT_EQ(scene.pairs[1].second, 2u);
  // Without the key, all pairs; those within bodies once, also if the pairs list them.
  json without = sheet_with();
  without.erase("pairs");
  EXPECT_EQ(assemble<float>(load(spec_of(without))).pairs.size(), 3u);
  EXPECT_EQ(assemble<float>(load(spec_of(sheet_with({{"self", true}})))).pairs.size(), 4u);
}

TEST(Elements, EdgesAreTheSidesOfPolygonsInOrder) {
  const TemporaryFolder folder;
  write_text(folder / "m.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 1 0\nf 1 2 3 4\nf 3 2 5\n");
  const json scene = json::parse(R"({"bodies": [{"file": "m.obj", "name": "m"},
      {"elements": "edges", "of": "m"}, {"elements": "faces", "of": "m"}, {"elements": "vertices", "of": "m"}]})");
  const Scene<float> made = assemble<float>(load(spec_of(scene, folder.path())));
  using Lists = std::vector<std::vector<std::uint32_t>>;
  EXPECT_EQ(lists(made.bodies[1].primitives), (Lists{{0, 1}, {1, 2}, {0, 3}, {2, 3}, {1, 4}, {2, 4}}));
  EXPECT_EQ(lists(made.bodies[2].primitives), lists(made.bodies[0].primitives));
  EXPECT_EQ(lists(made.bodies[2].primitives), (Lists{{0, 1, 2, 3}, {2, 1, 4}}));
  EXPECT_EQ(lists(made.bodies[3].primitives), (Lists{{0}, {1}, {2}, {3}, {4}}));
  write_text(folder / "points.obj", "v 0 0 0\nv 1 0 0\n");
  const json points =
      json::parse(R"({"bodies": [{"file": "points.obj", "name": "m"}, {"elements": "edges", "of": "m"}]})");
  EXPECT_TRUE(contains(complaint([&] { load(spec_of(points, folder.path())); }),
                       "p: bodies[1]: the body 'm' consists of points and has no edges"));
}

TEST(Elements, AScenesObjectIsTheSameScene) {
  std::vector<std::uint64_t> hashes;
  for (const json& more : {json::object(), json{{"radius", 0.05}}, json{{"radius", 0}}, json{{"self", true}},
                           json{{"order", "shuffled"}}, json{{"order", "renumbered"}}}) {
    const SceneSpec spec = spec_of(sheet_with(more)), again = spec_of(spec.object);
    EXPECT_EQ(again.object, spec.object);
    const std::uint64_t of_scene = hash(assemble<float>(load(spec)));
    EXPECT_EQ(hash(assemble<float>(load(again))), of_scene) << more.dump();
    EXPECT_EQ(std::count(hashes.begin(), hashes.end(), of_scene), 0) << more.dump();
    hashes.push_back(of_scene);
  }
  const json unnamed{{"builtin", "waving_sheet"}, {"triangles", 50}, {"keyframes", 2}, {"radius", 0.25}};
  EXPECT_TRUE(contains(load(spec_of(unnamed)).name, "-radius0.25"));
}

// ---- Pairs

/// Returns the pairs of primitives whose boxes are at most so far from each other, without those that have a
/// common vertex.
template <class S>
PairBuffer near_pairs(const Scene<S>& scene, double t, double distance) {
  Playback<S> playback(scene);
  playback.seek(t);
  playback.evaluate_all();
  std::vector<std::vector<Box<S>>> boxes(scene.bodies.size());
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
    for (const std::vector<std::uint32_t>& primitive : lists(scene.bodies[body].primitives)) {
      Box<S>& box = boxes[body].emplace_back();
      for (const std::uint32_t v : primitive) box.extend(playback.positions(body) + std::size_t(3) * v);
    }
  PairBuffer found;
  for (const BodyPair& bodies : scene.pairs) {
    const auto &all_a = boxes[bodies.first], &all_b = boxes[bodies.second];
    for (std::uint32_t a = 0; a < all_a.size(); ++a)
      for (std::uint32_t b = bodies.first == bodies.second ? a + 1 : 0; b < all_b.size(); ++b) {
        bool near = !scene.same_vertices(bodies.first, bodies.second) ||
                    !share_vertex(scene.bodies[bodies.first].primitives[a],
                                  scene.bodies[bodies.second].primitives[b]);
        for (int axis = 0; near && axis < 3; ++axis)
          near = double(all_b[b].lower[axis]) - double(all_a[a].upper[axis]) <= distance &&
                 double(all_a[a].lower[axis]) - double(all_b[b].upper[axis]) <= distance;
        if (near) found.push_back({bodies.first, a, bodies.second, b});
      }
  }
  sort_pairs(found);
  return found;
}

bool contains_all(const PairBuffer& all, const PairBuffer& some) {
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

template <class S>
PairBuffer brute_force(const Scene<S>& scene, double t) {
  Playback<S> playback(scene);
  playback.seek(t);
  PairBuffer found = brute_force_pairs(scene, playback);
  sort_pairs(found);
  return found;
}

template <class S>
void expect_candidates(double radius) {
  const LoadedScene loaded = load(spec_of(sheet_with({{"radius", radius}})));
  const Scene<S> scene = assemble<S>(loaded), meshes = assemble_meshes<S>(loaded);
  // Differences of coordinates are rounded in `near_pairs`, and grown boxes are a little too large.
  const double less = radius == 0 ? 0 : radius - 1e-9,
               more = radius + 400 * double(std::numeric_limits<S>::epsilon());
  const std::vector<double> frames = frame_times(scene, 2);
  ASSERT_EQ(frames.size(), 5u);
  std::size_t took_part = 0, pairs_seen = 0;
  for (const char* id :
       {"brute_force", "bottom_up", "dirty_refit", "lbvh", "drift_boxes", "interval_join", "kinetic_aabb"}) {
    const StrategyEntry& entry = find_strategy(id);
    if (!unsuitable_bodies(entry.info, scene).empty() || entry.factory<S>() == nullptr) continue;
    ++took_part;
    Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
    PairBuffer pairs;
    PhaseTimes ignored;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (f == 0)
        session.reset(frames[f]);
      else
        session.advance(frames[f], ignored);
      session.query(pairs, ignored);
      sort_pairs(pairs);
      pairs_seen += pairs.size();
      EXPECT_TRUE(contains_all(pairs, near_pairs(meshes, frames[f], less))) << id << ", radius " << radius;
      EXPECT_TRUE(contains_all(near_pairs(meshes, frames[f], more), pairs)) << id << ", radius " << radius;
    }
  }
  EXPECT_GE(took_part, 4u);
  EXPECT_GT(pairs_seen, 0u);
}

TEST(Elements, CandidatesOfAPlanAreThoseOfAllPairs) {
  for (const double radius : {0.0, 0.03, 0.2}) {
    expect_candidates<float>(radius);
    expect_candidates<double>(radius);
  }
}

TEST(Elements, ARadiusThatIsForgottenIsSeenAndSoAreIncidentPairs) {
  const double radius = 0.2;
  const LoadedScene with = load(spec_of(sheet_with({{"radius", radius}}))),
                    without = load(spec_of(sheet_with({{"radius", 0}})));
  const PairBuffer near = near_pairs(assemble_meshes<double>(with), 0, radius - 1e-9);
  EXPECT_TRUE(contains_all(brute_force(assemble<double>(with), 0), near));
  EXPECT_FALSE(contains_all(brute_force(assemble<double>(without), 0), near));
  LoadedScene apart = with;
  apart.vertices_of.clear();
  const PairBuffer all = near_pairs(assemble_meshes<double>(with), 0, radius + 1e-9);
  EXPECT_FALSE(contains_all(all, brute_force(assemble<double>(apart), 0))) << "incident pairs";
}

TEST(Elements, PairsDoNotDependOnTheOrderOfVertices) {
  const LoadedScene given = load(spec_of(sheet_with({{"radius", 0.1}}))),
                    shuffled = load(spec_of(sheet_with({{"radius", 0.1}, {"order", "shuffled"}}))),
                    renumbered = load(spec_of(sheet_with({{"radius", 0.1}, {"order", "renumbered"}})));
  EXPECT_NE(given.meshes[0].positions, shuffled.meshes[0].positions);
  EXPECT_EQ(shuffled.meshes[1].positions, shuffled.meshes[0].positions);
  const std::size_t pairs = brute_force(assemble<double>(given), 0).size();
  EXPECT_GT(pairs, 0u);
  EXPECT_EQ(brute_force(assemble<double>(shuffled), 0).size(), pairs);
  const Scene<double> by_leaves = assemble<double>(renumbered);
  EXPECT_EQ(brute_force(by_leaves, 0).size(), pairs);
  EXPECT_TRUE(by_leaves.same_vertices(0, 2));
  EXPECT_NE(lists(by_leaves.bodies[0].primitives), lists(assemble<double>(given).bodies[0].primitives));
}

// ---- The report

TEST(Elements, CardsAndPicturesAreOfTheMeshes) {
  const LoadedScene plain = load(spec_of(sheet_with())), grown = load(spec_of(sheet_with({{"radius", 0.1}})));
  const std::vector<BodyCard> cards_of_meshes = cards(plain), cards_of_boxes = cards(grown);
  ASSERT_EQ(cards_of_boxes.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(as_json(cards_of_boxes[i]), as_json(cards_of_meshes[i]));
    EXPECT_EQ(cards_of_boxes[i].vertices, plain.meshes[0].vertex_count);
  }
  EXPECT_NE(card_hash(plain), card_hash(grown));
  const TemporaryFolder folder;
  export_scene(grown, folder / "pictures", 2);
  std::size_t meshes = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder / "pictures"))
    meshes += file.path().extension() == ".obj" ? 1 : 0;
  EXPECT_EQ(meshes, 1u) << "elements lie on the mesh";
}

TEST_F(Binary, CandidatesOfElementsAreMeasuredAndKept) {
  const json plan{{"scenes", json::array({sheet_with({{"radius", 0.1}})})},
                  {"strategies", {"bottom_up", "brute_force"}},
                  {"l", 2},
                  {"repetitions", 2}};
  write_text(folder_ / "plan.json", plan.dump());
  const Outcome first = kbvh("run --plan plan.json --out out");
  EXPECT_EQ(first.code, 0) << first.err;
  const auto found = records();
  ASSERT_EQ(found.size(), 2u);
  for (const json& record : found) {
    const json& scene = record.at("scene");
    EXPECT_EQ(scene.at("radius"), 0.1);
    EXPECT_FALSE(scene.at("bodies").at(0).contains("vertices_of"));
    EXPECT_EQ(scene.at("bodies").at(2).at("vertices_of"), 0);
    EXPECT_EQ(scene.at("bodies").at(2).at("vertices"), scene.at("bodies").at(1).at("primitives"));
    EXPECT_TRUE(record.at("verified").at("holds")) << record.at("verified").dump();
    EXPECT_GT(record.at("verified").at("pairs"), 0);
    EXPECT_EQ(record.at("verified").at("pairs"), found[0].at("verified").at("pairs"));
    EXPECT_EQ(record.at("again").at("scenes").at(0).at("radius"), 0.1);
  }
  write_text(folder_ / "again.json", found[1].at("again").dump());
  EXPECT_EQ(kbvh("run --plan again.json --out out").code, 0);
  EXPECT_EQ(records().size(), 2u) << "the same key";
}

TEST_F(Binary, OptionsSayPairsOfBodiesAndARadius) {
  const std::string bodies =
      "--body waving_sheet:triangles=98,keyframes=3,name=cloth "
      "--body elements=vertices,of=cloth,name=corners --body elements=edges,of=cloth ";
  const Outcome plan =
      kbvh("run " + bodies +
           "--name sheet --pairs corners:cloth,cloth-edges:cloth-edges --radius 0.1 --print-plan");
  ASSERT_EQ(plan.code, 0) << plan.err;
  const json scene = json::parse(plan.out).at("scenes").at(0), expected = sheet_with({{"radius", 0.1}});
  EXPECT_EQ(scene.at("pairs"), expected.at("pairs"));
  EXPECT_EQ(scene.at("radius"), 0.1);
  EXPECT_EQ(hash(assemble<float>(load(spec_of(scene)))), hash(assemble<float>(load(spec_of(expected)))));
  const Outcome none = kbvh("run --scene waving_sheet --radius 0 --print-plan");
  EXPECT_EQ(json::parse(none.out).at("scenes").at(0).at("radius"), 0) << none.err;
  EXPECT_FALSE(
      json::parse(kbvh("run --scene waving_sheet --print-plan").out).at("scenes").at(0).contains("radius"));
  for (const char* pairs : {"cloth", ":cloth", "cloth:", "a:b:c"})
    EXPECT_TRUE(contains(
        kbvh("run " + bodies + "--pairs " + pairs).err,
        "--pairs: expected the names of two bodies, as in points:cloth, got '" + std::string(pairs) + "'"))
        << pairs;
  EXPECT_TRUE(contains(kbvh("run " + bodies + "--pairs cloth:ball").err, "there is no body 'ball'"));
  EXPECT_TRUE(contains(kbvh("run --scene waving_sheet --radius 0.1 --continuous").err, "one has a radius"));
}

// ---- Wrong input

std::string told(const std::string& scene) {
  return complaint([&] { read_scenes(json::parse(scene), "p", {}); });
}

TEST(Elements, WrongBodiesAreRefused) {
  const std::string cloth = R"({"shape": "waving_sheet", "triangles": 8, "name": "cloth"})";
  const auto bodies = [&](const std::string& list) { return told(R"({"bodies": [)" + list + "]}"); };
  EXPECT_TRUE(contains(bodies(cloth + R"(, {"elements": "edges", "of": "clot"})"),
                       "p: bodies[1]: of: there is no body 'clot'; known are cloth"));
  EXPECT_TRUE(contains(bodies(R"("sphere:triangles=20", {"elements": "edges", "of": "ball"})"),
                       "no body of the scene has the key name"));
  EXPECT_TRUE(contains(bodies(R"({"elements": "edges", "of": "a", "name": "a"})"),
                       "the body 'a' cannot consist of elements of itself"));
  EXPECT_TRUE(contains(
      bodies(
          R"({"elements": "edges", "of": "b", "name": "a"}, {"elements": "faces", "of": "a", "name": "b"})"),
      "p: bodies[0]: of: the body 'b' has no mesh, only the faces of 'a'"));
  EXPECT_TRUE(contains(bodies(R"({"elements": "edges", "of": "cloth"}, )" + cloth),
                       "the body 'cloth' must come before the body of its edges"));
  EXPECT_TRUE(contains(bodies(cloth + ", " + cloth + R"(, {"elements": "edges", "of": "cloth"})"),
                       "several bodies have the name 'cloth'"));
  EXPECT_TRUE(contains(bodies(cloth + R"(, {"elements": "corners", "of": "cloth"})"),
                       "elements: expected vertices, edges or faces, got 'corners'"));
  EXPECT_TRUE(contains(bodies(cloth + R"(, {"elements": "edges"})"), "of: is missing"));
  EXPECT_TRUE(contains(bodies(cloth + R"(, {"of": "cloth"})"), "elements: is missing"));
  EXPECT_TRUE(contains(bodies(cloth + R"(, {"elements": "edges", "of": "cloth", "scale": 2})"),
                       "there is no key 'scale'"));
  EXPECT_TRUE(contains(
      bodies(R"({"shape": "sphere", "as": "points", "name": "c"}, {"elements": "faces", "of": "c"})"),
      "the body 'c' is taken as points and has no faces"));
  EXPECT_EQ(body_from_text("elements=edges,of=cloth,self=true"),
            (json{{"elements", "edges"}, {"of", "cloth"}, {"self", true}}));
}

TEST(Elements, WrongPairsOfBodiesAreRefused) {
  const auto pairs = [](const std::string& list) {
    return told(R"({"bodies": ["sphere:triangles=20,name=a", "sphere:triangles=20,name=b"], "pairs": )" +
                list + "}");
  };
  for (const char* list : {R"(["a", "b"])", R"([["a"]])", R"([["a", "b", "a"]])", R"([["a", 1]])", "3"})
    EXPECT_TRUE(contains(pairs(list), "p: pairs: expected a list of two names each")) << list;
  EXPECT_TRUE(contains(pairs("[]"), "pairs: the list is empty"));
  EXPECT_TRUE(contains(pairs(R"([["a", "c"]])"), "p: pairs: there is no body 'c'; known are a, b"));
  EXPECT_TRUE(contains(pairs(R"([["a", "b"], ["b", "a"]])"), "the bodies 'a' and 'b' are a pair twice"));
  EXPECT_EQ(pairs(R"([["a", "b"], ["b", "b"]])"), "nothing was thrown");
  EXPECT_TRUE(contains(told(R"({"builtin": "tablecloth", "pairs": [["a", "b"]]})"),
                       "pairs: is for scenes with bodies"));
}

TEST(Elements, WrongRadiiAreRefused) {
  const auto radius = [](const std::string& keys) {
    return told(R"({"builtin": "waving_sheet", "triangles": 8, )" + keys + "}");
  };
  EXPECT_TRUE(contains(radius(R"("radius": -1)"), "p: radius: must not be negative, got -1"));
  EXPECT_TRUE(contains(radius(R"("radius": "wide")"), "p: radius: expected a finite number, got \"wide\""));
  EXPECT_TRUE(
      contains(radius(R"("radius": 0.1, "curves": "smooth")"), "a scene with smooth curves has none"));
  EXPECT_TRUE(contains(radius(R"("radius": 0.1, "script": [{"time": 0, "changes": [{"vertex": 0}]}])"),
                       "a scene with a script has none"));
  EXPECT_TRUE(
      contains(told(R"({"builtin": "reversing_spheres", "radius": 0.1})"), "it changes plans at run time"));
  EXPECT_TRUE(contains(
      told(R"({"bodies": ["sphere:triangles=20,step=0:0:0.1,keyframes=3,curves=smooth"], "radius": 0.1})"),
      "a scene with smooth curves has none"));
  const json thrown{{"builtin", "thrown_shards"}, {"triangles", 8}, {"keyframes", 4}, {"radius", 0.1}};
  EXPECT_TRUE(contains(complaint([&] { assemble<float>(load(spec_of(thrown))); }), "move on curves"));
  json wide = sheet_with({{"radius", 1e40}});
  EXPECT_TRUE(
      contains(complaint([&] { assemble<float>(load(spec_of(wide))); }), "sheet: the radius is 1e+40"));
  for (const char* question : {R"("continuous": true)", R"("rays": "coherent:16")", R"("within": "16:0.01")"})
    EXPECT_TRUE(contains(complaint([&] {
                           read_plan(
                               json::parse(R"({"scenes": [{"builtin": "waving_sheet", "radius": 0.1}], )" +
                                           std::string(question) + "}"),
                               "p.json", {});
                         }),
                         "p.json: scenes: one has a radius"))
        << question;
}

}  // namespace
}  // namespace kbvh::experiments::elements_test
