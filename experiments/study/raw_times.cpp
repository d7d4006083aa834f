#include "experiments/study/raw_times.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "experiments/study/chance.hpp"

namespace kbvh::experiments {

namespace {

constexpr std::size_t draws = 200, left_out = draws / 40;

std::vector<Draw> resamples(std::size_t repetitions) {
  Chance chance(1);
  std::vector<Draw> all(draws, Draw(repetitions));
  for (Draw& draw : all)
    for (std::uint32_t& one : draw) one = chance.below(repetitions);
  return all;
}

/// Returns the median, for an even number of values the mean of the two middle ones. Changes their order.
double median_of(std::vector<double>& values) {
  const auto half = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  if (values.size() % 2 == 1) return *half;
  return 0.5 * (*std::max_element(values.begin(), half) + *half);
}

double sum_by(const std::vector<std::vector<double>>& table, std::size_t begin, By by,
              std::span<const std::uint32_t> draw) {
  std::vector<double> values(draw.size());
  if (by == By::clips) {
    for (std::size_t i = 0; i < draw.size(); ++i)
      values[i] = std::accumulate(table[draw[i]].begin() + std::ptrdiff_t(begin), table[draw[i]].end(), 0.0);
    return median_of(values);
  }
  double sum = 0;
  for (std::size_t f = begin; f < table[0].size(); ++f) {
    for (std::size_t i = 0; i < draw.size(); ++i) values[i] = table[draw[i]][f];
    sum += median_of(values);
  }
  return sum;
}

double median_sum(const std::vector<PhaseTimes>& sums, double PhaseTimes::*phase,
                  std::span<const std::uint32_t> draw) {
  std::vector<double> values;
  for (const std::uint32_t r : draw) values.push_back(sums[r].*phase);
  return median_of(values);
}

}  // namespace

Draw every_repetition(std::size_t repetitions) {
  Draw draw(repetitions);
  std::iota(draw.begin(), draw.end(), 0u);
  return draw;
}

double time_of(const RawTimes& times, std::string_view phase, Part part, By by,
               std::span<const std::uint32_t> draw) {
  if (!times.has(part) || draw.empty()) return 0;
  const std::size_t begin = part == Part::steady ? *times.steady_from : 0;
  const auto frames = double(times.frames() - begin);
  const auto motion = [&] { return sum_by(times.motions, begin, by, draw) / frames; };
  const auto total = [&] { return sum_by(times.totals, begin, by, draw) / frames; };
  if (phase == "motion") return motion();
  if (phase == "total") return total();
  if (phase == "total_with_motion") return total() + motion();
  const std::vector<PhaseTimes>& sums = part == Part::steady ? times.steady : times.clip;
  PhaseTimes middle;
  for (double PhaseTimes::*one : {&PhaseTimes::update, &PhaseTimes::traversal, &PhaseTimes::triangle_tests,
                                  &PhaseTimes::plan_changes, &PhaseTimes::geometry_changes})
    middle.*one = median_sum(sums, one, draw);
  const double changes = middle.plan_changes + middle.geometry_changes;
  const double share = phase == "update"             ? middle.update
                       : phase == "traversal"        ? middle.traversal
                       : phase == "triangle_tests"   ? middle.triangle_tests
                       : phase == "plan_changes"     ? middle.plan_changes
                       : phase == "geometry_changes" ? middle.geometry_changes
                       : phase == "query"            ? middle.query()
                       : phase == "upkeep"           ? middle.update + changes
                       : phase == "candidates"       ? middle.update + middle.traversal + changes
                                                     : 0;
  return middle.total() > 0 ? total() * share / middle.total() : 0;
}

double time_of(const RawTimes& times, std::string_view phase, Part part) {
  return time_of(times, phase, part, times.by, every_repetition(times.repetitions()));
}

std::vector<double> replicates(const RawTimes& times, std::string_view phase, Part part, By by) {
  std::vector<double> values;
  for (const Draw& draw : resamples(times.repetitions()))
    values.push_back(time_of(times, phase, part, by, draw));
  return values;
}

std::pair<double, double> middle_of_quotients(const std::vector<double>& above,
                                              const std::vector<double>& below, Rounds rounds) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < draws; ++i)
    ratios.push_back(above[i] / below[rounds == Rounds::same ? i : draws - 1 - i]);
  std::sort(ratios.begin(), ratios.end());
  return {ratios[left_out], ratios[ratios.size() - 1 - left_out]};
}

std::optional<RatioOfTimes> ratio_of(const TimeOf& numerator, const TimeOf& denominator, Part part) {
  const RawTimes &above = numerator.times, &below = denominator.times;
  const By by = above.by == By::clips || below.by == By::clips ? By::clips : By::frames;
  const auto value = [&](const TimeOf& side, std::span<const std::uint32_t> draw) {
    return time_of(side.times, side.phase, part, by, draw);
  };
  const std::size_t n = above.repetitions(), m = below.repetitions();
  const double top = value(numerator, every_repetition(n)), bottom = value(denominator, every_repetition(m));
  if (!(top > 0) || !(bottom > 0)) return {};
  RatioOfTimes ratio{top / bottom, {}};
  if (n < 2 || m < 2) return ratio;
  const bool paired = n == m && above.session == below.session;
  const bool is_interval = n >= fewest_of_an_interval && m >= fewest_of_an_interval;
  double low = ratio.middle, high = ratio.middle;
  if (is_interval) {
    std::tie(low, high) = middle_of_quotients(replicates(above, numerator.phase, part, by),
                                              replicates(below, denominator.phase, part, by),
                                              paired ? Rounds::same : Rounds::others);
  } else {
    for (std::uint32_t i = 0; i < n; ++i)
      for (std::uint32_t j = 0; j < m; ++j) {
        if (paired && i != j) continue;
        const std::uint32_t one[] = {i}, other[] = {j};
        const double quotient = value(numerator, one) / value(denominator, other);
        low = std::min(low, quotient);
        high = std::max(high, quotient);
      }
  }
  // Sums of medians may lie outside of the range of sums.
  const Within within{std::min(low, ratio.middle), std::max(high, ratio.middle), is_interval};
  if (std::isfinite(within.low) && std::isfinite(within.high)) ratio.within = within;
  return ratio;
}

std::optional<std::size_t> paid_from(const RawTimes& own, double own_preparation, const RawTimes& other,
                                     double other_preparation) {
  if (own.frames() != other.frames() || own.frames() == 0) return {};
  const auto at = [](const RawTimes& times, std::size_t f) {
    std::vector<double> values;
    for (const auto& frames : times.totals) values.push_back(frames[f]);
    return median_of(values);
  };
  double ahead = other_preparation - own_preparation;
  std::optional<std::size_t> from;
  for (std::size_t f = 0; f < own.frames(); ++f) {
    ahead += at(other, f) - at(own, f);
    if (ahead < 0)
      from.reset();
    else if (!from)
      from = f;
  }
  return from;
}

}  // namespace kbvh::experiments
