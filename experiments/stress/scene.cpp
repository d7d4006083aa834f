#include "experiments/stress/scene.hpp"

#include <algorithm>
#include <cmath>

#include "core/judge/range_watch.hpp"
#include "core/judge/session.hpp"
#include "core/scene/cut_polygons.hpp"
#include "experiments/common/json_reader.hpp"

namespace kbvh::experiments::stress {

using nlohmann::json;

std::size_t StressScene::triangles() const {
  std::size_t count = 0;
  for (const StressBody& body : bodies) count += body.primitives.size();
  return count;
}

std::size_t StressScene::vertices() const {
  std::size_t count = 0;
  for (const StressBody& body : bodies) count += body.vertex_count;
  return count;
}

std::size_t StressScene::keyframes() const {
  std::size_t most = 0;
  for (const StressBody& body : bodies) most = std::max(most, body.times.size());
  return most;
}

std::size_t StressScene::size() const {
  const auto cost = [](double value) -> std::size_t { return value == 0 ? 0 : value == 1 ? 1 : 2; };
  std::size_t total = bodies.size() + frames.size() + steps.size();
  for (const StressBody& body : bodies) {
    total += body.vertex_count + body.times.size();
    for (const auto& primitive : body.primitives) total += primitive.size();
    for (const double value : body.positions) total += cost(value);
  }
  for (const Step& step : steps)
    for (const auto& change : step.changes) {
      total += 1 + change.times.size();
      for (const double value : change.positions) total += cost(value);
      for (const double value : change.velocity) total += cost(value);
    }
  return total;
}

template <class S>
Playable<S> playable(const StressScene& stress) {
  Playable<S> result;
  result.frames = stress.frames;
  result.compare_every = stress.compare_every;
  result.scene.name = stress.family;
  try {
    for (std::size_t b = 0; b < stress.bodies.size(); ++b) {
      const StressBody& from = stress.bodies[b];
      Body<S> body;
      body.name = "body" + std::to_string(b);
      for (const auto& primitive : from.primitives) body.primitives.add(primitive);
      body.plans = FlightPlans<S>(from.vertex_count, from.times,
                                  std::vector<S>(from.positions.begin(), from.positions.end()));
      result.scene.bodies.push_back(std::move(body));
    }
    result.scene.pairs = all_pairs(result.scene.bodies);
    validate(result.scene);
    cut_polygons(result.scene);
    for (const StressScene::Step& step : stress.steps) {
      typename PlanScript<S>::Step own{step.time, {}, {}};
      for (const PlanChange<double>& change : step.changes) {
        PlanChange<S> rounded;
        rounded.body = change.body;
        rounded.vertex = change.vertex;
        rounded.times = change.times;
        rounded.positions.assign(change.positions.begin(), change.positions.end());
        for (int axis = 0; axis < 3; ++axis) rounded.velocity[axis] = S(change.velocity[axis]);
        own.changes.push_back(std::move(rounded));
      }
      result.script.steps.push_back(std::move(own));
    }
    // Played once without any contestant: later exceptions are then the contestant's.
    Playback<S> playback(result.scene);
    ScriptCursor<S> cursor(&result.script);
    for (const double t : result.frames) {
      playback.seek(t);
      const auto* step = cursor.at(t);
      if (step == nullptr) continue;
      playback.evaluate_all();
      playback.change_plans(t, step->changes);
    }
    check_played(result.scene, result.script, result.frames);
  } catch (const std::invalid_argument& problem) {
    throw Refused(problem.what());
  }
  return result;
}

template Playable<float> playable(const StressScene&);
template Playable<double> playable(const StressScene&);

std::string to_text(const Repro& repro) {
  json bodies = json::array(), steps = json::array();
  for (const StressBody& body : repro.scene.bodies) {
    json keyframes = json::array();
    for (std::size_t k = 0; k < body.times.size(); ++k) {
      json points = json::array();
      for (std::size_t v = 0; v < body.vertex_count; ++v) {
        const double* p = body.position(k, v);
        points.push_back({p[0], p[1], p[2]});
      }
      keyframes.push_back(std::move(points));
    }
    bodies.push_back({{"vertices", body.vertex_count},
                      {"primitives", body.primitives},
                      {"times", body.times},
                      {"positions", std::move(keyframes)}});
  }
  for (const StressScene::Step& step : repro.scene.steps) {
    json changes = json::array();
    for (const PlanChange<double>& change : step.changes)
      changes.push_back({{"body", change.body},
                         {"vertex", change.vertex},
                         {"times", change.times},
                         {"positions", change.positions},
                         {"velocity", {change.velocity[0], change.velocity[1], change.velocity[2]}}});
    steps.push_back({{"time", step.time}, {"changes", std::move(changes)}});
  }
  json file{{"schema", 1},
            {"kind", "kbvh stress scene"},
            {"failure", repro.failure},
            {"strategy", repro.strategy},
            {"scalar", repro.scalar},
            {"params", repro.params},
            {"builder", repro.builder},
            {"family", repro.scene.family},
            {"compare_every", repro.scene.compare_every},
            {"frames", repro.scene.frames},
            {"bodies", std::move(bodies)},
            {"steps", std::move(steps)}};
  return file.dump() + "\n";
}

namespace {

std::vector<double> all_numbers(const json& value, const JsonReader& keys, const std::string& key) {
  if (!value.is_array()) keys.fail(key, "expected a list of numbers");
  std::vector<double> numbers;
  for (const json& number : value) {
    if (!number.is_number()) keys.fail(key, "expected a number, got " + number.dump());
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

std::vector<double> numbers_at(JsonReader& keys, const std::string& key) {
  const json* value = keys.find(key);
  if (value == nullptr) keys.fail(key, "is missing");
  return all_numbers(*value, keys, key);
}

StressBody body_of(const json& value, const std::string& place) {
  JsonReader keys(value, place);
  StressBody body;
  body.vertex_count = std::uint32_t(keys.whole("vertices", 0, 1u << 24).value_or(0));
  body.times = numbers_at(keys, "times");
  if (body.times.empty()) keys.fail("times", "is empty");
  const json* primitives = keys.find("primitives");
  if (primitives == nullptr || !primitives->is_array()) keys.fail("primitives", "expected a list of lists");
  for (const json& primitive : *primitives) {
    std::vector<std::uint32_t> corners;
    for (const double v : all_numbers(primitive, keys, "primitives")) {
      if (!(v >= 0 && v < body.vertex_count && v == std::floor(v)))
        keys.fail("primitives", "there is no vertex " + std::to_string(v));
      corners.push_back(std::uint32_t(v));
    }
    if (corners.empty()) keys.fail("primitives", "one has no vertex");
    body.primitives.push_back(std::move(corners));
  }
  const json* keyframes = keys.find("positions");
  if (keyframes == nullptr || !keyframes->is_array() || keyframes->size() != body.times.size())
    keys.fail("positions",
              "expected a list of points for each of " + std::to_string(body.times.size()) + " times");
  for (const json& points : *keyframes) {
    if (!points.is_array() || points.size() != body.vertex_count)
      keys.fail("positions", "expected " + std::to_string(body.vertex_count) + " points at each keyframe");
    for (const json& point : points) {
      const auto p = all_numbers(point, keys, "positions");
      if (p.size() != 3) keys.fail("positions", "a point has three coordinates");
      body.positions.insert(body.positions.end(), p.begin(), p.end());
    }
  }
  keys.finish();
  return body;
}

PlanChange<double> change_of(const json& value, const std::string& place) {
  JsonReader keys(value, place);
  PlanChange<double> change;
  change.body = std::uint32_t(keys.whole("body", 0, 1u << 16).value_or(0));
  change.vertex = std::uint32_t(keys.whole("vertex", 0, 1u << 24).value_or(0));
  change.times = numbers_at(keys, "times");
  change.positions = numbers_at(keys, "positions");
  const auto velocity = keys.numbers("velocity", 3);
  if (velocity) std::copy(velocity->begin(), velocity->end(), change.velocity);
  keys.finish();
  return change;
}

}  // namespace

Repro repro_of(const std::string& text, const std::string& name) {
  const json file = parse_json(text, name);
  JsonReader keys(file, name);
  if (keys.word("kind").value_or("") != "kbvh stress scene")
    keys.fail("kind", "expected \"kbvh stress scene\", as kbvh stress writes it");
  if (keys.whole("schema", 0, 1u << 20).value_or(0) != 1) keys.fail("schema", "expected 1");
  Repro repro;
  repro.failure = keys.word("failure").value_or("");
  repro.strategy = keys.word("strategy").value_or("");
  repro.scalar = keys.word("scalar").value_or("");
  if (repro.scalar != "float" && repro.scalar != "double") keys.fail("scalar", "expected float or double");
  repro.builder = keys.word("builder").value_or("");
  if (const json* params = keys.find("params"))
    for (const auto& [key, value] : params->items()) {
      if (!value.is_string()) keys.fail("params", "expected texts");
      repro.params[key] = value.get<std::string>();
    }
  repro.scene.family = keys.word("family").value_or("");
  repro.scene.compare_every = keys.whole("compare_every", 1, 1u << 30).value_or(1);
  repro.scene.frames = numbers_at(keys, "frames");
  if (repro.scene.frames.empty()) keys.fail("frames", "is empty");
  if (!std::is_sorted(repro.scene.frames.begin(), repro.scene.frames.end()))
    keys.fail("frames", "must not decrease");
  if (const json* bodies = keys.find("bodies"))
    for (std::size_t i = 0; i < bodies->size(); ++i)
      repro.scene.bodies.push_back(body_of((*bodies)[i], name + ": bodies[" + std::to_string(i) + "]"));
  if (const json* steps = keys.find("steps"))
    for (std::size_t i = 0; i < steps->size(); ++i) {
      const std::string place = name + ": steps[" + std::to_string(i) + "]";
      JsonReader step_keys((*steps)[i], place);
      StressScene::Step step{step_keys.number("time").value_or(0), {}};
      if (const json* changes = step_keys.find("changes"))
        for (std::size_t j = 0; j < changes->size(); ++j)
          step.changes.push_back(change_of((*changes)[j], place + ": changes[" + std::to_string(j) + "]"));
      step_keys.finish();
      for (const auto& change : step.changes)
        if (change.body >= repro.scene.bodies.size())
          step_keys.fail("changes", "there is no body " + std::to_string(change.body));
      repro.scene.steps.push_back(std::move(step));
    }
  keys.finish();
  return repro;
}

}  // namespace kbvh::experiments::stress
