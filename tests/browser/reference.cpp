// Plays a scene of the lab natively and prints the results that the engine in the browser must reproduce:
//   kbvh_lab_reference SCENE.json STRATEGY float64|float32 [PARAMETER=VALUE ...]
// prints one JSON object: for every frame the positions, the bounds of the nodes, the pairs by the strategy
// and by brute force, and the counters; and every event with its changes.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <tuple>

#include "core/facade/world.hpp"

namespace {

using kbvh::World;
using nlohmann::json;

World world_of(const json& scene, kbvh::Precision precision) {
  World world(precision);
  for (const json& body : scene.at("bodies")) {
    const std::string shape = body.value("shape", "polygons");
    const std::uint32_t vertices = body.at("vertices");
    std::vector<std::uint32_t> indices, offsets;
    if (body.contains("indices")) indices = body.at("indices").get<std::vector<std::uint32_t>>();
    if (body.contains("offsets") && !body.at("offsets").is_null())
      offsets = body.at("offsets").get<std::vector<std::uint32_t>>();
    if (shape == "points") {
      if (indices.empty())
        for (std::uint32_t v = 0; v < vertices; ++v) indices.push_back(v);
      if (offsets.empty())
        for (std::uint32_t p = 0; p <= indices.size(); ++p) offsets.push_back(p);
    }
    std::vector<double> positions;
    for (const json& keyframe : body.at("positions"))
      for (const json& number : keyframe) positions.push_back(number);
    kbvh::Connectivity connectivity{indices, offsets};
    connectivity.shape = shape == "points"         ? kbvh::Shape::points
                         : shape == "control_nets" ? kbvh::Shape::control_nets
                                                   : kbvh::Shape::polygons;
    world.add_body(body.at("name"), connectivity, body.at("times").get<std::vector<double>>(),
                   std::span<const double>(positions));
  }
  if (scene.contains("pairs"))
    for (const json& pair : scene.at("pairs")) world.add_pair(pair.at(0), pair.at(1));
  return world;
}

/// The frame times of the program (frame_times in core/scene/scene.hpp), which callers of the façade do not
/// see.
std::vector<double> frames_of(const json& scene) {
  std::set<double> keyframes;
  for (const json& body : scene.at("bodies"))
    if (body.at("times").size() > 1)
      for (const json& t : body.at("times")) keyframes.insert(t.get<double>());
  if (keyframes.empty()) keyframes.insert(scene.at("bodies").at(0).at("times").at(0).get<double>());
  const double l = scene.value("/frames/l"_json_pointer, 10.0);
  std::vector<double> frames;
  for (auto k = keyframes.begin(); std::next(k) != keyframes.end(); ++k)
    for (double j = 0; j < l; ++j) {
      const double t = *k + (*std::next(k) - *k) * j / l;
      if (t < *std::next(k) && (frames.empty() || frames.back() < t)) frames.push_back(t);
    }
  frames.push_back(*keyframes.rbegin());
  return frames;
}

json pairs_json(World& world) {
  std::vector<kbvh::WorldPair> pairs;
  world.pairs(pairs);
  std::sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
    return std::tie(a.body_a, a.body_b, a.primitive_a, a.primitive_b) <
           std::tie(b.body_a, b.body_b, b.primitive_a, b.primitive_b);
  });
  json list = json::array();
  for (const kbvh::WorldPair& pair : pairs)
    for (const std::uint32_t id : {pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b})
      list.push_back(id);
  return list;
}

json vertex_json(std::uint32_t vertex) {
  return vertex == kbvh::world_no_vertex ? json(nullptr) : json(vertex);
}

