#pragma once
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/judge/session.hpp"
#include "core/scene/scene.hpp"

namespace kbvh::experiments {

/// Values that a parameter is swept over.
using Sweep = std::map<std::string, std::vector<std::string>>;

/// Builder fields that a plan fixes or sweeps; empty: the strategy's own best.
struct BuilderRequest {
  std::vector<BuildMethod> methods;
  std::vector<std::uint32_t> widths, leaf_sizes;
  bool empty() const { return methods.empty() && widths.empty() && leaf_sizes.empty(); }
};

/// Strategies as a plan requests them: an id, "family:NAME", "default" (all with a guarantee) or "all", with
/// their own parameters; or "!" and one of these, which removes them again.
struct StrategyRequest {
  std::string id;
  Sweep params;
  BuilderRequest builder;
  bool optional = false;  ///< skipped, with a note, if this program was built without it
};

/// One strategy in one configuration.
struct ContestantSpec {
  const StrategyEntry* entry = nullptr;
  std::map<std::string, std::string> given;   ///< explicitly set parameters
  std::map<std::string, std::string> params;  ///< all, defaults included
  BuilderConfig builder;                      ///< unused if the strategy builds its own
  std::string label;                          ///< id and non-default settings
  Contestant contestant() const { return {entry, given, builder}; }
};

/// Returns the entry of a strategy, or nullptr if this program has none of that id.
const StrategyEntry* known_strategy(const std::string& id);

/// Returns the entry of a strategy. Throws ConfigError with the nearest id if there is none.
const StrategyEntry& strategy_named(const std::string& id);

/// Expands the requests, in order, each configuration once. `common` parameters are "key" (for every strategy
/// that has it) or "strategy.key"; `builder` applies to every request without its own builder. Members of
/// "all", "default" and "family:" that cannot take the builder are left out, with a sentence in `notes`;
/// strategies named by id throw ConfigError in this case, and so does a setting that applies to no strategy.
std::vector<ContestantSpec> expand(const std::vector<StrategyRequest>& requests, const Sweep& common,
                                   const BuilderRequest& builder, std::vector<std::string>& notes);

/// Returns why the strategy cannot take part in the scene, in one clause; or "". `script`: the changes to be
/// replayed, empty for most scenes. `frames`: the times to be played; without them, the range of changed
/// plans is not checked.
template <class S>
std::string unsuitable(const Info& info, const Scene<S>& scene, const PlanScript<S>& script = {},
                       std::span<const double> frames = {});

}  // namespace kbvh::experiments
