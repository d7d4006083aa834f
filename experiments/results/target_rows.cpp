#include "experiments/results/target_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <stdexcept>

#include "experiments/common/machine.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// The result of a selector in one table.
struct Side {
  const json* record = nullptr;  ///< of the configuration whose clip takes the shortest time
  std::string phase;
  double middle = 0;    ///< ms per frame
  std::string missing;  ///< why there is none
};

Side side_of(const TargetSelector& selector, const std::vector<json>& records) {
  Side side;
  std::string refused;
  std::vector<const json*> matching;
  for (const json& record : records) {
    if (!matches(selector, record.at("strategy"))) continue;
    matching.push_back(&record);
    if (!has_times(record))
      refused = record.at("strategy").at("label").get<std::string>() +
                " is refused a time: " + record.value("refused", std::string());
  }
  side.record = shortest_clip(matching);
  if (side.record == nullptr) {
    side.missing = !refused.empty()      ? refused
                   : !is_known(selector) ? "this program was built without " + selector.strategy
                                         : described(selector) + " takes no part";
    return side;
  }
  side.phase = selector.phase;
  side.middle = time_of(*side.record, selector.phase);
  if (side.middle <= 0)
    side.missing = side.record->at("strategy").at("label").get<std::string>() + " spends no time in '" +
                   selector.phase + "'";
  return side;
}

json side_json(const Side& side) {
  if (side.record == nullptr) return nullptr;
  const json& record = *side.record;
  return {{"label", record.at("strategy").at("label")},
          {"ms", side.middle},
          {"repetitions", record.at("times").at("repetitions").size()},
          {"disturbed", disturbed(record)},
          {"run", record.value("run", std::string())}};
}

/// Returns whether the table has the target's scalar, l and kind of answer.
bool is_measured_as(const Target& target, const TargetGroup& group) {
  return group.scene.at("scalar") == target.scalar && group.scene.at("per_keyframe") == target.per_keyframe &&
         group.scene.value("changes", std::string()) == target.changes;
}

/// Returns a scene's name in the tables that a target reads.
std::string name_in_tables(const Target& target, const std::string& scene) {
  return name_with_changes(scene, target.changes);
}

bool is_counted(const Target& target, const std::string& scene) {
  return std::any_of(target.scenes.begin(), target.scenes.end(),
                     [&](const std::string& one) { return name_in_tables(target, one) == scene; });
}

/// Returns the table on which a side is measured: `group`, or the first table of the selector's own scene.
Side side_of(const TargetSelector& selector, const Target& target, const TargetGroup& group,
             const std::vector<TargetGroup>& groups) {
  if (selector.scene.empty()) return side_of(selector, group.records);
  for (const TargetGroup& other : groups)
    if (is_measured_as(target, other) && other.scene.at("name") == name_in_tables(target, selector.scene))
      return side_of(selector, other.records);
  Side side;
  side.missing = "'" + selector.scene + "' was left out";
  return side;
}

/// Computes the ratio in one table, or the reason for its absence.
json scene_row(const Target& target, const TargetGroup& group, const std::vector<TargetGroup>& groups) {
  const Side numerator = side_of(target.numerator, target, group, groups);
  const Side denominator = side_of(target.denominator, target, group, groups);
  std::uint64_t triangles = 0;
  for (const json& body : group.scene.at("bodies"))
    if (body.at("moving").get<bool>()) triangles += body.at("primitives").get<std::uint64_t>();
  json row{{"scene", group.scene.at("name")},
           {"order", group.scene.value("order", std::string())},
           {"triangles", triangles},
           {"counts", is_counted(target, group.scene.at("name").get<std::string>())},
           {"ratio", nullptr},
           {"confidence_interval", nullptr},
           {"range", nullptr},
           {"numerator", side_json(numerator)},
           {"denominator", side_json(denominator)}};
  std::string missing = numerator.missing;
  if (denominator.missing != missing && !denominator.missing.empty())
    missing += (missing.empty() ? "" : "; ") + denominator.missing;
  if (!missing.empty()) {
    row["reason"] = missing;
    return row;
  }
  const auto ratio = ratio_of(*numerator.record, numerator.phase, *denominator.record, denominator.phase);
  if (!ratio) throw std::logic_error("a ratio of times that are not 0 is missing");
  row["ratio"] = ratio->middle;
  if (ratio->within)
    row[ratio->within->is_interval ? "confidence_interval" : "range"] = {ratio->within->low,
                                                                         ratio->within->high};
  return row;
}

