#pragma once
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// Lays out cells in columns: the first column to the left, the others to the right. `rows[0]` is the head.
std::string columns(const std::vector<std::vector<std::string>>& rows);

/// Returns whether the contestant was timed, or refused a time.
bool has_times(const nlohmann::json& record);

/// Returns the time of a phase of the clip in ms per frame (time_of in raw_times.hpp); the record must have
/// times. Also "update_per_event": the update divided by the certificates that failed; 0 without such.
double time_of(const nlohmann::json& record, const std::string& phase);

/// Returns the ratio of two records' times of phases (ratio_of in raw_times.hpp). Both must have times.
std::optional<RatioOfTimes> ratio_of(const nlohmann::json& numerator, const std::string& phase,
                                     const nlohmann::json& denominator, const std::string& phase_below);

/// Returns why the times of a record were disturbed, or ""; also for records that do not say it.
std::string disturbed(const nlohmann::json& record);

/// Returns whether the record is of a baseline (Info::baseline). Records from before baselines were declared
/// are classified by the family "refit".
bool is_baseline(const nlohmann::json& record);

/// Returns the fastest verified baseline by update + query among the records, or nullptr.
const nlohmann::json* best_refit(const std::vector<nlohmann::json>& records);

/// Formats the table of records of one scene, l and scalar: times in ms per frame, speed relative to the best
/// refit (above 1 is faster) without and with motion evaluation, and of the steady frames; the frame from
/// which a contestant has paid for preparation and beginning; and the results of the verification. Ratios
/// with "?" are disturbed; lines below say why, or that the machine was quiet.
std::string results_table(const std::vector<nlohmann::json>& records);

}  // namespace kbvh::experiments
