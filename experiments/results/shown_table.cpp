// The tables that a person reads while a study runs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "core/base/counters.hpp"
#include "experiments/common/text.hpp"
#include "experiments/results/table.hpp"
#include "experiments/study/resamples.hpp"
#include "experiments/study/times_record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Of more contestants, a table shows the fastest of each family.
constexpr std::size_t few = 12;

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

/// Returns whether the scene was asked from outside: for rays, or near points.
bool asks_probes(const json& scene) {
  return scene.contains("rays") || scene.contains("within");
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
  const char* const noun = asks_probes(scene)                 ? "true hit"
                           : scene.value("continuous", false) ? "true contact"
                                                              : "true pair";
  return ", " + counted(found, noun) + " in " + counted(most, "compared " + step);
}

std::string fraction(double value) {
  return value == 0 ? "0" : fmt::format("{:.3g}", value);
}

std::string label_of(const json& record) {
  return record.at("strategy").at("label").get<std::string>();
}

std::string family_of(const json& record) {
  return record.at("strategy").value("family", std::string());
}

std::uint64_t verified_count(const json& record, const char* what) {
  return record.at("verified").at(what).get<std::uint64_t>();
}

/// The records of one table, with the ratios to the best refit.
class Table {
 public:
  Table(const std::vector<json>& records, Shown shown)
      : records_(records), refit_(best_refit(records)), shown_(shown) {
    for (const json& record : records) times_.push_back(has_times(record) ? raw_times(record) : RawTimes{});
    for (std::size_t i = 0; i < records.size(); ++i) {
      resamples_.emplace_back(times_[i]);
      if (&records[i] == refit_) refit_place_ = i;
    }
  }

  std::string text();

 private:
  using Rows = std::vector<std::vector<std::string>>;
  void head_lines();
  void order();
  void keep_the_fastest();
  Rows speeds() const;
  Rows details() const;
  std::optional<RatioOfTimes> ratio(std::size_t i, const char* phase, Part part = Part::clip) const;
  std::string paid_cell(std::size_t i) const;
  std::string ratio_cell(std::size_t i, const char* phase, Part part) const;
  std::string within_cell(std::size_t i, bool beside_intervals) const;
  void notes();
  void disturbances();

  const std::vector<json>& records_;
  const json* refit_;
  const Shown shown_;
  std::vector<RawTimes> times_;
  mutable std::vector<Resamples> resamples_;  // of times_
  std::optional<std::size_t> refit_place_;
  std::vector<std::size_t> rows_;  // of the records, the fastest first, those without times last
  std::map<std::string, std::size_t> family_sizes_;
  std::string text_;
  bool has_plans_ = false;
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
  text_ += truth_of(records_, scene, step);
  text_ = wrapped(text_, "");
  if (scene.contains("script")) {
    const json& script = scene.at("script");
    text_ += fmt::format("  plans change while it runs: {} at {}, column plans\n",
                         counted(script.at("changes").get<std::uint64_t>(), "change"),
                         counted(script.at("steps").get<std::uint64_t>(), "frame"));
    has_plans_ = true;
  }
  const json bodies = scene.value("bodies", json::array());
  for (const std::string kind : {"points", "control_nets"})
    if (std::any_of(bodies.begin(), bodies.end(),
                    [&](const json& body) { return body.value("kind", std::string()) == kind; }))
      text_ += fmt::format("  pairs with {} are candidates: overlapping boxes, without a test of contact\n",
                           kind == "points" ? "points" : "control nets");
}

/// Sorts by the ratio to the best refit; without one by the time of update and query.
void Table::order() {
  std::vector<double> key(records_.size(), -HUGE_VAL);
  for (std::size_t i = 0; i < records_.size(); ++i) {
    ++family_sizes_[family_of(records_[i])];
    if (!has_times(records_[i])) continue;
    key[i] = -time_of(times_[i], "total");
    if (!refit_place_) continue;
    const auto of_total = ratio(i, "total");
    key[i] = of_total ? of_total->middle : 0;
  }
  rows_.resize(records_.size());
  std::iota(rows_.begin(), rows_.end(), std::size_t(0));
  std::stable_sort(rows_.begin(), rows_.end(), [&](std::size_t a, std::size_t b) { return key[a] > key[b]; });
}

