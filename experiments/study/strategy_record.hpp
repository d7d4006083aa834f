#pragma once
#include <nlohmann/json.hpp>

#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

/// Returns what records and `kbvh list` say of a strategy.
nlohmann::json about_strategy(const Info& info);
/// Returns the method, width and leaf size of a builder.
nlohmann::json in_words(const BuilderConfig& builder);

/// Makes the "strategy" of a record.
nlohmann::json strategy_record(const ContestantSpec& spec);

}  // namespace kbvh::experiments
