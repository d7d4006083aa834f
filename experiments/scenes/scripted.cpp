#include "experiments/scenes/scripted.hpp"

#include <algorithm>
#include <cmath>

#include "core/judge/range_watch.hpp"
#include "core/scene/playback.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/scenes/drag.hpp"
#include "experiments/scenes/reversal.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

std::vector<double> point_of(const json& value, const std::string& place) {
  const bool right =
      value.is_array() && value.size() == 3 && std::all_of(value.begin(), value.end(), [](const json& x) {
        return x.is_number() && std::isfinite(x.get<double>());
      });
  if (!right)
    throw io::InputError(place + ": expected three finite numbers, got " + value.dump().substr(0, 60));
  return value.get<std::vector<double>>();
}

ScriptSpec::Change read_change(const json& value, const std::string& place, double now) {
  JsonReader keys(value, place);
  ScriptSpec::Change change;
  change.place = place;
  if (const json* body = keys.find("body"); body != nullptr && body->is_string())
    change.body = body->get<std::string>();
  else
    change.plan.body = std::uint32_t(keys.whole("body", 0, 0xffffffffu).value_or(0));
  const auto vertex = keys.whole("vertex", 0, 0xffffffffu);
  if (!vertex) keys.fail("vertex", "is missing");
  change.plan.vertex = std::uint32_t(*vertex);
  if (const auto velocity = keys.numbers("velocity", 3))
    std::copy(velocity->begin(), velocity->end(), change.plan.velocity);
  if (keys.has("times") != keys.has("positions")) keys.fail("times", "go with as many positions");
  const auto times = keys.list("times"), positions = keys.list("positions");
  if (times.size() != positions.size())
    keys.fail("positions",
              std::to_string(positions.size()) + " of them for " + std::to_string(times.size()) + " times");
  double before = now;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const std::string which = std::to_string(k);
    if (!times[k].is_number() || !std::isfinite(times[k].get<double>()))
      keys.fail("times[" + which + "]", "expected a finite number, got " + times[k].dump());
    const double time = times[k].get<double>();
    if (!(before < time))
      keys.fail("times[" + which + "]", io::text_of(time) + " is not after " + io::text_of(before) +
                                            (k == 0 ? ", the time of the change" : ""));
    change.plan.times.push_back(before = time);
    const auto point = point_of(positions[k], place + ": positions[" + which + "]");
    change.plan.positions.insert(change.plan.positions.end(), point.begin(), point.end());
  }
  keys.finish();
  return change;
}

ScriptSpec::Step read_step(const json& value, const std::string& place) {
  JsonReader keys(value, place);
  const auto time = keys.number("time");
  if (!time) keys.fail("time", "is missing");
  ScriptSpec::Step step{place, *time, {}};
  const auto changes = keys.list("changes");
  for (std::size_t i = 0; i < changes.size(); ++i)
    step.changes.push_back(read_change(changes[i], place + ": changes[" + std::to_string(i) + "]", *time));
  if (changes.empty()) keys.fail("changes", "is missing");
  keys.finish();
  return step;
}

/// Returns the text of a script's file; throws io::InputError that begins with `place` if it cannot be read.
std::string text_of(const std::filesystem::path& file, const std::string& place) {
  try {
    return io::read_file(file);
  } catch (const io::InputError& problem) {
    throw io::InputError(place + ": " + problem.what());
  }
}

}  // namespace

ScriptSpec read_script_spec(const json& value, const std::string& place,
                            const std::filesystem::path& folder) {
  if (value.is_string()) {
    const std::filesystem::path said = value.get<std::string>();
    const std::filesystem::path file = said.is_absolute() || folder.empty() ? said : folder / said;
    const json inner = parse_json(text_of(file, place), file.string());
    if (inner.is_string()) throw io::InputError(file.string() + ": expected the steps of a script");
    return read_script_spec(inner, file.string(), file.parent_path());
  }
  const json object = value.is_array() ? json{{"steps", value}} : value;
  JsonReader keys(object, place);
  ScriptSpec script;
  if (keys.has("frames") != keys.has("rate")) keys.fail("frames", "goes with rate, frames per second");
  script.frames = std::uint32_t(keys.whole("frames", 1, 1000000).value_or(0));
  script.rate = keys.number("rate").value_or(0);
  if (keys.has("rate") && script.rate <= 0)
    keys.fail("rate", "must be positive, got " + io::text_of(script.rate));
  const auto steps = keys.list("steps");
  if (steps.empty()) keys.fail("steps", "is missing");
  keys.finish();
  for (std::size_t i = 0; i < steps.size(); ++i) {
    script.steps.push_back(read_step(steps[i], place + ": steps[" + std::to_string(i) + "]"));
    if (i > 0 && !(script.steps[i - 1].time < script.steps[i].time))
      throw io::InputError(script.steps[i].place + ": time " + io::text_of(script.steps[i].time) +
                           " is not later than that of the preceding step, " +
                           io::text_of(script.steps[i - 1].time));
  }
  return script;
}

