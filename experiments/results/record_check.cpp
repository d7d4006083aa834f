#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "experiments/results/record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

enum class Kind : std::uint8_t { text, whole, size, number, truth, object, object_or_null, list };
enum class Needed : std::uint8_t {
  always,
  if_there,  ///< older records lack it, or the study did not ask for it
  steady,    ///< if the clip has steady frames
};

struct Field {
  std::string_view path;  ///< "[]" after a list: in or of each of its entries
  Kind kind;
  Needed needed = Needed::always;
};

/// What tables, targets and merges read of a record. A field of a part that is not there is not needed
/// either.
constexpr Field fields[] = {
    {"run", Kind::text, Needed::if_there},
    {"choice", Kind::text, Needed::if_there},
    {"refused", Kind::text, Needed::if_there},
    {"machine", Kind::object, Needed::if_there},
    {"machine.kernels", Kind::text, Needed::if_there},
    {"changes", Kind::object, Needed::if_there},
    {"changes.begun", Kind::whole},
    {"changes.ended", Kind::whole},
    {"scene", Kind::object},
    {"scene.name", Kind::text},
    {"scene.scalar", Kind::text},
    {"scene.per_keyframe", Kind::whole},
    {"scene.frames", Kind::whole},
    {"scene.primitives", Kind::whole},
    {"scene.bodies", Kind::list},
    {"scene.bodies[]", Kind::object},
    {"scene.bodies[].moving", Kind::truth},
    {"scene.bodies[].primitives", Kind::whole},
    {"scene.bodies[].kind", Kind::text},
    {"scene.continuous", Kind::truth, Needed::if_there},
    {"scene.changes", Kind::text, Needed::if_there},
    {"scene.rays", Kind::text, Needed::if_there},
    {"scene.within", Kind::text, Needed::if_there},
    {"scene.kernels", Kind::text, Needed::if_there},
    {"scene.script", Kind::object, Needed::if_there},
    {"scene.script.steps", Kind::whole},
    {"scene.script.changes", Kind::whole},
    {"strategy", Kind::object},
    {"strategy.id", Kind::text},
    {"strategy.label", Kind::text},
    {"strategy.family", Kind::text},
    {"strategy.baseline", Kind::truth, Needed::if_there},
    {"strategy.guarantee", Kind::text, Needed::if_there},
    {"strategy.version", Kind::text, Needed::if_there},
    {"strategy.instructions", Kind::text, Needed::if_there},
    {"strategy.remark", Kind::text, Needed::if_there},
    {"strategy.params", Kind::object},
    {"strategy.params.kernels", Kind::text, Needed::if_there},
    {"verified", Kind::object},
    {"verified.holds", Kind::truth},
    {"verified.missed", Kind::whole},
    {"verified.extra", Kind::whole},
    {"verified.audited", Kind::truth},
    {"verified.protrusion", Kind::size},
    {"verified.looseness", Kind::number},  // may be negative: boxes without content have no area
    {"times", Kind::object_or_null},
    {"times.by", Kind::text},
    {"times.disturbed", Kind::text},
    {"times.build_ms", Kind::size},
    {"times.total_p99", Kind::size, Needed::if_there},
    {"times.repetitions", Kind::list},
    {"times.repetitions[]", Kind::object},
    {"times.repetitions[].motion", Kind::size},
    {"times.repetitions[].update", Kind::size},
    {"times.repetitions[].traversal", Kind::size},
    {"times.repetitions[].triangle_tests", Kind::size},
    {"times.repetitions[].plan_changes", Kind::size},
    {"times.repetitions[].geometry_changes", Kind::size, Needed::if_there},
    {"times.repetitions[].totals", Kind::list},
    {"times.repetitions[].totals[]", Kind::size},
    {"times.repetitions[].motions", Kind::list},
    {"times.repetitions[].motions[]", Kind::size},
    {"times.repetitions[].steady", Kind::object, Needed::steady},
    {"times.repetitions[].steady.motion", Kind::size, Needed::steady},
    {"times.repetitions[].steady.update", Kind::size, Needed::steady},
    {"times.repetitions[].steady.traversal", Kind::size, Needed::steady},
    {"times.repetitions[].steady.triangle_tests", Kind::size, Needed::steady},
    {"times.repetitions[].steady.plan_changes", Kind::size, Needed::steady},
    {"times.repetitions[].steady.geometry_changes", Kind::size, Needed::steady},
};

