#include "experiments/results/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/counters.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns the width in characters, not bytes, of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return std::size_t(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

double phase_of(const json& repetition, const std::string& phase) {
  const auto get = [&](const char* name) { return repetition.at(name).get<double>(); };
  const auto changes = [&] { return get("plan_changes") + repetition.value("geometry_changes", 0.0); };
  if (phase == "query") return get("traversal") + get("triangle_tests");
  if (phase == "upkeep") return get("update") + changes();
  if (phase == "candidates") return get("update") + get("traversal") + changes();
  if (phase == "total") return get("update") + get("traversal") + get("triangle_tests") + changes();
  if (phase == "total_with_motion") return get("motion") + phase_of(repetition, "total");
  return get(phase.c_str());
}

std::string milliseconds(double value) {
  return fmt::format("{:.4g}", value);
}

/// Formats the strategy's own counters that are not 0.
std::string own_counters(const json& record) {
  std::string text;
  const json counters = record.value("counters", json::object());
  for (const auto& [key, value] : counters.items()) {
    bool shared = false;
    for (std::size_t c = 0; c < std::size_t(Counter::count); ++c) shared = shared || key == name(Counter(c));
    if (!shared && value != 0) text += (text.empty() ? "" : ", ") + key + " " + value.dump();
  }
  return text;
}

/// Formats the pairs that begin or end per frame.
std::string changes_per_frame(const json& record) {
  const json changes = record.value("changes", json::object());
  const double frames = record.at("scene").at("frames").get<double>() - 1;
  const double sum = changes.value("begun", 0.0) + changes.value("ended", 0.0);
  return frames > 0 ? fmt::format("{:.4g}", sum / frames) : "-";
}

/// Returns ", 35 true pairs in 4 compared frames": what the answers of a table were held against. Empty for
/// records that do not say it.
std::string truth_of(const std::vector<json>& records, const json& scene, const std::string& step) {
  std::uint64_t most = 0, found = 0;
  for (const json& record : records) {
    const auto whole = [&](const char* name) {
      const auto value = record.at("verified").find(name);
      return value != record.at("verified").end() && value->is_number_unsigned() ? value->get<std::uint64_t>()
                                                                                 : 0;
    };
    if (whole("frames") <= most) continue;  // one that was refused has not seen all frames
    most = whole("frames");
    found = whole("pairs");
  }
  if (most == 0) return {};
  const char* const noun = scene.contains("rays")             ? "true hit"
                           : scene.value("continuous", false) ? "true contact"
                                                              : "true pair";
  return ", " + counted(found, noun) + " in " + counted(most, "compared " + step);
}

std::string fraction(double value) {
  return value == 0 ? "0" : fmt::format("{:.3g}", value);
}

}  // namespace

