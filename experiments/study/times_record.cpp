#include "experiments/study/times_record.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "experiments/study/measure.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr double ms = 1e3;

/// The number of equal parts of a clip whose times are recorded.
constexpr std::size_t time_parts = 16;

PhaseTimes in_ms(const PhaseTimes& seconds) {
  return {ms * seconds.motion,         ms * seconds.update,       ms * seconds.traversal,
          ms * seconds.triangle_tests, ms * seconds.plan_changes, ms * seconds.geometry_changes};
}

/// Rounds to 5 digits, so that records stay readable.
double rounded(double value) {
  if (!(value > 0)) return 0;
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 4);
  // A division by a power of ten gives the shortest text.
  return unit < 1 ? std::round(value / unit) / std::round(1 / unit) : std::round(value / unit) * unit;
}

json rounded(const std::vector<double>& values) {
  json list = json::array();
  for (const double value : values) list.push_back(rounded(value));
  return list;
}

/// Makes the phases of a number of frames, as means per frame.
json phases_record(const PhaseTimes& sum, std::size_t frames) {
  const auto mean = [&](double phase) { return phase / double(frames); };
  return {{"motion", mean(sum.motion)},
          {"update", mean(sum.update)},
          {"traversal", mean(sum.traversal)},
          {"triangle_tests", mean(sum.triangle_tests)},
          {"plan_changes", mean(sum.plan_changes)},
          {"geometry_changes", mean(sum.geometry_changes)}};
}

/// Reads means per frame as sums over frames.
PhaseTimes phases_of(const json& means, std::size_t frames) {
  const auto sum = [&](const char* name) { return means.value(name, 0.0) * double(frames); };
  return {sum("motion"),         sum("update"),       sum("traversal"),
          sum("triangle_tests"), sum("plan_changes"), sum("geometry_changes")};
}

/// Returns the smallest of the sorted values that at least this share of them does not exceed.
double quantile(const std::vector<double>& sorted, double share) {
  const auto rank = std::size_t(std::ceil(share * double(sorted.size())));
  return sorted[std::max<std::size_t>(rank, 1) - 1];
}

std::vector<double> sorted_totals(const ClipTimes& clip) {
  std::vector<double> totals;
  for (const PhaseTimes& frame : clip.frames) totals.push_back(ms * frame.total());
  std::sort(totals.begin(), totals.end());
  return totals;
}

/// Makes the clip in equal parts, so that the ageing of a structure is visible.
json parts_record(const ClipTimes& clip) {
  const std::size_t frames = clip.frames.size(), parts = std::min(time_parts, frames);
  json over_time = json::array();
  for (std::size_t part = 0; part < parts; ++part) {
    const std::size_t begin = part * frames / parts, end = (part + 1) * frames / parts;
    PhaseTimes sum;
    for (std::size_t f = begin; f < end; ++f) sum += clip.frames[f];
    over_time.push_back({{"begin", double(begin) / double(frames)},
                         {"update", ms * sum.update / double(end - begin)},
                         {"query", ms * sum.query() / double(end - begin)}});
  }
  return over_time;
}

/// Several threads, requested or observed at work: single frames have no times of their own.
By counted_by(const Measured& measured) {
  Effort effort;
  for (const ClipTimes& clip : measured.repetitions) effort += clip.effort;
  bool asked = false;
  if (measured.spec != nullptr)
    if (const auto given = measured.spec->params.find("threads"); given != measured.spec->params.end())
      asked = given->second != "1";
  return asked || effort.several_threads() ? By::clips : By::frames;
}

}  // namespace

RawTimes raw_times(const Measured& measured, const std::string& session) {
  RawTimes times;
  times.session = session;
  times.steady_from = measured.steady_from;
  times.by = counted_by(measured);
  for (const ClipTimes& clip : measured.repetitions) {
    std::vector<double>&totals = times.totals.emplace_back(), &motions = times.motions.emplace_back();
    for (const PhaseTimes& frame : clip.frames) {
      totals.push_back(ms * frame.total());
      motions.push_back(ms * frame.motion);
    }
    times.clip.push_back(in_ms(clip.sum()));
    if (measured.steady_from) times.steady.push_back(in_ms(clip.sum(*measured.steady_from)));
  }
  return times;
}

RawTimes raw_times(const json& record) {
  const json& times = record.at("times");
  RawTimes raw;
  raw.session = record.value("run", std::string());
  bool of_frames = true;
  for (const json& one : times.at("repetitions")) of_frames = of_frames && one.contains("totals");
  raw.by = of_frames && times.value("by", "frames") == "frames" ? By::frames : By::clips;
  if (of_frames && times.contains("steady_from") && times.at("steady_from").is_number_unsigned())
    raw.steady_from = times.at("steady_from").get<std::size_t>();
  for (const json& one : times.at("repetitions")) {
    if (of_frames) {
      raw.totals.push_back(one.at("totals").get<std::vector<double>>());
      raw.motions.push_back(one.at("motions").get<std::vector<double>>());
    } else {
      const PhaseTimes mean = phases_of(one, 1);
      raw.totals.push_back({mean.total()});
      raw.motions.push_back({mean.motion});
    }
    raw.clip.push_back(phases_of(one, raw.frames()));
    if (raw.steady_from) raw.steady.push_back(phases_of(one.at("steady"), raw.frames() - *raw.steady_from));
  }
  return raw;
}

json times_record(const Measured& measured) {
  const RawTimes raw = raw_times(measured, {});
  json repetitions = json::array();
  Effort effort;
  for (std::size_t r = 0; r < raw.repetitions(); ++r) {
    const ClipTimes& clip = measured.repetitions[r];
    json one = phases_record(raw.clip[r], raw.frames());
    const std::vector<double> totals = sorted_totals(clip);
    one["round"] = clip.round;
    one["place"] = clip.place;
    one["totals"] = rounded(raw.totals[r]);
    one["motions"] = rounded(raw.motions[r]);
    one["p99"] = quantile(totals, 0.99);
    one["worst"] = totals.back();
    one["reset"] = {{"motion", ms * clip.start.motion}, {"update", ms * clip.start.update}};
    if (raw.steady_from) one["steady"] = phases_record(raw.steady[r], raw.frames() - *raw.steady_from);
    one["effort"] = {{"wall", ms * clip.effort.wall},     {"processor", ms * clip.effort.processor},
                     {"thread", ms * clip.effort.thread}, {"switches", clip.effort.switches},
                     {"steal", ms * clip.effort.steal},   {"others", ms * clip.effort.others}};
    repetitions.push_back(std::move(one));
    effort += clip.effort;
  }
  std::vector<std::size_t> order(raw.repetitions());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return measured.repetitions[a].total() < measured.repetitions[b].total();
  });
  const ClipTimes& median = measured.repetitions[order[(order.size() - 1) / 2]];
  const std::vector<double> totals = sorted_totals(median);
  json record{{"unit", "ms"},
              {"frames", raw.frames()},
              {"by", raw.by == By::clips ? "clips" : "frames"},
              {"steady_from", nullptr},
              {"disturbed", disturbance(effort)},
              {"repetitions", repetitions},
              {"total_p50", quantile(totals, 0.5)},
              {"total_p99", quantile(totals, 0.99)},
              {"total_worst", totals.back()},
              {"build_ms", ms * measured.build_seconds},
              {"over_time", parts_record(median)}};
  if (raw.steady_from) record["steady_from"] = *raw.steady_from;
  return record;
}

}  // namespace kbvh::experiments
