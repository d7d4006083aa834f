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

/// Returns the fastest verified baseline by update + query among the records, or nullptr.
const nlohmann::json* best_refit(const std::vector<nlohmann::json>& records);

/// Formats the table that `run` and `bench` print for records of one scene, l and scalar: times in ms per
/// frame (medians over repetitions), speed relative to the best refit (above 1 is faster) without and with
/// motion evaluation, and the results of the verification.
std::string results_table(const std::vector<nlohmann::json>& records);

}  // namespace kbvh::experiments
