#include "experiments/study/plan.hpp"

#include <algorithm>

#include "experiments/common/json_reader.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Repeated values count once, at their first place.
template <class T>
void add_once(std::vector<T>& list, T value) {
  if (std::find(list.begin(), list.end(), value) == list.end()) list.push_back(std::move(value));
}

/// Returns the text of a parameter's value in the form that Params takes.
std::string value_text(const json& value, const std::string& where) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number()) return value.dump();
  throw io::InputError(where + ": expected a word, a number or a list of them");
}

}  // namespace

Sweep read_params(const json& object, const std::string& place) {
  if (!object.is_object()) throw io::InputError(place + ": expected an object of parameters");
  Sweep sweep;
  for (const auto& [key, value] : object.items()) {
    const std::string where = place + ": " + key;
    if (value.is_array() && value.empty()) throw io::InputError(where + ": the list is empty");
    for (const json& one : value.is_array() ? value : json::array({value}))
      add_once(sweep[key], value_text(one, where));
  }
  return sweep;
}

BuilderRequest read_builder(const json& object, const std::string& place) {
  JsonReader keys(object, place);
  BuilderRequest request;
  for (const std::string& word : keys.words("method")) {
    try {
      add_once(request.methods, build_method(word));
    } catch (const std::invalid_argument& problem) {
      keys.fail("method", problem.what());
    }
  }
  for (const std::uint64_t width : keys.wholes("width", ranges::width)) {
    if (width != 2 && width != 4 && width != 8)
      keys.fail("width", "expected 2, 4 or 8, got " + std::to_string(width));
    add_once(request.widths, std::uint32_t(width));
  }
  for (const std::uint64_t size : keys.wholes("leaf_size", ranges::leaf_size))
    add_once(request.leaf_sizes, std::uint32_t(size));
  keys.finish();
  return request;
}

namespace {

StrategyRequest read_strategy(const json& value, const std::string& place) {
  if (value.is_string()) return {value.get<std::string>(), {}, {}};
  JsonReader keys(value, place);
  StrategyRequest request;
  request.id = keys.word("id").value_or("");
  if (request.id.empty()) throw io::InputError(place + ": id: is missing");
  if (const json* params = keys.find("params")) request.params = read_params(*params, place + ": params");
  if (const json* builder = keys.find("builder"))
    request.builder = read_builder(*builder, place + ": builder");
  request.optional = keys.truth("optional").value_or(false);
  keys.finish();
  return request;
}

/// Reads the keys of a study over the current content of `study`.
void read_study(JsonReader& keys, Study& study, const std::filesystem::path& folder) {
  const std::string& place = keys.place();
  if (const auto scenes = keys.list("scenes"); !scenes.empty()) {
    study.scenes.clear();
    for (std::size_t i = 0; i < scenes.size(); ++i)
      for (SceneSpec& spec : read_scenes(scenes[i], place + ": scenes[" + std::to_string(i) + "]", folder))
        if (std::none_of(study.scenes.begin(), study.scenes.end(),
                         [&](const SceneSpec& known) { return known.said == spec.said; }))
          study.scenes.push_back(std::move(spec));
  }
  if (const auto strategies = keys.list("strategies"); !strategies.empty()) {
    study.strategies.clear();
    for (std::size_t i = 0; i < strategies.size(); ++i)
      study.strategies.push_back(
          read_strategy(strategies[i], place + ": strategies[" + std::to_string(i) + "]"));
  }
  if (const json* params = keys.find("params")) study.params = read_params(*params, place + ": params");
  if (const json* builder = keys.find("builder")) study.builder = read_builder(*builder, place + ": builder");
  if (const auto l = keys.wholes("l", ranges::frames_per_keyframe); !l.empty()) {
    study.per_keyframe.clear();
    for (const std::uint64_t frames : l) add_once(study.per_keyframe, std::uint32_t(frames));
  }
  if (const auto scalars = keys.words("scalars"); !scalars.empty()) {
    for (const std::string& scalar : scalars)
      if (scalar != "float" && scalar != "double")
        keys.fail("scalars", "expected float or double, got '" + scalar + "'");
    study.scalars.clear();
    for (const std::string& scalar : scalars) add_once(study.scalars, scalar);
  }
  if (const auto count = keys.whole("repetitions", ranges::repetitions))
    study.repetitions = std::uint32_t(*count);
  const auto not_negative = [&](const char* key, double& target) {
    const auto value = keys.number(key);
    if (!value) return;
    if (!(*value >= 0)) keys.fail(key, "must not be negative");
    target = *value;
  };
  not_negative("interval_width", study.interval_width);
  not_negative("seconds", study.seconds);
  if (const auto limit = keys.whole("frames_limit", ranges::any)) study.frames_limit = *limit;
  read_question(keys, study.asks);
  if (const auto every = keys.whole("oracle_every", ranges::positive)) study.oracle_every = *every;
}

}  // namespace

Plan read_plan(const json& value, const std::string& place, const std::filesystem::path& folder) {
  JsonReader keys(value, place);
  Plan plan;
  plan.name = keys.word("name").value_or("");
  plan.description = keys.word("description").value_or("");
  Study common;
  common.name = plan.name;
  read_study(keys, common, folder);
  const auto studies = keys.list("studies");
  plan.targets = read_targets(keys.list("targets"), place);
  keys.find("live");  // simulations, which `kbvh loop --plan` reads
  keys.finish();
  for (std::size_t i = 0; i < studies.size(); ++i) {
    JsonReader study_keys(studies[i], place + ": studies[" + std::to_string(i) + "]");
    Study study = common;
    study.name = study_keys.word("name").value_or(common.name);
    read_study(study_keys, study, folder);
    study_keys.finish();
    plan.studies.push_back(std::move(study));
  }
  if (studies.empty()) plan.studies.push_back(common);
  for (const Study& study : plan.studies) {
    const std::string in_study = studies.empty() ? "" : " in the study '" + study.name + "'";
    if (study.scenes.empty()) throw io::InputError(place + ": scenes: is missing" + in_study);
    const bool boxes = std::any_of(study.scenes.begin(), study.scenes.end(),
                                   [](const SceneSpec& spec) { return spec.radius.has_value(); });
    if (boxes && !study.asks.of_pairs())
      throw io::InputError(place + ": scenes: one has a radius" + in_study +
                           ", so it has pairs of boxes, but no contacts and no answers to rays and points");
  }
  check_target_scenes(plan);
  return plan;
}

Plan load_plan(const std::filesystem::path& file) {
  const std::string text = io::read_file(file);
  return read_plan(parse_json(text, file.string()), file.string(), file.parent_path());
}

}  // namespace kbvh::experiments