namespace {

template <class S>
PlanChange<S> in_scalar(const ScriptSpec::Change& change, const Scene<S>& scene) {
  PlanChange<S> result;
  result.body = change.plan.body;
  if (!change.body.empty()) {
    const auto found = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                    [&](const Body<S>& body) { return body.name == change.body; });
    if (found == scene.bodies.end())
      throw io::InputError(change.place + ": there is no body '" + change.body + "'");
    result.body = std::uint32_t(found - scene.bodies.begin());
  }
  result.vertex = change.plan.vertex;
  result.times = change.plan.times;
  result.positions.assign(change.plan.positions.begin(), change.plan.positions.end());
  for (std::size_t d = 0; d < 3; ++d) result.velocity[d] = S(change.plan.velocity[d]);
  return result;
}

template <class S>
PlanScript<S> tried_out(const Scene<S>& scene, const ScriptSpec& spec) {
  PlanScript<S> script;
  Playback<S> playback(scene);
  const double first = overlaid_keyframes(scene).front();
  for (const ScriptSpec::Step& step : spec.steps) {
    if (step.time < first)
      throw io::InputError(step.place + ": time " + io::text_of(step.time) +
                           " is in the past: the scene begins at " + io::text_of(first));
    typename PlanScript<S>::Step changes{step.time, {}};
    try {
      playback.seek(step.time);
    } catch (const std::invalid_argument& problem) {
      throw io::InputError(step.place + ": " + problem.what());
    }
    for (const ScriptSpec::Change& change : step.changes) {
      changes.changes.push_back(in_scalar(change, scene));
      try {
        playback.change_plans(step.time, {&changes.changes.back(), 1});
      } catch (const std::invalid_argument& problem) {
        throw io::InputError(change.place + ": " + problem.what());
      }
    }
    script.steps.push_back(std::move(changes));
  }
  return script;
}

}  // namespace

template <class S>
PlanScript<S> script_of(const Scene<S>& scene, const LoadedScene& loaded, const MakeProgress& progress) {
  if (loaded.reversal) return recorded_reversals(scene, *loaded.reversal, cache_folder(), progress);
  if (loaded.drag) return drag_script(scene, *loaded.drag);
  if (loaded.script) return tried_out(scene, *loaded.script);
  return {};
}

bool has_own_frames(const LoadedScene& loaded) {
  return loaded.reversal || loaded.drag || (loaded.script && loaded.script->frames > 0);
}

template <class S>
std::vector<double> frames_of(const Scene<S>& scene, const LoadedScene& loaded, const PlanScript<S>& script,
                              std::uint32_t per_keyframe, std::size_t most) {
  std::vector<double> frames;
  if (loaded.reversal || loaded.drag) {
    frames = loaded.drag ? frames_of(*loaded.drag) : frames_of(*loaded.reversal);
    frames.resize(std::min(frames.size(), most));
    return frames;
  }
  if (has_own_frames(loaded)) {
    const double first = overlaid_keyframes(scene).front();
    for (std::uint32_t f = 0; f < loaded.script->frames && f < most; ++f)
      frames.push_back(first + double(f) / loaded.script->rate);
  } else {
    frames = frame_times(scene, per_keyframe, most);
  }
  for (const auto& step : script.steps) frames.push_back(step.time);
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  frames.resize(std::min(frames.size(), most));
  try {
    check_played(scene, script, frames);
  } catch (const std::invalid_argument& problem) {
    throw io::InputError(scene.name + ": " + problem.what());
  }
  return frames;
}

#define KBVH_INSTANTIATE(S)                                                                         \
  template PlanScript<S> script_of(const Scene<S>&, const LoadedScene&, const MakeProgress&);       \
  template std::vector<double> frames_of(const Scene<S>&, const LoadedScene&, const PlanScript<S>&, \
                                         std::uint32_t, std::size_t);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh::experiments
