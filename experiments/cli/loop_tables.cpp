#include "experiments/cli/loop_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include "core/base/median.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns the largest memory in the first tenth of the steps and in the last one, in MB: what a run needs at
/// first, and whether it needs more and more.
std::string memory_text(std::span<const LiveStep> steps) {
  if (steps.empty()) return "-";
  const std::size_t tenth = (steps.size() + 9) / 10;
  const auto largest = [](std::span<const LiveStep> part) {
    double megabytes = 0;
    for (const LiveStep& step : part) megabytes = std::max(megabytes, step.resident_mb);
    return megabytes;
  };
  return fmt::format("{:.1f}, {:.1f}", largest(steps.first(tenth)), largest(steps.last(tenth)));
}

/// Returns a number of each step.
template <class Of>
std::vector<double> each_of(std::span<const LiveStep> steps, const Of& of) {
  std::vector<double> list;
  for (const LiveStep& step : steps) list.push_back(of(step));
  return list;
}
double detection_of(const LiveStep& step) {
  return step.detect_ms;
}
double others_of(const LiveStep& step) {
  return step.impact_ms + step.rest_ms;
}
double whole_of(const LiveStep& step) {
  return step.whole_ms();
}

double sum_of(const std::vector<double>& list) {
  double sum = 0;
  for (const double one : list) sum += one;
  return sum;
}
double largest_of(const std::vector<double>& list) {
  return list.empty() ? 0 : *std::max_element(list.begin(), list.end());
}
std::string ms_text(double ms) {
  return ms < 1000 ? fmt::format("{:.3g}", ms) : fmt::format("{:.0f}", ms);
}
std::string median_text(std::vector<double> list) {
  return list.empty() ? "-" : ms_text(median_of_times(list));
}
std::string mean_text(double sum, std::size_t steps) {
  return steps == 0 ? "-" : fmt::format("{:.4g}", sum / double(steps));
}

/// Returns the first step that both made and after which their states differ.
std::optional<std::size_t> first_difference(const LiveSteps& a, const LiveSteps& b) {
  for (std::size_t i = 0; i < std::min(a.each.size(), b.each.size()); ++i)
    if (a.each[i].state != b.each[i].state) return i + 1;
  return {};
}

/// Returns the run with which the others are compared: the first exact one, else the first.
const LiveRun& reference_of(const std::vector<LiveRun>& runs) {
  for (const LiveRun& one : runs)
    if (one.finder.exact) return one;
  return runs.front();
}

void print_one(const LiveStudy& study, const LiveRun& one) {
  const LiveSteps& steps = one.steps;
  const std::size_t n = steps.each.size();
  const auto mean_of = [&](double LiveStep::*time) {
    return mean_text(sum_of(each_of(steps.each, [&](const LiveStep& step) { return step.*time; })), n);
  };
  std::string found_by = one.finder.label;
  if (one.finder.strategy.id.empty()) found_by += std::string(", ") + loop::name(study.simulation.detection);
  print(columns({{"of " + study.title, ""},
                 {"pairs found by", found_by},
                 {"steps", std::to_string(one.result.state.step)},
                 {"penetrations", std::to_string(one.result.penetrations)},
                 {"stalled steps", std::to_string(one.result.stalled)},
                 {"unconverged steps", std::to_string(one.result.unconverged)},
                 {"most contacts", std::to_string(steps.most_contacts)},
                 {"smallest gap, mm", fmt::format("{:.3g}", 1e3 * steps.smallest_gap)},
                 {"largest lag, mm", fmt::format("{:.3g}", 1e3 * steps.largest_lag)},
                 {"iterates", mean_text(double(steps.iterates), n)},
                 {"orders", mean_text(double(steps.orders), n)},
                 {"searches", mean_text(double(steps.searches), n)},
                 {"candidates", mean_text(double(steps.candidates), n)},
                 {"detection, ms", mean_of(&LiveStep::detect_ms)},
                 {"impacts, ms", mean_of(&LiveStep::impact_ms)},
                 {"rest, ms", mean_of(&LiveStep::rest_ms)},
                 {"worst step, ms", fmt::format("{:.4g}", largest_of(each_of(steps.each, whole_of)))},
                 {"memory, MB", memory_text(steps.each)}}));
  print("From iterates on, numbers are means over the " + counted(n, "step") +
        ", but for the worst step and the largest\nmemory, in the first and in the last tenth of these "
        "steps.\n");
}

