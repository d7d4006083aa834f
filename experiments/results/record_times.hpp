#pragma once
#include <nlohmann/json.hpp>

#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// Returns the raw times of a record that has times. Repetitions without times of frames, as in records of
/// schema 1, have their means per frame as their only frame, and are counted by clips.
RawTimes raw_times(const nlohmann::json& record);

}  // namespace kbvh::experiments
