#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// Sums of frames over several draws of one contestant's repetitions, each made when a phase first needs it.
class DrawnTimes {
 public:
  /// `times` must outlive the object, and have the part.
  DrawnTimes(const RawTimes& times, Part part, By by, std::vector<Draw> draws)
      : times_(&times), part_(part), by_(by), draws_(std::move(draws)) {}
  /// Returns the time of a phase over each draw, in ms per frame (time_of).
  std::vector<double> of(std::string_view phase);

 private:
  const std::vector<double>& motions();
  const std::vector<double>& totals();
  const std::vector<PhaseTimes>& middles();

  const RawTimes* times_;
  Part part_;
  By by_;
  std::vector<Draw> draws_;
  std::vector<double> motions_, totals_;
  std::vector<PhaseTimes> middles_;  // medians of sums
};

/// The resamples of one contestant, kept for the next phase or ratio.
class Resamples {
 public:
  /// `times` must outlive the object.
  explicit Resamples(const RawTimes& times) : times_(&times) {}
  const RawTimes& times() const { return *times_; }
  /// Returns what the function replicates() returns.
  std::vector<double> replicates(std::string_view phase, Part part, By by);

 private:
  const RawTimes* times_;
  std::array<std::optional<DrawnTimes>, 4> known_;  // by part and by
};

/// Returns whether two contestants were played in the same rounds.
Rounds rounds_of(const RawTimes& one, const RawTimes& other);

/// Returns what ratio_of in raw_times.hpp returns, from the resamples that are known.
std::optional<RatioOfTimes> ratio_of(Resamples& numerator, Resamples& denominator, std::string_view phase,
                                     Part part = Part::clip);

}  // namespace kbvh::experiments