/// Keeps the best refit and of each family its first, exact before approximate.
void Table::keep_the_fastest() {
  const auto is_exact = [&](std::size_t i) {
    return has_times(records_[i]) && records_[i].at("strategy").value("guarantee", "") != "approximate";
  };
  std::set<std::size_t> kept;
  for (const auto& [family, size] : family_sizes_) {
    const auto first = [&](const auto& suits) {
      return std::find_if(rows_.begin(), rows_.end(),
                          [&](std::size_t i) { return family_of(records_[i]) == family && suits(i); });
    };
    auto best = first(is_exact);
    if (best == rows_.end()) best = first([](std::size_t) { return true; });
    kept.insert(*best);
  }
  std::erase_if(rows_, [&](std::size_t i) { return kept.count(i) == 0 && &records_[i] != refit_; });
}

/// Returns the best refit's time over that of a record; nothing without one of them.
std::optional<RatioOfTimes> Table::ratio(std::size_t i, const char* phase, Part part) const {
  if (!refit_place_) return {};
  return ratio_of(resamples_[*refit_place_], resamples_[i], phase, part);
}

std::string Table::ratio_cell(std::size_t i, const char* phase, Part part) const {
  const auto found = ratio(i, phase, part);
  if (!found) return "-";
  const bool doubtful = !disturbed(records_[i]).empty() || !disturbed(*refit_).empty();
  return fmt::format("{:.3g}{}", found->middle, doubtful ? "?" : "");
}

std::string Table::within_cell(std::size_t i, bool beside_intervals) const {
  if (&records_[i] == refit_) return "-";
  const auto found = ratio(i, "total");
  if (!found || !found->within) return "-";
  const std::string text = fmt::format("{:.3g} to {:.3g}", found->within->low, found->within->high);
  return beside_intervals && !found->within->is_interval ? "[" + text + "]" : text;
}

std::string Table::paid_cell(std::size_t i) const {
  if (refit_ == nullptr || &records_[i] == refit_) return "-";
  const json &own = records_[i].at("times"), &other = refit_->at("times");
  if (!own.contains("build_ms") || !other.contains("build_ms")) return "-";
  const auto frame = paid_from(times_[i], own.at("build_ms").get<double>(), times_[*refit_place_],
                               other.at("build_ms").get<double>());
  return frame ? std::to_string(*frame) : "never";
}

