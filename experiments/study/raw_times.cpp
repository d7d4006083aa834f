#include "experiments/study/raw_times.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <tuple>

#include "core/base/median.hpp"
#include "experiments/study/chance.hpp"
#include "experiments/study/resamples.hpp"

namespace kbvh::experiments {

namespace {

constexpr std::size_t draw_count = 200, left_out = draw_count / 40;

std::vector<Draw> resamples(std::size_t repetitions) {
  Chance chance(1);
  std::vector<Draw> all(draw_count, Draw(repetitions));
  for (Draw& draw : all)
    for (std::uint32_t& one : draw) one = chance.below(repetitions);
  return all;
}

std::size_t begin_of(const RawTimes& times, Part part) {
  return part == Part::steady ? *times.steady_from : 0;
}

/// Returns the time per frame over each draw, from frame `begin` on.
std::vector<double> sums_by(const std::vector<std::vector<double>>& table, std::size_t begin, By by,
                            const std::vector<Draw>& draws) {
  const auto frames = double(table[0].size() - begin);
  std::vector<double> sums, of_clips, values;
  if (by == By::clips)
    for (const std::vector<double>& one : table)
      of_clips.push_back(std::accumulate(one.begin() + std::ptrdiff_t(begin), one.end(), 0.0));
  for (const Draw& draw : draws) {
    values.resize(draw.size());
    double sum = 0;
    if (by == By::clips) {
      for (std::size_t i = 0; i < draw.size(); ++i) values[i] = of_clips[draw[i]];
      sum = median_of_times(values);
    } else {
      for (std::size_t f = begin; f < table[0].size(); ++f) {
        for (std::size_t i = 0; i < draw.size(); ++i) values[i] = table[draw[i]][f];
        sum += median_of_times(values);
      }
    }
    sums.push_back(sum / frames);
  }
  return sums;
}

double median_sum(const std::vector<PhaseTimes>& sums, double PhaseTimes::*phase, const Draw& draw) {
  std::vector<double> values;
  for (const std::uint32_t r : draw) values.push_back(sums[r].*phase);
  return median_of_times(values);
}

}  // namespace

Draw every_repetition(std::size_t repetitions) {
  Draw draw(repetitions);
  std::iota(draw.begin(), draw.end(), 0u);
  return draw;
}

const std::vector<double>& DrawnTimes::motions() {
  if (motions_.empty()) motions_ = sums_by(times_->motions, begin_of(*times_, part_), by_, draws_);
  return motions_;
}

const std::vector<double>& DrawnTimes::totals() {
  if (totals_.empty()) totals_ = sums_by(times_->totals, begin_of(*times_, part_), by_, draws_);
  return totals_;
}

const std::vector<PhaseTimes>& DrawnTimes::middles() {
  const std::vector<PhaseTimes>& sums = part_ == Part::steady ? times_->steady : times_->clip;
  for (std::size_t i = middles_.size(); i < draws_.size(); ++i) {
    PhaseTimes middle;
    for (double PhaseTimes::*one : {&PhaseTimes::update, &PhaseTimes::traversal, &PhaseTimes::triangle_tests,
                                    &PhaseTimes::plan_changes, &PhaseTimes::geometry_changes})
      middle.*one = median_sum(sums, one, draws_[i]);
    middles_.push_back(middle);
  }
  return middles_;
}

std::vector<double> DrawnTimes::of(std::string_view phase) {
  if (phase == "motion") return motions();
  constexpr std::string_view with_motion = "_with_motion";
  if (phase.ends_with(with_motion)) {
    std::vector<double> values = of(phase.substr(0, phase.size() - with_motion.size()));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += motions()[i];
    return values;
  }
  if (phase == "total") return totals();
  const auto share = [&](const PhaseTimes& middle) {
    const double changes = middle.plan_changes + middle.geometry_changes;
    return phase == "update"             ? middle.update
           : phase == "traversal"        ? middle.traversal
           : phase == "triangle_tests"   ? middle.triangle_tests
           : phase == "plan_changes"     ? middle.plan_changes
           : phase == "geometry_changes" ? middle.geometry_changes
           : phase == "changes"          ? changes
           : phase == "query"            ? middle.query()
           : phase == "upkeep"           ? middle.update + changes
           : phase == "candidates"       ? middle.update + middle.traversal + changes
                                         : 0;
  };
  std::vector<double> values = totals();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const PhaseTimes& middle = middles()[i];
    values[i] = middle.total() > 0 ? values[i] * share(middle) / middle.total() : 0;
  }
  return values;
}

double time_of(const RawTimes& times, std::string_view phase, Part part, By by,
               std::span<const std::uint32_t> draw) {
  if (!times.has(part) || draw.empty()) return 0;
  return DrawnTimes(times, part, by, {Draw(draw.begin(), draw.end())}).of(phase)[0];
}

