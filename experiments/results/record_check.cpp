#include <cmath>
#include <optional>

#include "experiments/results/record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

enum class Kind : std::uint8_t { text, whole, number, truth, object, list };

const char* kind_name(Kind kind) {
  switch (kind) {
    case Kind::text:
      return "a text";
    case Kind::whole:
      return "a whole number";
    case Kind::number:
      return "a finite number that is not negative";
    case Kind::truth:
      return "true or false";
    case Kind::object:
      return "an object";
    case Kind::list:
      break;
  }
  return "a list";
}

bool is(const json& value, Kind kind) {
  switch (kind) {
    case Kind::text:
      return value.is_string();
    case Kind::whole:
      return value.is_number_unsigned();
    case Kind::number:
      return value.is_number() && std::isfinite(value.get<double>()) && value.get<double>() >= 0;
    case Kind::truth:
      return value.is_boolean();
    case Kind::object:
      return value.is_object();
    case Kind::list:
      break;
  }
  return value.is_array();
}

struct Field {
  const char* name;
  Kind kind;
};

/// Returns the first field that is missing or of another type.
std::string wrong(const json& object, const std::string& place, std::initializer_list<Field> fields) {
  for (const Field& field : fields) {
    const auto found = object.find(field.name);
    if (found == object.end()) return "the field " + place + field.name + " is missing";
    if (!is(*found, field.kind)) return place + field.name + " is not " + kind_name(field.kind);
  }
  return {};
}

/// Returns the first field of another type; fields that older records lack may be missing.
std::string wrong_if_there(const json& object, const std::string& place,
                           std::initializer_list<Field> fields) {
  for (const Field& field : fields)
    if (object.contains(field.name))
      if (std::string what = wrong(object, place, {field}); !what.empty()) return what;
  return {};
}

std::string wrong_scene(const json& scene) {
  std::string what = wrong(scene, "scene.",
                           {{"name", Kind::text},
                            {"scalar", Kind::text},
                            {"per_keyframe", Kind::whole},
                            {"frames", Kind::whole},
                            {"primitives", Kind::whole},
                            {"bodies", Kind::list}});
  if (!what.empty()) return what;
  for (const json& body : scene.at("bodies")) {
    if (!body.is_object()) return "scene.bodies is not a list of objects";
    what = wrong(body, "scene.bodies.",
                 {{"moving", Kind::truth}, {"primitives", Kind::whole}, {"kind", Kind::text}});
    if (!what.empty()) return what;
  }
  if (scene.contains("continuous") && !scene.at("continuous").is_boolean())
    return "scene.continuous is not true or false";
  if (scene.contains("changes") && !scene.at("changes").is_string()) return "scene.changes is not a text";
  what = wrong_if_there(scene, "scene.", {{"rays", Kind::text}, {"kernels", Kind::text}});
  if (!what.empty()) return what;
  if (!scene.contains("script")) return {};
  if (!scene.at("script").is_object()) return "scene.script is not an object";
  return wrong(scene.at("script"), "scene.script.", {{"steps", Kind::whole}, {"changes", Kind::whole}});
}

/// Checks the times of single frames, and the means of the steady ones.
std::string wrong_frames(const json& times, const json& repetition) {
  const std::size_t frames = times.at("repetitions")[0].value("totals", json::array()).size();
  for (const char* name : {"totals", "motions"}) {
    if (std::string what = wrong(repetition, "times.repetitions.", {{name, Kind::list}}); !what.empty())
      return what;
    const json& list = repetition.at(name);
    if (list.empty() || list.size() != frames)
      return std::string("times.repetitions.") + name + " has not as many entries as there are frames";
    for (const json& value : list)
      if (!is(value, Kind::number))
        return std::string("times.repetitions.") + name + " has an entry that is not " +
               kind_name(Kind::number);
  }
  for (const char* text : {"by", "disturbed"})
    if (std::string what = wrong(times, "times.", {{text, Kind::text}}); !what.empty()) return what;
  if (std::string what = wrong(times, "times.", {{"build_ms", Kind::number}}); !what.empty()) return what;
  const auto steady = times.find("steady_from");
  if (steady == times.end() || steady->is_null()) return {};
  if (!is(*steady, Kind::whole) || steady->get<std::uint64_t>() >= frames)
    return "times.steady_from is not a frame";
  if (std::string what = wrong(repetition, "times.repetitions.", {{"steady", Kind::object}}); !what.empty())
    return what;
  return wrong(repetition.at("steady"), "times.repetitions.steady.",
               {{"motion", Kind::number},
                {"update", Kind::number},
                {"traversal", Kind::number},
                {"triangle_tests", Kind::number},
                {"plan_changes", Kind::number},
                {"geometry_changes", Kind::number}});
}

