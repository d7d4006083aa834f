#include "experiments/results/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/base/counters.hpp"
#include "experiments/common/text.hpp"
#include "experiments/study/times_record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns the width in characters, not bytes, of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return std::size_t(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
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

namespace {
/// Returns the certificates that failed per frame: counters are of the whole clip, times of a frame.
double events_per_frame(const json& record) {
  using json_pointer = json::json_pointer;
  const double frames = record.value(json_pointer("/scene/frames"), 0.0);
  return frames > 0 ? record.value(json_pointer("/counters/certificates_failed"), 0.0) / frames : 0;
}
constexpr const char* per_event = "update_per_event";
std::string timed_phase(const std::string& phase) {
  return phase == per_event ? "update" : phase;
}
}  // namespace

double time_of(const json& record, const std::string& phase) {
  const double time = time_of(raw_times(record), timed_phase(phase));
  if (phase != per_event) return time;
  const double events = events_per_frame(record);
  return events > 0 ? time / events : 0;
}

std::optional<RatioOfTimes> ratio_of(const json& numerator, const std::string& phase, const json& denominator,
                                     const std::string& phase_below) {
  const RawTimes above = raw_times(numerator), below = raw_times(denominator);
  double events = 1;
  if (phase == per_event) events /= events_per_frame(numerator);
  if (phase_below == per_event) events *= events_per_frame(denominator);
  const std::string numerator_phase = timed_phase(phase), denominator_phase = timed_phase(phase_below);
  std::optional<RatioOfTimes> ratio = ratio_of({above, numerator_phase}, {below, denominator_phase});
  if (!ratio || !(events > 0) || !std::isfinite(events)) return {};
  ratio->middle *= events;
  if (ratio->within) {
    ratio->within->low *= events;
    ratio->within->high *= events;
  }
  return ratio;
}

std::string disturbed(const json& record) {
  return has_times(record) ? record.at("times").value("disturbed", std::string()) : std::string();
}

bool is_baseline(const json& record) {
  const json& strategy = record.at("strategy");
  // Records from before baselines were declared: the family decides.
  const auto declared = strategy.find("baseline");
  return declared == strategy.end() ? strategy.at("family") == "refit" : declared->get<bool>();
}

