// The functions that JavaScript calls (src/engine/module.js): requests are JSON texts, answers are JSON texts
// with arrays. All state lies in the module's memory, so that a copy of this memory is a snapshot of the
// engine.

#include <emscripten/emscripten.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "analysis/lab/engine/pack.hpp"
#include "experiments/io/load.hpp"

namespace kbvh::lab {
namespace {

using nlohmann::json;

class Engine {
 public:
  json call(const std::string& name, const json& request, Answer& answer) {
    if (name == "strategies") return strategies_json();
    if (name == "counters") return counters_json();
    if (name == "open") return open(request);
    if (name == "body") return add_body(request);
    if (name == "start") return start(request);
    if (name == "advance") return advance(request.at("t").get<double>());
    if (name == "time") return time_frames(request.at("times"));
    if (name == "step") return step(request.at("until").get<double>());
    if (name == "next") return next_time();
    if (name == "log") return log(answer);
    if (name == "state") return state(request, answer);
    if (name == "plans") return change_plans(request);
    if (name == "edit") return change_geometry(request);
    if (name == "read") return read_mesh(request, answer);
    throw std::logic_error("the engine has no function '" + name + "'");
  }

 private:
  template <class T>
  static std::span<const T> array(const json& place) {
    return {reinterpret_cast<const T*>(std::uintptr_t(place.at("address").get<std::uint32_t>())),
            place.at("count").get<std::size_t>()};
  }

  json open(const json& request) {
    world_ = std::make_unique<World>(request.at("precision") == "float32" ? Precision::float32
                                                                          : Precision::float64);
    bodies_ = 0;
    return {};
  }
  json add_body(const json& request) {
    const std::string shape = request.at("shape");
    Connectivity connectivity;
    connectivity.indices = array<std::uint32_t>(request.at("indices"));
    if (!request.at("offsets").is_null()) connectivity.offsets = array<std::uint32_t>(request.at("offsets"));
    connectivity.shape = shape == "points"         ? Shape::points
                         : shape == "control_nets" ? Shape::control_nets
                                                   : Shape::polygons;
    world_->add_body(request.at("name"), connectivity, array<double>(request.at("times")),
                     array<double>(request.at("positions")));
    ++bodies_;
    return {};
  }
  json start(const json& request) {
    for (const json& pair : request.at("pairs")) world_->add_pair(pair.at(0), pair.at(1));
    world_->start(request.at("strategy"), request.at("params"), request.at("t"), request.at("topology"));
    answer_frame();
    return {{"hasEvents", world_->has_events()}};
  }

  /// Performs the events up to t one by one, to log them, and moves to t.
  json advance(double t) {
    if (world_->has_events())
      while (world_->step_event(t, step_)) log_.add(step_);
    world_->advance(t);
    answer_frame();
    return {{"events", log_.size()}};
  }
  /// Plays frames as a program does, without a log of events, and returns the milliseconds of each: update
  /// and query.
  json time_frames(const json& times) {
    using Clock = std::chrono::steady_clock;
    json milliseconds = json::array();
    for (const double t : times.get<std::vector<double>>()) {
      const Clock::time_point begin = Clock::now();
      world_->advance(t);
      world_->pairs(pairs_);
      milliseconds.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
    }
    keep_frame();
    return milliseconds;
  }
  json step(double until) {
    if (!world_->step_event(until, step_)) return {{"done", false}, {"next", next_time()}};
    log_.add(step_);
    moment_ = {std::max(world_->time(), step_.event.time), true};
    return {{"done", true}, {"next", next_time()}};
  }
  json next_time() const {
    const double next = world_->next_event_time();
    return std::isfinite(next) ? json(next) : json(nullptr);
  }
  json log(Answer& answer) {
    json packed = log_.moved_to(answer);
    log_ = {};
    return packed;
  }
  json state(const json& request, Answer& answer) const {
    Wanted wanted{request.at("positions"), request.at("nodes"),    request.at("pairs"),
                  request.at("queue"),     request.at("counters"), request.at("mostPairs"),
                  request.at("mostEvents")};
    return state_json(*world_, bodies_, moment_, wanted, pairs_, answer);
  }