double time_of(const RawTimes& times, std::string_view phase, Part part) {
  return time_of(times, phase, part, times.by, every_repetition(times.repetitions()));
}

std::vector<double> replicates(const RawTimes& times, std::string_view phase, Part part, By by) {
  return Resamples(times).replicates(phase, part, by);
}

std::vector<double> Resamples::replicates(std::string_view phase, Part part, By by) {
  std::optional<DrawnTimes>& known = known_[2 * std::size_t(part) + std::size_t(by)];
  if (!times_->has(part)) return std::vector<double>(draw_count, 0.0);
  if (!known) known.emplace(*times_, part, by, resamples(times_->repetitions()));
  return known->of(phase);
}

Rounds rounds_of(const RawTimes& one, const RawTimes& other) {
  return one.repetitions() == other.repetitions() && one.session == other.session ? Rounds::same
                                                                                  : Rounds::others;
}

std::pair<double, double> middle_of_quotients(const std::vector<double>& above,
                                              const std::vector<double>& below, Rounds rounds) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < draw_count; ++i)
    ratios.push_back(above[i] / below[rounds == Rounds::same ? i : draw_count - 1 - i]);
  std::sort(ratios.begin(), ratios.end());
  return {ratios[left_out], ratios[ratios.size() - 1 - left_out]};
}

namespace {

std::optional<RatioOfTimes> ratio_of(Resamples& numerator, std::string_view phase_above,
                                     Resamples& denominator, std::string_view phase_below, Part part) {
  const RawTimes &above = numerator.times(), &below = denominator.times();
  const By by = above.by == By::clips || below.by == By::clips ? By::clips : By::frames;
  const std::size_t n = above.repetitions(), m = below.repetitions();
  const double top = time_of(above, phase_above, part, by, every_repetition(n)),
               bottom = time_of(below, phase_below, part, by, every_repetition(m));
  if (!(top > 0) || !(bottom > 0)) return {};
  RatioOfTimes ratio{top / bottom, {}};
  if (n < 2 || m < 2) return ratio;
  const bool is_interval = n >= fewest_of_an_interval && m >= fewest_of_an_interval;
  double low = ratio.middle, high = ratio.middle;
  if (is_interval) {
    std::tie(low, high) =
        middle_of_quotients(numerator.replicates(phase_above, part, by),
                            denominator.replicates(phase_below, part, by), rounds_of(above, below));
  } else {
    for (std::uint32_t i = 0; i < n; ++i)
      for (std::uint32_t j = 0; j < m; ++j) {
        if (rounds_of(above, below) == Rounds::same && i != j) continue;
        const std::uint32_t one[] = {i}, other[] = {j};
        const double quotient =
            time_of(above, phase_above, part, by, one) / time_of(below, phase_below, part, by, other);
        low = std::min(low, quotient);
        high = std::max(high, quotient);
      }
  }
  // Sums of medians may lie outside of the range of sums.
  const Within within{std::min(low, ratio.middle), std::max(high, ratio.middle), is_interval};
  if (std::isfinite(within.low) && std::isfinite(within.high)) ratio.within = within;
  return ratio;
}

}  // namespace

std::optional<RatioOfTimes> ratio_of(const TimeOf& numerator, const TimeOf& denominator, Part part) {
  Resamples above(numerator.times), below(denominator.times);
  return ratio_of(above, numerator.phase, below, denominator.phase, part);
}

std::optional<RatioOfTimes> ratio_of(Resamples& numerator, Resamples& denominator, std::string_view phase,
                                     Part part) {
  return ratio_of(numerator, phase, denominator, phase, part);
}

double variation(const RawTimes& times) {
  const std::size_t n = times.repetitions();
  if (n < fewest_of_an_interval) return 1;
  std::vector<double> clips;
  for (std::size_t r = 0; r < n; ++r) {
    double clip = 0;
    for (std::size_t f = 0; f < times.frames(); ++f) clip += times.totals[r][f] + times.motions[r][f];
    clips.push_back(clip);
  }
  std::sort(clips.begin(), clips.end());
  const double lower = clips[n / 4], upper = clips[n - 1 - n / 4];
  return lower > 0 ? upper / lower : 1;
}

std::string doubts(const RawTimes& times, std::string recorded) {
  const double found = variation(times);
  if (!(found > most_variation)) return recorded;
  char text[64];
  std::snprintf(text, sizeof text, "its repetitions differ by a factor of %.2f", found);
  return recorded.empty() ? text : recorded + ", " + text;
}

std::optional<std::size_t> paid_from(const RawTimes& own, double own_preparation, const RawTimes& other,
                                     double other_preparation) {
  if (own.frames() != other.frames() || own.frames() == 0) return {};
  const auto at = [](const RawTimes& times, std::size_t f) {
    std::vector<double> values;
    for (const auto& frames : times.totals) values.push_back(frames[f]);
    return median_of_times(values);
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
