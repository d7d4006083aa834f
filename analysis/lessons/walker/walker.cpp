// Plays requests of the lessons through the façade. Reads a JSON array of requests from standard input and
// writes a JSON array of traces to standard output, in the same order:
//
//   request {scene, strategy, params?, topology?, precision?, l?, changes?, events?, nodes?}
//   trace   {frames: [{time, pairs, counters}], steps: [...], start: hierarchies, end: hierarchies,
//   scheduled}
//
// `scene` is the scene file of the lab. `l` is the number of frames per keyframe interval. `changes` holds
// new flight plans, each applied at the first frame at or after its `time`.

#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/facade/world.hpp"

namespace {

using kbvh::World;
using nlohmann::json;

kbvh::Shape shape_of(const std::string& word) {
  if (word == "polygons") return kbvh::Shape::polygons;
  if (word == "points") return kbvh::Shape::points;
  if (word == "control_nets") return kbvh::Shape::control_nets;
  throw std::invalid_argument("shape '" + word + "': expected polygons, points or control_nets");
}

World make_world(const json& request) {
  const std::string precision = request.value("precision", "float64");
  if (precision != "float32" && precision != "float64")
    throw std::invalid_argument("precision '" + precision + "': expected float32 or float64");
  World world(precision == "float32" ? kbvh::Precision::float32 : kbvh::Precision::float64);
  const json& scene = request.at("scene");
  for (const json& body : scene.at("bodies")) {
    const auto indices = body.at("indices").get<std::vector<std::uint32_t>>();
    const auto offsets = body.contains("offsets") && !body["offsets"].is_null()
                             ? body["offsets"].get<std::vector<std::uint32_t>>()
                             : std::vector<std::uint32_t>();
    std::vector<double> positions;
    for (const json& keyframe : body.at("positions"))
      for (const json& value : keyframe) positions.push_back(value.get<double>());
    world.add_body(body.at("name").get<std::string>(),
                   {indices, offsets, shape_of(body.value("shape", "polygons"))},
                   body.at("times").get<std::vector<double>>(), positions);
  }
  for (const json& pair : scene.value("pairs", json::array()))
    world.add_pair(pair.at(0).get<std::uint32_t>(), pair.at(1).get<std::uint32_t>());
  return world;
}

json to_json(const kbvh::WorldPiece& piece) {
  return {{"t0", piece.t0}, {"t1", piece.t1}, {"x0", piece.x0}, {"x1", piece.x1}, {"ray", piece.ray}};
}

json to_json(const kbvh::WorldEvent& event) {
  static const char* const kinds[] = {"bound", "boxes_meet", "boxes_separate", "review", "window"};
  return {{"kind", kinds[std::size_t(event.kind)]},
          {"body", event.body},
          {"node", event.node},
          {"side", event.side},
          {"winner", event.winner},
          {"loser", event.loser},
          {"otherBody", event.other_body},
          {"otherNode", event.other_node},
          {"time", event.time},
          {"error", event.error},
          {"exact", event.exact},
          {"winnerPiece", to_json(event.winner_piece)},
          {"loserPiece", to_json(event.loser_piece)}};
}

json to_json(const kbvh::WorldStep& step, std::size_t index) {
  json touched = json::array(), rescheduled = json::array();
  for (const kbvh::WorldBoundChange& change : step.touched)
    touched.push_back({{"body", change.body},
                       {"node", change.node},
                       {"side", change.side},
                       {"oldVertex", change.old_vertex},
                       {"newVertex", change.new_vertex}});
  for (const kbvh::WorldEvent& event : step.rescheduled) rescheduled.push_back(to_json(event));
  return {{"index", index},
          {"event", to_json(step.event)},
          {"touched", std::move(touched)},
          {"rescheduled", std::move(rescheduled)}};
}

json hierarchies(const World& world, std::size_t bodies) {
  json result = json::array();
  for (std::uint32_t body = 0; body < bodies; ++body) {
    kbvh::WorldHierarchy hierarchy;
    if (!world.hierarchy(body, hierarchy)) {
      result.push_back(nullptr);
      continue;
    }
    json nodes = json::array();
    for (const kbvh::WorldNode& node : hierarchy.nodes)
      nodes.push_back({{"parent", node.parent},
                       {"first", node.first},
                       {"count", node.count},
                       {"leaf", node.leaf},
                       {"stale", node.stale},
                       {"lower", node.lower},
                       {"upper", node.upper}});
    result.push_back({{"nodes", std::move(nodes)}, {"primitives", hierarchy.primitives}});
  }
  return result;
}

json counters(const World& world) {
  json result = json::object();
  for (const kbvh::WorldCounter& counter : world.counters()) result[counter.name] = counter.value;
  return result;
}

std::map<std::string, std::string> words(const json& object) {
  std::map<std::string, std::string> result;
  for (const auto& [key, value] : object.items())
    result[key] = value.is_string() ? value.get<std::string>() : value.dump();
  return result;
}

json play(const json& request) {
  World world = make_world(request);
  const json& scene = request.at("scene");
  const std::size_t bodies = scene.at("bodies").size();
  const auto l = request.value("l", std::uint32_t(1));
  if (l < 1 || l > 10000)
    throw std::invalid_argument("l = " + std::to_string(l) +
                                ": expected 1 to 10000 frames per keyframe interval");
  const std::vector<double> frames = world.frame_times(l);
  world.start(request.at("strategy").get<std::string>(), words(request.value("params", json::object())),
              frames.front(), words(request.value("topology", json::object())));
  json trace = {{"frames", json::array()}, {"steps", json::array()}};
  std::vector<kbvh::WorldEvent> queue;
  if (world.has_events()) world.scheduled_events(queue);
  trace["scheduled"] = json::array();
  for (const kbvh::WorldEvent& event : queue) trace["scheduled"].push_back(to_json(event));
  std::vector<kbvh::WorldPair> pairs;
  json changes = request.value("changes", json::array());
  kbvh::WorldStep step;
  for (const double t : frames) {
    if (t > frames.front()) {
      while (world.has_events() && world.step_event(t, step))
        trace["steps"].push_back(to_json(step, trace["steps"].size()));
      world.advance(t);
      std::vector<kbvh::WorldPlan> plans;
      for (json& change : changes)
        if (!change.is_null() && change.at("time").get<double>() <= t) {
          kbvh::WorldPlan plan;
          plan.body = change.at("body");
          plan.vertex = change.at("vertex");
          for (int axis = 0; axis < 3; ++axis) plan.velocity[axis] = change.at("velocity").at(axis);
          plans.push_back(plan);
          change = nullptr;
        }
      if (!plans.empty()) world.change_plans(plans);
    }
    world.pairs(pairs);
    json listed = json::array();
    for (const kbvh::WorldPair& pair : pairs)
      listed.push_back({pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b});
    trace["frames"].push_back({{"time", t}, {"pairs", std::move(listed)}, {"counters", counters(world)}});
    if (t == frames.front()) trace["start"] = hierarchies(world, bodies);
    if (request.value("nodes", false)) trace["frames"].back()["hierarchies"] = hierarchies(world, bodies);
  }
  trace["end"] = hierarchies(world, bodies);
  trace["hasEvents"] = world.has_events();
  return trace;
}

}  // namespace

int main() try {
  const json requests = json::parse(std::cin);
  json traces = json::array();
  for (std::size_t i = 0; i < requests.size(); ++i) {
    try {
      traces.push_back(play(requests[i]));
    } catch (const std::exception& error) {
      throw std::runtime_error("request " + std::to_string(i) + ": " + error.what());
    }
  }
  std::cout << traces.dump() << "\n";
} catch (const std::exception& error) {
  std::fprintf(stderr, "kbvh_lesson_walker: %s\n", error.what());
  return 1;
}