/// Returns "" for a value of this kind, else what it is not.
std::string is_not(const json& value, Kind kind) {
  switch (kind) {
    case Kind::text:
      return value.is_string() ? "" : "is not a text";
    case Kind::whole:
      return value.is_number_unsigned() ? "" : "is not a whole number";
    case Kind::size:
      return value.is_number() && std::isfinite(value.get<double>()) && value.get<double>() >= 0
                 ? ""
                 : "is not a finite number that is not negative";
    case Kind::number:
      return value.is_number() ? "" : "is not a number";
    case Kind::truth:
      return value.is_boolean() ? "" : "is not true or false";
    case Kind::object:
      return value.is_object() ? "" : "is not an object";
    case Kind::object_or_null:
      return value.is_object() || value.is_null() ? "" : "is neither an object nor null";
    case Kind::list:
      break;
  }
  return value.is_array() ? "" : "is not a list";
}

/// Returns a field's path for messages.
std::string place_of(const Field& field) {
  std::string place(field.path);
  for (std::size_t at; (at = place.find("[]")) != std::string::npos;) place.erase(at, 2);
  return place;
}

/// Returns what is wrong with a field below `part`, from character `begin` of its path on. Parts of another
/// kind are not looked into: a field of their own tells.
std::string wrong(const json& part, const Field& field, std::size_t begin = 0) {
  if (!part.is_object()) return {};
  const std::size_t end = std::min(field.path.find('.', begin), field.path.size());
  const bool last = end == field.path.size();
  std::string name(field.path.substr(begin, end - begin));
  const bool each = name.ends_with("[]");
  if (each) name.resize(name.size() - 2);
  const auto found = part.find(name);
  if (found == part.end())
    return !last || each || field.needed == Needed::if_there ? ""
                                                             : "the field " + place_of(field) + " is missing";
  if (!each) {
    if (!last) return wrong(*found, field, end + 1);
    const std::string what = is_not(*found, field.kind);
    return what.empty() ? "" : place_of(field) + " " + what;
  }
  if (!found->is_array()) return {};
  for (const json& entry : *found) {
    std::string what = last ? is_not(entry, field.kind) : wrong(entry, field, end + 1);
    if (!what.empty()) return last ? place_of(field) + " has an entry that " + what : what;
  }
  return {};
}

/// Checks that there are times of as many frames in every repetition, and where the steady ones begin.
std::string wrong_frames(const json& times) {
  const json& repetitions = times.at("repetitions");
  if (repetitions.empty()) return "times.repetitions has no entry";
  const std::size_t frames = repetitions[0].at("totals").size();
  for (const json& repetition : repetitions)
    for (const char* name : {"totals", "motions"})
      if (frames == 0 || repetition.at(name).size() != frames)
        return std::string("times.repetitions.") + name + " has not as many entries as there are frames";
  const json steady = times.value("steady_from", json());
  if (!steady.is_null() && (!steady.is_number_unsigned() || steady.get<std::uint64_t>() >= frames))
    return "times.steady_from is not a frame";
  return {};
}

}  // namespace

std::string unusable(const json& record) {
  if (!record.is_object()) return "the record is not an object";
  const auto times = record.find("times");
  const bool steady =
      times != record.end() && times->is_object() && !times->value("steady_from", json()).is_null();
  for (const Field& field : fields) {
    if (field.needed == Needed::steady && !steady) continue;
    if (std::string what = wrong(record, field); !what.empty()) return what;
  }
  return times->is_null() ? "" : wrong_frames(*times);
}

}  // namespace kbvh::experiments
