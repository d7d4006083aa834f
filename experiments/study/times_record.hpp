#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

struct Measured;

/// Returns the raw times of a contestant that was timed; `session` names the rounds.
RawTimes raw_times(const Measured& measured, const std::string& session);

/// Makes the times of a result record: raw times in ms, and the spread over the frames of the median
/// repetition.
nlohmann::json times_record(const Measured& measured);

/// Returns the raw times of a record that has times. Repetitions without times of frames, as in records of
/// schema 1, have their means per frame as their only frame, and are counted by clips.
RawTimes raw_times(const nlohmann::json& record);

}  // namespace kbvh::experiments
