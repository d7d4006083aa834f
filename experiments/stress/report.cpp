#include <cstdio>

#include "experiments/common/machine.hpp"
#include "experiments/results/table.hpp"
#include "experiments/stress/runner.hpp"

namespace kbvh::experiments::stress {

using nlohmann::json;

namespace {

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, value == 0 ? "%.0f" : "%.3g", value);
  return text;
}

std::vector<std::string> cells(const StressRow& row) {
  return {row.family,
          row.strategy,
          std::to_string(row.scenes),
          short_number(row.protrusion),
          short_number(row.relative_protrusion),
          row.audited > 0 ? short_number(row.looseness()) : "-",
          std::to_string(row.missed),
          std::to_string(row.extra),
          std::to_string(row.events),
          std::to_string(row.hangs),
          std::to_string(row.crashes),
          std::to_string(row.broken + row.threw),
          std::to_string(row.refused)};
}

const std::vector<std::string> head{"family",    "strategy", "scenes", "protrusion", "relative",
                                    "looseness", "missed",   "extra",  "events",     "hangs",
                                    "crashes",   "broken",   "refused"};

/// Sums the rows of each strategy over all families.
std::vector<StressRow> over_families(const std::vector<StressRow>& rows) {
  std::vector<StressRow> sums;
  for (const StressRow& row : rows) {
    StressRow* sum = nullptr;
    for (StressRow& known : sums)
      if (known.strategy == row.strategy) sum = &known;
    if (sum == nullptr) {
      sums.push_back(row);
      sums.back().family = "all";
      continue;
    }
    sum->add(row);
  }
  return sums;
}

}  // namespace

std::string stress_table(const StressReport& report) {
  std::vector<std::vector<std::string>> table{head};
  for (const StressRow& row : report.rows) table.push_back(cells(row));
  for (const StressRow& row : over_families(report.rows)) table.push_back(cells(row));
  return columns(table);
}

json options_record(const StressOptions& options) {
  json families = json::array(), strategies = json::array();
  for (const Family* family : options.families) families.push_back(family->name);
  for (const ContestantSpec& spec : options.contestants)
    strategies.push_back({{"label", spec.label}, {"params", spec.params}});
  return {{"scenes", options.scenes},
          {"seed", options.seed},
          {"scalars", options.scalars},
          {"l", options.l},
          {"vary", options.vary},
          {"shrink", options.shrink},
          {"many_keyframes", options.many_keyframes},
          {"seconds", options.limits.seconds},
          {"families", std::move(families)},
          {"strategies", std::move(strategies)}};
}

json to_json(const StressReport& report, const StressOptions& options) {
  json rows = json::array(), failures = json::array(), families = json::array();
  for (const Family* family : options.families)
    families.push_back({{"name", family->name}, {"meaning", family->meaning}});
  for (const StressRow& row : report.rows)
    rows.push_back({{"family", row.family},
                    {"strategy", row.strategy},
                    {"strategy_family", row.strategy_family},
                    {"approximate", row.approximate},
                    {"scenes", row.scenes},
                    {"frames", row.frames},
                    {"pairs", row.pairs},
                    {"protrusion", row.protrusion},
                    {"relative_protrusion", row.relative_protrusion},
                    {"looseness", row.audited > 0 ? json(row.looseness()) : json()},
                    {"looseness_worst", row.audited > 0 ? json(row.looseness_worst) : json()},
                    {"missed", row.missed},
                    {"extra", row.extra},
                    {"events", row.events},
                    {"hangs", row.hangs},
                    {"crashes", row.crashes},
                    {"broken", row.broken},
                    {"threw", row.threw},
                    {"refused", row.refused},
                    {"unsuitable", row.unsuitable},
                    {"seconds", row.seconds}});
  for (const StressFailure& failure : report.failures)
    failures.push_back({{"family", failure.repro.scene.family},
                        {"strategy", failure.repro.strategy},
                        {"scalar", failure.repro.scalar},
                        {"l", failure.l},
                        {"seed", failure.seed},
                        {"failure", failure.repro.failure},
                        {"file", failure.file},
                        {"triangles_before", failure.triangles_before},
                        {"triangles", failure.repro.scene.triangles()},
                        {"size_before", failure.size_before},
                        {"size", failure.repro.scene.size()}});
  return {{"schema", "kbvh-stress-1"}, {"commit", commit()},
          {"dirty", dirty()},          {"when", now_utc()},
          {"machine", machine()},      {"options", options_record(options)},
          {"played", report.played},   {"families", std::move(families)},
          {"rows", std::move(rows)},   {"failures", std::move(failures)}};
}

}  // namespace kbvh::experiments::stress