double clip_total(const json& record) {
  return time_of(record, "total_with_motion");
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

namespace {

/// The records of one table, with the ratios to the best refit.
class Table {
 public:
  explicit Table(const std::vector<json>& records) : records_(records), refit_(best_refit(records)) {
    for (const json& record : records) times_.push_back(has_times(record) ? raw_times(record) : RawTimes{});
    for (std::size_t i = 0; i < records.size(); ++i)
      if (&records[i] == refit_) refit_times_ = &times_[i];
  }

  std::string text();

 private:
  void head_lines();
  void choose_columns();
  std::vector<std::string> row(std::size_t i);
  void ratio_cells(std::size_t i, std::vector<std::string>& row);
  std::string paid_cell(std::size_t i) const;
  std::string ratio_cell(std::size_t i, const char* phase, Part part) const;
  std::string within_cell(std::size_t i) const;
  void disturbances();

  const std::vector<json>& records_;
  const json* refit_;
  std::vector<RawTimes> times_;
  const RawTimes* refit_times_ = nullptr;
  std::string text_, below_;
  std::vector<const char*> phases_{"motion", "update", "query"};
  std::vector<std::string> head_{"strategy", "motion", "update", "query"};
  bool has_steady_ = false, has_intervals_ = false, has_ranges_ = false;
};

void Table::head_lines() {
  const json& scene = records_[0].at("scene");
  const char* const step = scene.value("continuous", false) ? "interval" : "frame";
  text_ = fmt::format("{}, l = {}, {}: {}, {}", scene.at("name").get<std::string>(),
                      scene.at("per_keyframe").get<std::uint64_t>(), scene.at("scalar").get<std::string>(),
                      counted(scene.at("frames").get<std::uint64_t>(), step),
                      counted(scene.at("primitives").get<std::uint64_t>(), "primitive"));
  std::size_t least = SIZE_MAX, most = 0;
  for (std::size_t i = 0; i < records_.size(); ++i) {
    if (!has_times(records_[i])) continue;
    least = std::min(least, times_[i].repetitions());
    most = std::max(most, times_[i].repetitions());
  }
  if (most > 0)
    text_ += ", " + (least == most ? "" : std::to_string(least) + " to ") + counted(most, "repetition");
  text_ += truth_of(records_, scene, step) + "\n";
  if (scene.contains("script")) {
    const json& script = scene.at("script");
    text_ += fmt::format("  plans change while it runs: {} at {}, column plans\n",
                         counted(script.at("changes").get<std::uint64_t>(), "change"),
                         counted(script.at("steps").get<std::uint64_t>(), "frame"));
    phases_.push_back("plan_changes");
    head_.push_back("plans");
  }
  const json bodies = scene.value("bodies", json::array());
  for (const std::string kind : {"points", "control_nets"})
    if (std::any_of(bodies.begin(), bodies.end(),
                    [&](const json& body) { return body.value("kind", std::string()) == kind; }))
      text_ += fmt::format("  pairs with {} are candidates: overlapping boxes, without a test of contact\n",
                           kind == "points" ? "points" : "control nets");
}

void Table::choose_columns() {
  if (records_[0].at("scene").contains("changes")) head_.push_back("changes");
  for (std::size_t i = 0; i < records_.size(); ++i) {
    has_steady_ = has_steady_ || times_[i].steady_from.has_value();
    if (refit_times_ == nullptr || times_[i].repetitions() < 2 || &records_[i] == refit_) continue;
    const std::size_t fewest = std::min(times_[i].repetitions(), refit_times_->repetitions());
    (fewest >= fewest_of_an_interval ? has_intervals_ : has_ranges_) = true;
  }
  head_.push_back("code");
  head_.push_back("x refit");
  if (has_intervals_ || has_ranges_)
    head_.push_back(!has_ranges_ ? "95 % interval" : !has_intervals_ ? "range" : "interval or [range]");
  head_.push_back("with motion");
  if (has_steady_) head_.push_back("steady");
  head_.push_back("paid from");
  for (const char* column : {"missed", "extra", "protrusion", "looseness"}) head_.push_back(column);
}

std::string Table::ratio_cell(std::size_t i, const char* phase, Part part) const {
  if (refit_times_ == nullptr) return "-";
  const auto ratio = ratio_of({*refit_times_, phase}, {times_[i], phase}, part);
  if (!ratio) return "-";
  const bool doubtful = !disturbed(records_[i]).empty() || !disturbed(*refit_).empty();
  return fmt::format("{:.3g}{}", ratio->middle, doubtful ? "?" : "");
}

std::string Table::within_cell(std::size_t i) const {
  if (refit_times_ == nullptr || &records_[i] == refit_) return "-";
  const auto ratio = ratio_of({*refit_times_, "total"}, {times_[i], "total"});
  if (!ratio || !ratio->within) return "-";
  const std::string text = fmt::format("{:.3g} to {:.3g}", ratio->within->low, ratio->within->high);
  return has_intervals_ && !ratio->within->is_interval ? "[" + text + "]" : text;
}

std::string Table::paid_cell(std::size_t i) const {
  if (refit_ == nullptr || &records_[i] == refit_) return "-";
  const json &own = records_[i].at("times"), &other = refit_->at("times");
  if (!own.contains("build_ms") || !other.contains("build_ms")) return "-";
  const auto frame = paid_from(times_[i], own.at("build_ms").get<double>(), *refit_times_,
                               other.at("build_ms").get<double>());
  return frame ? std::to_string(*frame) : "never";
}

void Table::ratio_cells(std::size_t i, std::vector<std::string>& row) {
  row.push_back(ratio_cell(i, "total", Part::clip));
  if (has_intervals_ || has_ranges_) row.push_back(within_cell(i));
  row.push_back(ratio_cell(i, "total_with_motion", Part::clip));
  if (has_steady_) row.push_back(ratio_cell(i, "total", Part::steady));
  row.push_back(paid_cell(i));
}

std::vector<std::string> Table::row(std::size_t i) {
  const json &record = records_[i], &verified = record.at("verified");
  const std::string label = record.at("strategy").at("label").get<std::string>();
  std::vector<std::string> row{label};
  if (has_times(record)) {
    for (const char* phase : phases_) row.push_back(milliseconds(time_of(times_[i], phase)));
    if (record.at("scene").contains("changes")) row.push_back(changes_per_frame(record));
    row.push_back(instructions_of(record));
    ratio_cells(i, row);
  } else {
    row.push_back("refused");
    row.resize(head_.size() - 4);
    below_ += "  " + label + " is refused a time: " + record.value("refused", std::string()) + "\n";
  }
  row.push_back(std::to_string(verified.at("missed").get<std::uint64_t>()));
  row.push_back(std::to_string(verified.at("extra").get<std::uint64_t>()));
  const bool audited = verified.at("audited").get<bool>();
  row.push_back(audited ? fraction(verified.at("protrusion").get<double>()) : "-");
  row.push_back(audited ? fraction(verified.at("looseness").get<double>()) : "-");
  return row;
}

/// Says whether the machine was quiet, as far as the records know.
void Table::disturbances() {
  std::string reasons;
  bool known = false;
  for (const json& record : records_) {
    known = known || (has_times(record) && record.at("times").contains("disturbed"));
    if (const std::string why = disturbed(record); !why.empty())
      reasons += "  ? disturbed: " + record.at("strategy").at("label").get<std::string>() + ": " + why + "\n";
  }
  if (known) text_ += reasons.empty() ? "  quiet\n" : reasons;
}

std::string Table::text() {
  head_lines();
  choose_columns();
  std::vector<std::vector<std::string>> rows{head_};
  std::string choices, counted_by;
  std::vector<std::string> peers;
  std::set<std::string> runs;
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const json& record = records_[i];
    const std::string label = record.at("strategy").at("label").get<std::string>();
    rows.push_back(row(i));
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
    runs.insert(record.value("run", std::string()));
  }
  text_ += columns(rows);
  if (refit_ != nullptr)
    text_ += "  x refit and with motion: against " + refit_->at("strategy").at("label").get<std::string>() +
             ", the baseline with the shortest clip\n";
  for (const std::string& peer : peers) text_ += peer + "\n";
  text_ += below_ + choices + counted_by;
  disturbances();
  if (runs.size() > 1) text_ += "  (from several runs: the machine may have differed)\n";
  return text_;
}

}  // namespace

std::string results_table(const std::vector<json>& records) {
  return records.empty() ? std::string() : Table(records).text();
}

}  // namespace kbvh::experiments
