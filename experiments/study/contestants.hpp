#pragma once
#include <map>
#include <optional>
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

/// Strategies as a plan asks for them: an id, "family:NAME", "default" (all that promise something) or "all",
/// with parameters of their own; or "!" and one of these, which takes them out again.
struct StrategyRequest {
  std::string id;
  Sweep params;
  BuilderRequest builder;
  bool optional = false;  ///< left out, with a note, if this program was built without it
};

/// One strategy in one configuration.
struct ContestantSpec {
  const StrategyEntry* entry = nullptr;
  std::map<std::string, std::string> given;   ///< parameters that differ from nothing said
  std::map<std::string, std::string> params;  ///< all, defaults included
  BuilderConfig builder;                      ///< meaningless if the strategy builds its own
  std::string label;                          ///< id, and what is not as it is by default
  Contestant contestant() const { return {entry, given, builder}; }
};

/// The entry of a strategy, or nullptr if this program has none of that id.
const StrategyEntry* known_strategy(const std::string& id);

/// The entry of a strategy. Throws ConfigError with the nearest id if there is none.
const StrategyEntry& strategy_named(const std::string& id);

/// Makes each contestant with parameters of its own once, on two triangles. Throws ConfigError for a value
/// that only the strategy itself can refuse.
void try_parameters(const std::vector<ContestantSpec>& list);

/// Everything the requests stand for, in order, each configuration once. `common` parameters are "key" (for
/// every strategy that has it) or "strategy.key"; `builder` is for every request without one of its own.
/// What "all", "default" and "family:" bring along is left out, with a sentence in `notes`, if it cannot take
/// the builder; strategies named by id throw ConfigError then, as does whatever applies to nothing.
std::vector<ContestantSpec> expand(const std::vector<StrategyRequest>& requests, const Sweep& common,
                                   const BuilderRequest& builder, std::vector<std::string>& notes);

/// Why the strategy cannot take part in the scene, in one clause; or "". `script`: the changes that are to be
/// replayed, empty for most scenes.
template <class S>
std::string unsuitable(const Info& info, const Scene<S>& scene, const PlanScript<S>& script = {});

}  // namespace kbvh::experiments