/// Collects every scene on which the target's scalar and l were measured, once: from the first table with
/// both sides.
json scene_rows(const Target& target, const std::vector<TargetGroup>& groups) {
  std::vector<std::pair<std::string, json>> rows;  // by hash of the scene
  for (const TargetGroup& group : groups) {
    if (!is_measured_as(target, group)) continue;
    // One scene may be asked for pairs and for rays, and by other kernels.
    const std::string hash = group.scene.at("hash").get<std::string>() + group.scene.value("rays", "") +
                             group.scene.value("within", "") + group.scene.value("kernels", "");
    const auto known =
        std::find_if(rows.begin(), rows.end(), [&](const auto& row) { return row.first == hash; });
    if (known == rows.end())
      rows.emplace_back(hash, scene_row(target, group, groups));
    else if (known->second.at("ratio").is_null())
      if (json row = scene_row(target, group, groups); !row.at("ratio").is_null())
        known->second = std::move(row);
  }
  json list = json::array();
  for (auto& [hash, row] : rows)
    if (!row.at("ratio").is_null() || row.at("counts").get<bool>()) list.push_back(std::move(row));
  for (const std::string& scene : target.scenes)
    if (std::none_of(list.begin(), list.end(),
                     [&](const json& row) { return row.at("scene") == name_in_tables(target, scene); }))
      list.push_back({{"scene", scene},
                      {"order", nullptr},
                      {"triangles", nullptr},
                      {"counts", true},
                      {"ratio", nullptr},
                      {"confidence_interval", nullptr},
                      {"range", nullptr},
                      {"numerator", nullptr},
                      {"denominator", nullptr},
                      {"reason", "the scene was left out"}});
  return list;
}

json selector_json(const TargetSelector& selector) {
  return {{"strategy", selector.strategy}, {"phase", selector.phase}, {"which", described(selector)}};
}

/// Geometric means over scenes. The ends of intervals are averaged in the same way, as if all scenes were at
/// the same end at once, so the result is wider than a 95 % interval.
class Mean {
 public:
  /// `kind`: confidence_interval or range.
  explicit Mean(const char* kind) : kind_(kind) {}
  void add(const json& scene) {
    ++count_;
    ratio_ += std::log(scene.at("ratio").get<double>());
    const json& interval = scene.at(kind_);
    known_ = known_ && interval.is_array();
    if (!known_) return;
    low_ += std::log(interval[0].get<double>());
    high_ += std::log(interval[1].get<double>());
  }
  double ratio() const { return std::exp(ratio_ / count_); }
  json interval() const {
    if (!known_) return nullptr;
    return {std::exp(low_ / count_), std::exp(high_ / count_)};
  }

 private:
  const char* kind_;
  double count_ = 0, ratio_ = 0, low_ = 0, high_ = 0;
  bool known_ = true;
};

json target_row(const Target& target, const std::vector<TargetGroup>& groups) {
  json row{{"what", target.what},
           {"measured", nullptr},
           {"at_least", target.at_least},
           {"aim", target.aim},
           {"confidence_interval", nullptr},
           {"confidence", 0.95},
           {"range", nullptr},
           {"verdict", "unmeasured"},
           {"scene", nullptr},
           {"scenes", target.scenes},
           {"over", target.mean ? "geometric_mean" : "worst"},
           {"scalar", target.scalar},
           {"changes", target.changes},
           {"l", target.per_keyframe},
           {"numerator", selector_json(target.numerator)},
           {"denominator", selector_json(target.denominator)},
           {"note", target.note},
           {"per_scene", scene_rows(target, groups)}};
  const json* worst = nullptr;
  Mean mean("confidence_interval"), mean_of_ranges("range");
  std::set<std::string> runs;
  for (const json& one : row["per_scene"]) {
    if (!one.at("counts").get<bool>()) continue;
    if (one.at("ratio").is_null()) {
      // An unmeasured scene that counts could be worse than all the others.
      row["reason"] = one.at("scene").get<std::string>() + ": " + one.at("reason").get<std::string>();
      return row;
    }
    for (const char* side : {"numerator", "denominator"})
      runs.insert(one.at(side).at("run").get<std::string>());
    if (worst == nullptr || one.at("ratio").get<double>() < worst->at("ratio").get<double>()) worst = &one;
    mean.add(one);
    mean_of_ranges.add(one);
  }
  const double measured = target.mean ? mean.ratio() : worst->at("ratio").get<double>();
  row["measured"] = measured;
  row["confidence_interval"] = target.mean ? mean.interval() : worst->at("confidence_interval");
  row["range"] = target.mean ? mean_of_ranges.interval() : worst->at("range");
  row["scene"] = worst->at("scene");
  row["verdict"] = measured >= target.aim        ? "reached_aim"
                   : measured >= target.at_least ? "reached"
                                                 : "missed";
  row["runs"] = runs;
  return row;
}

}  // namespace

