#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// What a person reads without scrolling sideways: no line of a table is longer.
constexpr std::size_t longest_line = 100;

/// Lays out cells in columns: the first column to the left, the others to the right. `rows[0]` is the head.
/// Where lines would be longer than `longest`, long first cells have lines of their own.
std::string columns(const std::vector<std::vector<std::string>>& rows, std::size_t longest = SIZE_MAX);

/// Breaks a text into lines between words; all begin with `indent`, those after the first two blanks further
/// in.
std::string wrapped(const std::string& text, const std::string& indent, std::size_t longest = longest_line);

/// Returns whether the contestant was timed, or refused a time.
bool has_times(const nlohmann::json& record);

/// Returns the time of a phase of the clip in ms per frame (time_of in raw_times.hpp); the record must have
/// times. Also "update_per_event": the update divided by the certificates that failed; 0 without such.
double time_of(const nlohmann::json& record, const std::string& phase);

/// Returns the ratio of two records' times of phases (ratio_of in raw_times.hpp). Both must have times.
std::optional<RatioOfTimes> ratio_of(const nlohmann::json& numerator, const std::string& phase,
                                     const nlohmann::json& denominator, const std::string& phase_below);

/// Returns why the times of a record were disturbed (`doubts` of experiments/study/raw_times.hpp), or "".
std::string disturbed(const nlohmann::json& record);

/// Returns whether the record is of a baseline (Info::baseline). Records from before baselines were declared
/// are classified by the family "refit".
bool is_baseline(const nlohmann::json& record);

/// Returns the record with the smallest `clip_total` (experiments/study/best_refit.hpp), the first of equal
/// ones; nullptr if none has times.
const nlohmann::json* shortest_clip(const std::vector<const nlohmann::json*>& records);

/// Returns the best refit among the records of one table (experiments/study/best_refit.hpp), or nullptr.
const nlohmann::json* best_refit(const std::vector<nlohmann::json>& records);

/// Returns the instruction set of the contestant's code: that of a peer library, of the parameter `kernels`,
/// or of the kernels in use; "-" in records that do not tell.
std::string instructions_of(const nlohmann::json& record);

/// Which contestants a table shows.
enum class Shown : std::uint8_t {
  fastest,  ///< of many, the best refit and the fastest of each family; of a few, all
  all,      ///< all, with a second table of what else is known about them
};

/// Formats the table of records of one scene, l and scalar, the fastest first: speed relative to the best
/// refit (above 1 is faster) with its interval, times in ms per frame, and what the verification found if it
/// found something. Ratios with "?" are disturbed; a line below says how many, or that the machine was quiet.
/// The second table of `Shown::all` has the instruction set, the ratio with motion evaluation and of the
/// steady frames, the frame from which a contestant has paid for preparation and beginning, and the
/// verification.
std::string results_table(const std::vector<nlohmann::json>& records, Shown shown = Shown::all);

}  // namespace kbvh::experiments
