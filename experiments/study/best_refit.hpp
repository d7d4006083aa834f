#pragma once
#include <cstddef>
#include <optional>
#include <span>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// Returns the time of a contestant's whole clip, in ms per frame, by which the best refit and the best of
/// several configurations are chosen. The evaluation of positions counts: some baselines fetch them in their
/// own phases. `clipTotal` of the explorer is the same number; a test compares the choices.
double clip_total(const RawTimes& times);

/// Returns the index of the smallest `clip_total`, the first of equal ones. A null pointer is a contestant
/// without times. Returns nothing if none has times.
std::optional<std::size_t> shortest_clip(std::span<const RawTimes* const> contestants);

/// What decides whether a contestant is the best refit of its table.
struct RefitCandidate {
  const RawTimes* times;  ///< null: it was refused a time
  bool is_baseline, is_approximate;
};

/// Returns the index of the best refit of a table: of the baselines that are not approximate, the one with
/// the shortest clip. It is the one denominator of the table: its phases are the denominators of ratios of
/// phases. Returns nothing if there is none.
std::optional<std::size_t> best_refit(std::span<const RefitCandidate> table);

}  // namespace kbvh::experiments