json target_rows(const Plan& plan, const std::vector<TargetGroup>& groups) {
  const json facts{{"schema", targets_schema}, {"plan", plan.name},    {"commit", commit()},
                   {"dirty", dirty()},         {"machine", machine()}, {"when", now_utc()}};
  json rows = json::array();
  for (const Target& target : plan.targets) {
    rows.push_back(target_row(target, groups));
    rows.back().update(facts);
  }
  return rows;
}

// --- printed tables -------------------------------------------------------------------------------------

namespace {

std::string number_text(const json& value) {
  return value.is_number() ? fmt::format("{:.4g}", value.get<double>()) : "-";
}

/// Formats the interval or, in brackets, the range of a row.
std::string interval_text(const json& row) {
  const json &interval = row.at("confidence_interval"), &range = row.at("range");
  if (interval.is_array()) return number_text(interval[0]) + " to " + number_text(interval[1]);
  return range.is_array() ? "[" + number_text(range[0]) + " to " + number_text(range[1]) + "]" : "-";
}

/// Formats the ratio of a scene, with "?" if a side was disturbed.
std::string ratio_text(const json& scene) {
  bool doubtful = false;
  for (const char* side : {"numerator", "denominator"})
    doubtful =
        doubtful || (scene.at(side).is_object() && !scene.at(side).value("disturbed", std::string()).empty());
  return number_text(scene.at("ratio")) + (doubtful ? "?" : "");
}

std::string verdict_text(const json& row) {
  const std::string verdict = row.at("verdict").get<std::string>();
  return verdict == "reached_aim" ? "aim reached" : verdict;
}

std::string scene_text(const json& row) {
  if (!row.at("scene").is_string()) return "-";
  return row.at("over") == "geometric_mean" ? "mean of " + std::to_string(row.at("scenes").size())
                                            : row.at("scene").get<std::string>();
}

}  // namespace

std::string targets_table(const json& rows) {
  std::vector<std::vector<std::string>> summary{
      {"target", "measured", "interval or [range]", "at least", "aim", "verdict", "on"}};
  std::string reasons, details;
  bool several_runs = false;
  for (const json& row : rows) {
    const std::string what = row.at("what").get<std::string>();
    summary.push_back({what, number_text(row.at("measured")), interval_text(row),
                       number_text(row.at("at_least")), number_text(row.at("aim")), verdict_text(row),
                       scene_text(row)});
    if (const std::string note = row.value("note", ""); !note.empty())
      reasons += "  " + what + ": " + note + "\n";
    if (row.contains("reason"))
      reasons += "  " + what + ": not measured: " + row.at("reason").get<std::string>() + "\n";
    several_runs = several_runs || (row.contains("runs") && row.at("runs").size() > 1);
    std::vector<std::vector<std::string>> scenes{
        {what, "ratio", "interval or [range]", "ms", "of", "ms", "of"}};
    for (const json& one : row.at("per_scene")) {
      std::vector<std::string> cells{
          "  " + one.at("scene").get<std::string>() + (one.at("counts").get<bool>() ? " *" : ""),
          ratio_text(one), interval_text(one)};
      for (const char* side : {"numerator", "denominator"}) {
        const json& times = one.at(side);
        cells.push_back(times.is_object() ? number_text(times.at("ms")) : "-");
        cells.push_back(times.is_object() ? times.at("label").get<std::string>() : "-");
      }
      scenes.push_back(std::move(cells));
    }
    details += "\n" + columns(scenes);
  }
  std::string text = "Targets: how many times slower the other is, on the scenes that count\n";
  text += columns(summary) + reasons;
  if (several_runs) text += "  (from several runs: the machine may have differed)\n";
  return text + "\nAll scenes (* counts, ? disturbed)\n" + details;
}

void write_targets(const std::filesystem::path& folder, const json& rows) {
  const FolderLock lock(folder);
  const std::filesystem::path file = folder / "targets.json";
  std::set<std::string> plans;
  for (const json& row : rows) plans.insert(row.at("plan").get<std::string>());
  json all = json::array();
  if (const std::optional<json> before = content_of(file); before && before->is_array()) {
    for (const json& row : *before)
      if (!row.is_object() || !plans.contains(row.value("plan", ""))) all.push_back(row);
  } else if (before) {
    say("warning: " + file.string() + " is not a list of targets: it is now " + set_aside(file) +
        ", and a new file is started");
  }
  for (const json& row : rows) all.push_back(row);
  io::write_file_atomically(file, all.dump(1, ' ', false, json::error_handler_t::replace) + "\n");
}

}  // namespace kbvh::experiments
