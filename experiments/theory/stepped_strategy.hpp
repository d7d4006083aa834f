#pragma once
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/contract/registry.hpp"

namespace kbvh::theory {

/// A registered strategy with an event queue, as the program runs it, but performed event by event. It
/// counts, and it keeps the changes of bounds of its last event.
class SteppedStrategy {
 public:
  /// Makes the strategy and starts it at t. Throws like `create` and Params.
  SteppedStrategy(const std::string& id, const std::map<std::string, std::string>& params,
                  const SceneView<float>& view, Playback<float>& playback, const Topologies& topologies,
                  double t) {
    const StrategyEntry& entry = find_strategy(id);
    strategy_ =
        create(entry, view, playback, topologies, Params(entry.info.id, entry.info.parameters, params));
    strategy_->reset(t);
    source().watch_bounds(&touched_);
  }
  SteppedStrategy(const SteppedStrategy&) = delete;  // the strategy writes to `touched_`
  SteppedStrategy& operator=(const SteppedStrategy&) = delete;

  Strategy<float>& strategy() { return *strategy_; }
  EventSource<float>& source() { return *strategy_->events(); }
  std::uint64_t counted(Counter counter) const { return strategy_->counters()[counter]; }
  /// Returns one of the strategy's own counters. Throws std::logic_error if the strategy has none of that
  /// name.
  std::uint64_t counted(std::string_view name) const {
    for (const Counters::Named& counter : strategy_->counters().named)
      if (counter.name == name) return counter.value;
    throw std::logic_error("no counter '" + std::string(name) + "'");
  }

  /// Performs the next event until t. Returns false if there is none.
  bool step(double t) {
    touched_.clear();
    return strategy_->step_event(t, done_);
  }
  /// Returns the bounds that the last event changed.
  const std::vector<BoundNotice<float>>& touched() const { return touched_; }

 private:
  std::unique_ptr<Strategy<float>> strategy_;
  std::vector<BoundNotice<float>> touched_;
  EventDescription<float> done_;
};

}  // namespace kbvh::theory