std::string columns(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c >= widths.size()) widths.push_back(0);
      widths[c] = std::max(widths[c], width_of(row[c]));
    }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string padding(widths[c] - width_of(row[c]), ' ');
      line += (c == 0 ? "" : "  ") + (c == 0 ? row[c] + padding : padding + row[c]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

bool has_times(const json& record) {
  return record.at("times").is_object();
}

std::vector<double> phase_values(const json& record, const std::string& phase) {
  std::vector<double> values;
  const bool per_event = phase == "update_per_event";
  double events = 1;  // per frame
  if (per_event) {
    // Counters are of the whole clip, times of a frame.
    using json_pointer = json::json_pointer;
    const double frames = record.value(json_pointer("/scene/frames"), 0.0);
    events = frames > 0 ? record.value(json_pointer("/counters/certificates_failed"), 0.0) / frames : 0;
  }
  for (const json& repetition : record.at("times").at("repetitions"))
    values.push_back(events > 0 ? phase_of(repetition, per_event ? "update" : phase) / events : 0);
  return values;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

double median_phase(const json& record, const std::string& phase) {
  return median(phase_values(record, phase));
}

bool is_baseline(const json& record) {
  const json& strategy = record.at("strategy");
  // Records from before baselines were declared: the family decides.
  const auto declared = strategy.find("baseline");
  return declared == strategy.end() ? strategy.at("family") == "refit" : declared->get<bool>();
}

double clip_total(const json& record) {
  return median_phase(record, "total_with_motion");
}

const json* shortest_clip(const std::vector<const json*>& records) {
  const json* best = nullptr;
  for (const json* record : records)
    if (has_times(*record) && (best == nullptr || clip_total(*record) < clip_total(*best))) best = record;
  return best;
}

const json* best_refit(const std::vector<json>& records) {
  std::vector<const json*> baselines;
  for (const json& record : records)
    if (is_baseline(record) && record.at("strategy").value("guarantee", "") != "approximate")
      baselines.push_back(&record);
  return shortest_clip(baselines);
}

std::string instructions_of(const json& record) {
  const json& strategy = record.at("strategy");
  if (const std::string own = strategy.value("instructions", ""); !own.empty()) return own;
  const std::string chosen = strategy.value("params", json::object()).value("kernels", "auto");
  if (chosen != "auto") return chosen;
  return record.value("machine", json::object()).value("kernels", "-");
}

std::string results_table(const std::vector<json>& records) {
  if (records.empty()) return {};
  const json& scene = records[0].at("scene");
  const char* const step = scene.value("continuous", false) ? "interval" : "frame";
  std::string text = fmt::format(
      "{}, l = {}, {}: {}, {}{}\n", scene.at("name").get<std::string>(),
      scene.at("per_keyframe").get<std::uint64_t>(), scene.at("scalar").get<std::string>(),
      counted(scene.at("frames").get<std::uint64_t>(), step),
      counted(scene.at("primitives").get<std::uint64_t>(), "primitive"), truth_of(records, scene, step));
  const json* refit = best_refit(records);
  std::vector<const char*> phases{"motion", "update", "query"};
  std::vector<std::string> head{"strategy", "motion", "update", "query"};
  if (scene.contains("script")) {
    const json& script = scene.at("script");
    text += fmt::format("  plans change while it runs: {} at {}, column plans\n",
                        counted(script.at("changes").get<std::uint64_t>(), "change"),
                        counted(script.at("steps").get<std::uint64_t>(), "frame"));
    phases.push_back("plan_changes");
    head.push_back("plans");
  }
  const json bodies = scene.value("bodies", json::array());
  for (const std::string kind : {"points", "control_nets"})
    if (std::any_of(bodies.begin(), bodies.end(),
                    [&](const json& body) { return body.value("kind", std::string()) == kind; }))
      text += fmt::format("  pairs with {} are candidates: overlapping boxes, without a test of contact\n",
                          kind == "points" ? "points" : "control nets");
  const bool as_changes = scene.contains("changes");
  if (as_changes) head.push_back("changes");
  head.push_back("code");
  for (const char* column : {"x refit", "with motion", "missed", "extra", "protrusion", "looseness"})
    head.push_back(column);
  std::vector<std::vector<std::string>> rows{head};
  std::string refusals, choices, counted_by;
  std::vector<std::string> peers;
  for (const json& record : records) {
    const json& verified = record.at("verified");
    const std::string label = record.at("strategy").at("label").get<std::string>();
    std::vector<std::string> row{label};
    if (has_times(record)) {
      for (const char* phase : phases) row.push_back(milliseconds(median_phase(record, phase)));
      if (as_changes) row.push_back(changes_per_frame(record));
      row.push_back(instructions_of(record));
      for (const char* phase : {"total", "total_with_motion"})
        row.push_back(refit == nullptr
                          ? "-"
                          : fmt::format("{:.3g}", median_phase(*refit, phase) / median_phase(record, phase)));
    } else {
      row.push_back("refused");
      row.resize(head.size() - 4);
      refusals += "  " + label + " is refused a time: " + record.value("refused", std::string()) + "\n";
    }
    row.push_back(std::to_string(verified.at("missed").get<std::uint64_t>()));
    row.push_back(std::to_string(verified.at("extra").get<std::uint64_t>()));
    const bool audited = verified.at("audited").get<bool>();
    row.push_back(audited ? fraction(verified.at("protrusion").get<double>()) : "-");
    row.push_back(audited ? fraction(verified.at("looseness").get<double>()) : "-");
    rows.push_back(std::move(row));
    if (const std::string own = own_counters(record); !own.empty())
      counted_by += "  " + label + " counted " + own + "\n";
    const json& strategy = record.at("strategy");
    if (std::string peer = strategy.value("version", ""); !peer.empty()) {
      peer = "  " + strategy.at("id").get<std::string>() + " is " + peer;
      if (const std::string remark = strategy.value("remark", ""); !remark.empty()) peer += ": " + remark;
      if (std::find(peers.begin(), peers.end(), peer) == peers.end()) peers.push_back(peer);
    }
    if (record.contains("choice"))
      choices += "  " + label + " chose " + record.at("choice").get<std::string>() + "\n";
  }
  text += columns(rows);
  if (refit != nullptr)
    text += "  x refit and with motion: against " + refit->at("strategy").at("label").get<std::string>() +
            ", the baseline with the shortest clip\n";
  for (const std::string& peer : peers) text += peer + "\n";
  text += refusals + choices + counted_by;
  std::set<std::string> runs;
  for (const json& record : records) runs.insert(record.value("run", std::string()));
  if (runs.size() > 1) text += "  (from several runs: the machine may have differed)\n";
  return text;
}

}  // namespace kbvh::experiments