json event_json(const kbvh::WorldEvent& event) {
  const char* const kinds[] = {"bound", "boxes_meet", "boxes_separate", "review", "window"};
  const auto piece = [&](const kbvh::WorldPiece& p) {
    if (!event.exact) return json(nullptr);
    // JSON has no infinity; JavaScript's text for it is null, too.
    return json{{"t0", p.t0},
                {"t1", std::isfinite(p.t1) ? json(p.t1) : json(nullptr)},
                {"x0", p.x0},
                {"x1", p.x1},
                {"ray", p.ray}};
  };
  return {{"kind", kinds[std::size_t(event.kind)]},
          {"body", event.body},
          {"node", event.node},
          {"side", event.side},
          {"winner", vertex_json(event.winner)},
          {"loser", vertex_json(event.loser)},
          {"otherBody", event.other_body},
          {"otherNode", event.other_node},
          {"time", event.time},
          {"error", event.error},
          {"exact", event.exact},
          {"winnerPiece", piece(event.winner_piece)},
          {"loserPiece", piece(event.loser_piece)}};
}

json step_json(const kbvh::WorldStep& step, std::size_t index) {
  json touched = json::array(), rescheduled = json::array();
  for (const kbvh::WorldBoundChange& change : step.touched)
    touched.push_back({{"body", change.body},
                       {"node", change.node},
                       {"side", change.side},
                       {"oldVertex", vertex_json(change.old_vertex)},
                       {"newVertex", vertex_json(change.new_vertex)}});
  for (const kbvh::WorldEvent& event : step.rescheduled) rescheduled.push_back(event_json(event));
  return {{"index", index},
          {"event", event_json(step.event)},
          {"touched", touched},
          {"rescheduled", rescheduled}};
}

json frame_json(World& world, World& oracle, std::uint32_t bodies) {
  json frame{{"t", world.time()}, {"pairs", pairs_json(world)}, {"oracle", pairs_json(oracle)}};
  for (const kbvh::WorldCounter& counter : world.counters())
    if (counter.name != "bytes")
      frame["counters"][counter.name] = counter.value;  // pointers have another size
  std::vector<double> positions;
  kbvh::WorldHierarchy tree;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    world.positions(body, positions);
    frame["positions"].push_back(positions);
    json bounds = json::array();
    if (world.hierarchy(body, tree))
      for (const kbvh::WorldNode& node : tree.nodes)
        for (const double* side : {node.lower, node.upper})
          for (int axis = 0; axis < 3; ++axis) bounds.push_back(side[axis]);
    frame["bounds"].push_back(std::move(bounds));
  }
  return frame;
}

json play(const json& scene, const std::string& strategy, kbvh::Precision precision,
          const std::map<std::string, std::string>& params) {
  World world = world_of(scene, precision), oracle = world_of(scene, precision);
  const std::vector<double> frames = frames_of(scene);
  world.start(strategy, params, frames[0]);
  oracle.start("brute_force", {}, frames[0]);
  const auto bodies = std::uint32_t(scene.at("bodies").size());
  json shown = json::array(), events = json::array();
  kbvh::WorldStep step;
  for (const double t : frames) {
    if (t > frames[0]) {
      while (world.has_events() && world.step_event(t, step))
        events.push_back(step_json(step, events.size()));
      world.advance(t);
      oracle.advance(t);
    }
    shown.push_back(frame_json(world, oracle, bodies));
  }
  return {{"frames", shown}, {"events", events}};
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  try {
    if (words.size() < 3 || (words[2] != "float64" && words[2] != "float32"))
      throw std::invalid_argument(
          "usage: kbvh_lab_reference SCENE.json STRATEGY float64|float32 [PARAMETER=VALUE ...]");
    std::map<std::string, std::string> params;
    for (std::size_t i = 3; i < words.size(); ++i)
      params[words[i].substr(0, words[i].find('='))] = words[i].substr(words[i].find('=') + 1);
    std::ifstream file(words[0]);
    if (!file) throw std::invalid_argument("cannot read " + words[0]);
    std::cout << play(json::parse(file), words[1],
                      words[2] == "float32" ? kbvh::Precision::float32 : kbvh::Precision::float64, params)
              << "\n";
    return std::cout.good() ? 0 : 3;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
}
