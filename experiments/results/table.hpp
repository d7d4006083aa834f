#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace kbvh::experiments {

/// Lays out cells in columns: the first column to the left, the others to the right. `rows[0]` is the head.
std::string columns(const std::vector<std::vector<std::string>>& rows);

/// Returns the times of one phase in every repetition, in ms per frame; phases as in `median_phase`.
std::vector<double> phase_values(const nlohmann::json& record, const std::string& phase);

/// Returns the median of at least one value; of an even number, the mean of the two middle values.
double median(std::vector<double> values);

/// Returns whether the contestant was timed, or refused a time.
bool has_times(const nlohmann::json& record);

/// Returns the median over the repetitions of one phase, in ms per frame ("motion", "update", "query", or
/// "total" for update, query and plan changes); the record must have times.
double median_phase(const nlohmann::json& record, const std::string& phase);

/// Returns whether the record is of a baseline (Info::baseline). Records from before baselines were declared
/// are classified by the family "refit".
bool is_baseline(const nlohmann::json& record);

/// Returns the time of the contestant's whole clip, in ms per frame, by which the best refit and the best of
/// several configurations are chosen: the median over repetitions of all phases. The evaluation of positions
/// counts: some baselines fetch them in their own phases. The record must have times. `clip_total` of
/// analysis/ratios.py is the same number; tests compare the choices.
double clip_total(const nlohmann::json& record);

/// Returns the record with the smallest `clip_total`, the first of equal ones; nullptr if none has times.
const nlohmann::json* shortest_clip(const std::vector<const nlohmann::json*>& records);

/// Returns the best refit among the records of one table: the verified baseline with the smallest
/// `clip_total`, or nullptr. It is the one denominator of the table: its phases are the denominators of
/// ratios of phases.
const nlohmann::json* best_refit(const std::vector<nlohmann::json>& records);

/// Returns the instruction set of the contestant's code: that of a peer library, of the parameter `kernels`,
/// or of the kernels in use; "-" in records that do not tell.
std::string instructions_of(const nlohmann::json& record);

/// Formats the table that `run` and `bench` print for records of one scene, l and scalar: times in ms per
/// frame (medians over repetitions), the instruction set, speed relative to the best refit (above 1 is
/// faster) without and with motion evaluation, and the results of the verification. Below it stand the
/// versions of peer libraries, with a remark about their times.
std::string results_table(const std::vector<nlohmann::json>& records);

}  // namespace kbvh::experiments