std::string wrong_times(const json& times) {
  if (times.is_null()) return {};
  if (!times.is_object()) return "times is neither an object nor null";
  if (std::string what = wrong(times, "times.", {{"repetitions", Kind::list}}); !what.empty()) return what;
  if (times.at("repetitions").empty()) return "times.repetitions has no entry";
  for (const json& repetition : times.at("repetitions")) {
    if (!repetition.is_object()) return "times.repetitions is not a list of objects";
    std::string what = wrong(repetition, "times.repetitions.",
                             {{"motion", Kind::number},
                              {"update", Kind::number},
                              {"traversal", Kind::number},
                              {"triangle_tests", Kind::number},
                              {"plan_changes", Kind::number}});
    if (what.empty() && repetition.contains("geometry_changes"))
      what = wrong(repetition, "times.repetitions.", {{"geometry_changes", Kind::number}});
    if (what.empty()) what = wrong_frames(times, repetition);
    if (!what.empty()) return what;
  }
  return {};
}

}  // namespace

std::string unusable(const json& record) {
  std::string what =
      wrong(record, "", {{"scene", Kind::object}, {"strategy", Kind::object}, {"verified", Kind::object}});
  if (what.empty()) what = wrong_scene(record.at("scene"));
  if (what.empty())
    what =
        wrong(record.at("strategy"), "strategy.",
              {{"id", Kind::text}, {"label", Kind::text}, {"family", Kind::text}, {"params", Kind::object}});
  if (what.empty())
    what = wrong_if_there(record.at("strategy"), "strategy.",
                          {{"guarantee", Kind::text},
                           {"version", Kind::text},
                           {"instructions", Kind::text},
                           {"remark", Kind::text}});
  if (what.empty())
    what = wrong_if_there(record.at("strategy").at("params"), "strategy.params.", {{"kernels", Kind::text}});
  if (what.empty()) what = wrong_if_there(record, "", {{"machine", Kind::object}});
  if (what.empty() && record.contains("machine"))
    what = wrong_if_there(record.at("machine"), "machine.", {{"kernels", Kind::text}});
  // Records from before baselines were declared have no such field.
  if (what.empty() && !record.at("strategy").value("baseline", json(false)).is_boolean())
    what = "strategy.baseline is not true or false";
  if (what.empty())
    what = wrong(record.at("verified"), "verified.",
                 {{"holds", Kind::truth},
                  {"missed", Kind::whole},
                  {"extra", Kind::whole},
                  {"audited", Kind::truth},
                  {"protrusion", Kind::number}});
  // Looseness may be negative: boxes without content have no area.
  if (what.empty() &&
      (!record.at("verified").contains("looseness") || !record.at("verified").at("looseness").is_number()))
    what = "the field verified.looseness is missing or not a number";
  if (what.empty() && !record.contains("times")) what = "the field times is missing";
  if (what.empty()) what = wrong_times(record.at("times"));
  if (what.empty() && record.contains("changes"))
    what = !record.at("changes").is_object()
               ? "changes is not an object"
               : wrong(record.at("changes"), "changes.", {{"begun", Kind::whole}, {"ended", Kind::whole}});
  for (const char* text : {"choice", "refused", "run"})
    if (what.empty() && record.contains(text)) what = wrong(record, "", {{text, Kind::text}});
  return what;
}

}  // namespace kbvh::experiments