/// The table that answers who is fast: the ratio first.
Table::Rows Table::speeds() const {
  bool intervals = false, ranges = false, missed = false, extra = false, changes = false;
  for (const std::size_t i : rows_) {
    missed = missed || verified_count(records_[i], "missed") > 0;
    extra = extra || verified_count(records_[i], "extra") > 0;
    changes = changes || records_[i].at("scene").contains("changes");
    if (!refit_place_ || times_[i].repetitions() < 2 || &records_[i] == refit_) continue;
    const std::size_t fewest = std::min(times_[i].repetitions(), times_[*refit_place_].repetitions());
    (fewest >= fewest_of_an_interval ? intervals : ranges) = true;
  }
  Rows rows{{"strategy", "x refit"}};
  if (intervals || ranges)
    rows[0].push_back(!ranges ? "95 % interval" : !intervals ? "range" : "interval or [range]");
  std::vector<const char*> phases{"update", "query", "motion"};
  rows[0].insert(rows[0].end(), phases.begin(), phases.end());
  if (has_plans_) {
    phases.push_back("plan_changes");
    rows[0].push_back("plans");
  }
  if (changes) rows[0].push_back("changes");
  if (missed) rows[0].push_back("missed");
  if (extra) rows[0].push_back("extra");
  rows[0].push_back("family");
  for (const std::size_t i : rows_) {
    const json& record = records_[i];
    std::vector<std::string> row{label_of(record)};
    const bool timed = has_times(record);
    row.push_back(timed ? ratio_cell(i, "total", Part::clip) : "refused");
    if (intervals || ranges) row.push_back(timed ? within_cell(i, intervals) : "");
    for (const char* phase : phases) row.push_back(timed ? milliseconds(time_of(times_[i], phase)) : "");
    if (changes) row.push_back(timed ? changes_per_frame(record) : "");
    if (missed) row.push_back(std::to_string(verified_count(record, "missed")));
    if (extra) row.push_back(std::to_string(verified_count(record, "extra")));
    const std::string family = family_of(record);
    row.push_back(rows_.size() == records_.size()
                      ? family
                      : fmt::format("{}, of {}", family, family_sizes_.at(family)));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// What else is known about the same rows.
Table::Rows Table::details() const {
  const bool steady = std::any_of(times_.begin(), times_.end(),
                                  [](const RawTimes& times) { return times.steady_from.has_value(); });
  Rows rows{{"strategy", "with motion"}};
  if (steady) rows[0].push_back("steady");
  for (const char* column : {"paid from", "missed", "extra", "protrusion", "looseness", "code"})
    rows[0].push_back(column);
  for (const std::size_t i : rows_) {
    const json &record = records_[i], &verified = record.at("verified");
    const bool timed = has_times(record), audited = verified.at("audited").get<bool>();
    std::vector<std::string> row{label_of(record)};
    row.push_back(timed ? ratio_cell(i, "total_with_motion", Part::clip) : "");
    if (steady) row.push_back(timed ? ratio_cell(i, "total", Part::steady) : "");
    row.push_back(timed ? paid_cell(i) : "");
    row.push_back(std::to_string(verified_count(record, "missed")));
    row.push_back(std::to_string(verified_count(record, "extra")));
    row.push_back(audited ? fraction(verified.at("protrusion").get<double>()) : "-");
    row.push_back(audited ? fraction(verified.at("looseness").get<double>()) : "-");
    row.push_back(instructions_of(record));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Says what a reader must know of the rows above.
void Table::notes() {
  const auto note = [this](const std::string& text) { text_ += wrapped(text, "  "); };
  if (rows_.size() < records_.size())
    note(fmt::format("the best refit and the fastest of each family; --names shows all {}", records_.size()));
  if (refit_ != nullptr)
    note("x refit: against " + label_of(*refit_) + ", the baseline with the shortest clip");
  std::set<std::string> runs;
  std::vector<std::string> said;
  for (const json& record : records_) {
    runs.insert(record.value("run", std::string()));
    if (!has_times(record))
      note(label_of(record) + " is refused a time: " + record.value("refused", std::string()));
  }
  for (const std::size_t i : rows_) {
    const json& strategy = records_[i].at("strategy");
    std::string peer = strategy.value("version", "");
    if (peer.empty()) continue;
    peer = strategy.at("id").get<std::string>() + " is " + peer;
    // Remarks are about pairs.
    if (const std::string remark = strategy.value("remark", "");
        !remark.empty() && !asks_probes(records_[i].at("scene")))
      peer += ": " + remark;
    if (std::find(said.begin(), said.end(), peer) != said.end()) continue;
    said.push_back(peer);
    note(peer);
  }
  for (const std::size_t i : rows_)
    if (records_[i].contains("choice"))
      note(label_of(records_[i]) + " chose " + records_[i].at("choice").get<std::string>());
  if (shown_ == Shown::all)
    for (const std::size_t i : rows_)
      if (const std::string own = own_counters(records_[i]); !own.empty())
        note(label_of(records_[i]) + " counted " + own);
  disturbances();
  if (runs.size() > 1) note("(from several runs: the machine may have differed)");
}

/// Says whether the machine was quiet, as far as the records know.
void Table::disturbances() {
  std::vector<std::string> reasons;
  std::size_t known = 0;
  for (const std::size_t i : rows_)
    if (const std::string why = disturbed(records_[i]); !why.empty())
      reasons.push_back(label_of(records_[i]) + ": " + why);
  std::size_t count = 0;
  for (const json& record : records_) {
    if (has_times(record) && record.at("times").contains("disturbed")) ++known;
    if (!disturbed(record).empty()) ++count;
  }
  if (count == 0) {
    if (known > 0) text_ += "  quiet\n";
    return;
  }
  if (rows_.size() < records_.size()) {
    text_ += wrapped(fmt::format("? disturbed: {} of {}{}", count, counted(known, "contestant"),
                                 reasons.empty() ? "" : ", among them " + reasons.front()),
                     "  ");
    return;
  }
  for (const std::string& reason : reasons) text_ += wrapped("? disturbed: " + reason, "  ");
}

std::string Table::text() {
  head_lines();
  order();
  if (shown_ == Shown::fastest && records_.size() > few) keep_the_fastest();
  text_ += columns(speeds(), longest_line);
  if (shown_ == Shown::all) text_ += "\n" + columns(details(), longest_line);
  notes();
  return text_;
}

}  // namespace

std::string results_table(const std::vector<json>& records, Shown shown) {
  return records.empty() ? std::string() : Table(records, shown).text();
}

}  // namespace kbvh::experiments