void print_several(const LiveStudy& study, const std::vector<LiveRun>& runs) {
  const LiveRun& reference = reference_of(runs);
  std::size_t common = std::numeric_limits<std::size_t>::max();
  for (const LiveRun& one : runs) common = std::min(common, one.steps.each.size());
  const auto of_common = [&](const LiveRun& one) {
    return std::span<const LiveStep>(one.steps.each).first(common);
  };
  const auto detection = [&](const LiveRun& one) { return each_of(of_common(one), detection_of); };
  double refit = 0;
  for (const LiveRun& one : runs) {
    if (!one.finder.baseline || common == 0) continue;
    const double sum = sum_of(detection(one));
    if (refit == 0 || sum < refit) refit = sum;
  }
  std::vector<std::vector<std::string>> table{{"of " + study.title, "steps", "detection, ms", "over refit",
                                               "rest", "worst", "memory, MB", "penetrations", "states"}};
  for (const LiveRun& one : runs) {
    const std::vector<double> times = detection(one);
    const double sum = sum_of(times);
    const auto differs = first_difference(reference.steps, one.steps);
    table.push_back({one.finder.label, std::to_string(one.steps.each.size()),
                     median_text(times) + ", " + ms_text(largest_of(times)),
                     refit > 0 && sum > 0 ? fmt::format("{:.2f}", refit / sum) : "-",
                     median_text(each_of(of_common(one), others_of)),
                     ms_text(largest_of(each_of(of_common(one), whole_of))), memory_text(one.steps.each),
                     std::to_string(one.result.penetrations),
                     &one == &reference ? "-"
                     : differs          ? "differ at " + std::to_string(*differs)
                                        : "equal"});
  }
  print(columns(table, longest_line));
  print(
      "Times in ms, of the first " + counted(common, "step") +
      ", which all made. Detection: median and worst step. Over refit:\n"
      "detection of the table's fastest refit over that of the line, in all these steps. Rest: all but\n"
      "detection, median; worst: the longest whole step. Memory: of the program, the most in the first and\n"
      "in the last tenth of a line's steps. States: those after every step, compared with those of\n" +
      reference.finder.label + ".\n");
}

}  // namespace

void LiveSteps::add(const json& record) {
  const double gap = record.at("smallest_gap_m");
  smallest_gap = each.empty() ? gap : std::min(smallest_gap, gap);
  largest_lag = std::max(largest_lag, record.at("lag_m").get<double>());
  most_contacts = std::max(most_contacts, record.at("contacts").get<std::uint64_t>());
  iterates += record.at("iterates").get<std::uint64_t>();
  orders += record.at("orders").get<std::uint64_t>();
  searches += record.at("searches").get<std::uint64_t>();
  candidates += record.at("candidates").get<std::uint64_t>();
  LiveStep step;
  step.state = std::stoull(record.at("state").get<std::string>(), nullptr, 16);
  step.detect_ms = record.at("detect_ms").get<double>();
  step.impact_ms = record.at("impact_ms").get<double>();
  step.rest_ms = record.at("rest_ms").get<double>();
  step.resident_mb = record.at("resident_bytes").get<double>() / 1e6;
  each.push_back(step);
}

void print_runs(const LiveStudy& study, const std::vector<LiveRun>& runs) {
  if (runs.size() == 1)
    print_one(study, runs.front());
  else
    print_several(study, runs);
}

int judge(const std::string& title, const std::vector<LiveRun>& runs) {
  int code = success;
  const LiveRun& reference = reference_of(runs);
  for (const LiveRun& one : runs) {
    std::string whose = title.empty() ? "" : title + ": ";
    if (runs.size() > 1) whose += one.finder.label + ": ";
    if (one.result.penetrations > 0) {
      say(whose + counted(one.result.penetrations, "pair") + " of triangles penetrated, first after step " +
          std::to_string(one.result.first_penetration));
      code = guarantee_broken;
    }
    if (one.result.too_near) {
      say(whose + "ended after step " + std::to_string(one.result.state.step) +
          ", which left two surfaces nearer than their thickness: a pair had been lost");
      code = guarantee_broken;
    }
    const auto differs = first_difference(reference.steps, one.steps);
    if (differs && one.finder.exact && reference.finder.exact) {
      say(whose + "another trajectory than " + reference.finder.label + ", from step " +
          std::to_string(*differs) + " on");
      code = guarantee_broken;
    }
  }
  return code;
}

void LiveTotals::add(const std::vector<LiveRun>& runs) {
  const LiveRun& reference = reference_of(runs);
  for (const LiveRun& one : runs) {
    const auto known = std::find_if(sums_.begin(), sums_.end(),
                                    [&](const auto& sum) { return sum.first == one.finder.label; });
    Sum& sum = known != sums_.end() ? known->second : sums_.emplace_back(one.finder.label, Sum{}).second;
    ++sum.simulations;
    sum.steps += one.steps.each.size();
    sum.penetrations += one.result.penetrations;
    sum.cut_short += one.result.too_near ? 1 : 0;
    sum.differing += first_difference(reference.steps, one.steps) ? 1 : 0;
    sum.worst_ms = std::max(sum.worst_ms, largest_of(each_of(one.steps.each, whole_of)));
  }
}

void LiveTotals::print_table() const {
  std::vector<std::vector<std::string>> table{
      {"of all", "simulations", "steps", "penetrations", "pairs lost", "other states", "worst step, ms"}};
  for (const auto& [label, sum] : sums_)
    table.push_back({label, std::to_string(sum.simulations), std::to_string(sum.steps),
                     std::to_string(sum.penetrations), std::to_string(sum.cut_short),
                     std::to_string(sum.differing), fmt::format("{:.4g}", sum.worst_ms)});
  print(columns(table, longest_line));
  print(
      "Pairs lost: simulations that ended after a step that left two surfaces nearer than their thickness.\n"
      "Other states: simulations with other states than those of the first exact line of their scene.\n");
}

}  // namespace kbvh::experiments