  /// An edit may read positions, which count where the frame has not read them yet; so that a page that has
  /// looked at the boxes before counts the same as one that has not, all look.
  void look_before_edit() {
    WorldHierarchy tree;
    for (std::uint32_t body = 0; body < bodies_; ++body) world_->hierarchy(body, tree);
  }
  json change_plans(const json& request) {
    std::vector<WorldPlan> plans;
    for (const json& plan : request) {
      WorldPlan& made = plans.emplace_back();
      made.body = plan.at("body");
      made.vertex = plan.at("vertex");
      made.times = plan.at("times").get<std::vector<double>>();
      made.positions = plan.at("positions").get<std::vector<double>>();
      read_vector(plan, "velocity", made.velocity);
    }
    look_before_edit();
    world_->change_plans(plans);
    answer_frame();
    return {};
  }
  json change_geometry(const json& request) {
    WorldEdit edit;
    for (const json& vertex : request.at("vertices")) {
      WorldEdit::Vertex& made = edit.vertices.emplace_back();
      made.body = vertex.at("body");
      read_vector(vertex, "position", made.position);
      read_vector(vertex, "velocity", made.velocity);
    }
    for (const json& primitive : request.at("primitives"))
      edit.primitives.push_back(
          {primitive.at("body"), primitive.at("vertices").get<std::vector<std::uint32_t>>()});
    for (const json& id : request.at("removedPrimitives"))
      edit.removed_primitives.push_back({id.at("body"), id.at("id")});
    for (const json& id : request.at("removedVertices"))
      edit.removed_vertices.push_back({id.at("body"), id.at("id")});
    look_before_edit();
    world_->change_geometry(edit);
    answer_frame();
    return {};
  }
  static void read_vector(const json& object, const char* key, double (&to)[3]) {
    const auto numbers = object.at(key).get<std::vector<double>>();
    if (numbers.size() != 3)
      throw std::invalid_argument(std::string(key) + " has " + std::to_string(numbers.size()) +
                                  " numbers instead of 3");
    std::copy(numbers.begin(), numbers.end(), to);
  }

  static json read_mesh(const json& request, Answer& answer) {
    io::LoadRequest from;
    from.mesh = request.at("mesh").get<std::string>();
    from.motion = request.at("motion").get<std::string>();
    from.clip = request.at("clip").get<std::string>();
    from.frames_per_second = request.at("framesPerSecond");
    io::AnimatedMesh mesh = io::load_animated_mesh(from);
    const char* const shapes[] = {"polygons", "points", "control_nets"};
    return {{"name", mesh.name},
            {"shape", shapes[std::size_t(mesh.kind)]},
            {"vertices", mesh.vertex_count},
            {"offsets", answer.add(std::move(mesh.primitive_offsets))},
            {"indices", answer.add(std::move(mesh.primitive_vertices))},
            {"times", answer.add(std::move(mesh.keyframe_times))},
            {"positions", answer.add(std::move(mesh.positions))}};
  }

  /// Answers once at every time, for the answer costs work that the counters show.
  void answer_frame() {
    world_->pairs(pairs_);
    keep_frame();
  }
  /// Keeps the present frame, whose pairs have been asked for, as what is shown.
  void keep_frame() {
    moment_ = {world_->time(), false};
    std::sort(pairs_.begin(), pairs_.end(), [](const WorldPair& a, const WorldPair& b) {
      return std::tie(a.body_a, a.body_b, a.primitive_a, a.primitive_b) <
             std::tie(b.body_a, b.body_b, b.primitive_a, b.primitive_b);
    });
  }

  std::unique_ptr<World> world_;
  std::uint32_t bodies_ = 0;
  Moment moment_;
  std::vector<WorldPair> pairs_;
  WorldStep step_;
  PackedSteps log_;
};

Engine engine;
Answer answer;

}  // namespace
}  // namespace kbvh::lab

extern "C" {

/// Calls a function of the engine. Returns the head of the answer (Answer::head), whose JSON object has the
/// key "result" or "error".
EMSCRIPTEN_KEEPALIVE const std::uint32_t* kbvh_lab_call(const char* name, const char* request) {
  using kbvh::lab::answer;
  answer.clear();
  nlohmann::json result;
  try {
    result["result"] = kbvh::lab::engine.call(name, nlohmann::json::parse(request), answer);
  } catch (const std::exception& error) {
    answer.clear();
    result = {{"error", error.what()}};
  }
  answer.set(result);
  return answer.head();
}
}
