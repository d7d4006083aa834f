#pragma once
#include <nlohmann/json.hpp>

#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

/// Returns the word used in result files.
const char* word(Tightness tightness);
const char* word(Guarantee guarantee);
const char* word(Foresight foresight);

/// Makes the "strategy" of a record.
nlohmann::json strategy_record(const ContestantSpec& spec);

}  // namespace kbvh::experiments
