#include "experiments/results/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "experiments/common/text.hpp"
#include "experiments/study/best_refit.hpp"
#include "experiments/study/times_record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns the width in characters, not bytes, of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return std::size_t(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

std::string columns(const std::vector<std::vector<std::string>>& rows, std::size_t longest) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c >= widths.size()) widths.push_back(0);
      widths[c] = std::max(widths[c], width_of(row[c]));
    }
  std::size_t others = 0;
  for (std::size_t c = 1; c < widths.size(); ++c) others += 2 + widths[c];
  if (!widths.empty() && widths[0] + others > longest) {
    const std::size_t room = std::max<std::size_t>(longest - std::min(longest, others), 8);
    widths[0] = 0;
    for (const auto& row : rows)
      if (!row.empty() && width_of(row[0]) <= room) widths[0] = std::max(widths[0], width_of(row[0]));
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c == 0 && width_of(row[0]) > widths[0]) {
        text += row[0] + "\n";
        line = std::string(widths[0], ' ');
        continue;
      }
      const std::string padding(widths[c] - width_of(row[c]), ' ');
      line += (c == 0 ? "" : "  ") + (c == 0 ? row[c] + padding : padding + row[c]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string wrapped(const std::string& text, const std::string& indent, std::size_t longest) {
  std::string lines, line = indent;
  bool empty = true;
  for (const std::string& word : split(text, ' ')) {
    if (!empty && width_of(line) + 1 + width_of(word) > longest) {
      lines += line + "\n";
      line = indent + "  ";
      empty = true;
    }
    line += (empty ? "" : " ") + word;
    empty = false;
  }
  return lines + line + "\n";
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
  if (!has_times(record)) return {};
  return doubts(raw_times(record), record.at("times").value("disturbed", std::string()));
}

namespace {
std::optional<RawTimes> times_of(const json& record) {
  return has_times(record) ? std::optional(raw_times(record)) : std::nullopt;
}
}  // namespace

bool is_baseline(const json& record) {
  const json& strategy = record.at("strategy");
  // Records from before baselines were declared: the family decides.
  const auto declared = strategy.find("baseline");
  return declared == strategy.end() ? strategy.at("family") == "refit" : declared->get<bool>();
}

const json* shortest_clip(const std::vector<const json*>& records) {
  std::vector<std::optional<RawTimes>> times;
  for (const json* record : records) times.push_back(times_of(*record));
  std::vector<const RawTimes*> known;
  for (const auto& one : times) known.push_back(one ? &*one : nullptr);
  const auto best = shortest_clip(known);
  return best ? records[*best] : nullptr;
}

const json* best_refit(const std::vector<json>& records) {
  std::vector<std::optional<RawTimes>> times;
  for (const json& record : records) times.push_back(times_of(record));
  std::vector<RefitCandidate> table;
  for (std::size_t i = 0; i < records.size(); ++i)
    table.push_back({times[i] ? &*times[i] : nullptr, is_baseline(records[i]),
                     records[i].at("strategy").value("guarantee", "") == "approximate"});
  const auto best = best_refit(table);
  return best ? &records[*best] : nullptr;
}

std::string instructions_of(const json& record) {
  const json& strategy = record.at("strategy");
  if (const std::string own = strategy.value("instructions", ""); !own.empty()) return own;
  const std::string chosen = strategy.value("params", json::object()).value("kernels", "auto");
  if (chosen != "auto") return chosen;
  return record.value("machine", json::object()).value("kernels", "-");
}

}  // namespace kbvh::experiments
