#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace kbvh::experiments {

/// Cells laid out in columns: the first column to the left, the others to the right. `rows[0]` is the head.
std::string columns(const std::vector<std::vector<std::string>>& rows);

/// The times of one phase in every repetition, in ms per frame; phases as in `median_phase`.
std::vector<double> phase_values(const nlohmann::json& record, const std::string& phase);

/// Of values that are not none; of an even number, the mean of the two in the middle.
double median(std::vector<double> values);

/// Was the contestant timed, or refused a time?
bool has_times(const nlohmann::json& record);

/// The median over the repetitions of one phase, in ms per frame ("motion", "update", "query", or "total" for
/// update, query and plan changes); of a record with times.
double median_phase(const nlohmann::json& record, const std::string& phase);

/// Is the record of a baseline (Info::baseline)? Records from before baselines were declared go by the family
/// "refit".
bool is_baseline(const nlohmann::json& record);

/// The fastest verified baseline by update + query among the records, or nullptr.
const nlohmann::json* best_refit(const std::vector<nlohmann::json>& records);

/// The table that `run` and `bench` print for records of one scene, l and scalar: times in ms per frame
/// (medians over repetitions), speed relative to the best refit (above 1 is faster) without and with motion
/// evaluation, and what verification saw.
std::string results_table(const std::vector<nlohmann::json>& records);

}  // namespace kbvh::experiments
