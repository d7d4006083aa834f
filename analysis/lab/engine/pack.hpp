#pragma once
#include "analysis/lab/engine/answer.hpp"
#include "core/facade/world.hpp"

namespace kbvh::lab {

/// Events in two arrays: 9 words and 10 doubles each (src/engine/decode.js reads them).
class PackedEvents {
 public:
  void add(const WorldEvent& event);
  std::size_t size() const { return words_.size() / 9; }
  nlohmann::json moved_to(Answer& answer) {
    return {{"words", answer.add(std::move(words_))}, {"numbers", answer.add(std::move(numbers_))}};
  }

 private:
  std::vector<std::uint32_t> words_;
  std::vector<double> numbers_;
};

/// The events performed, each with the bounds that it changed and the certificates that it made.
class PackedSteps {
 public:
  void add(const WorldStep& step);
  std::size_t size() const { return events_.size(); }
  nlohmann::json moved_to(Answer& answer) {
    return {{"events", events_.moved_to(answer)},
            {"touchedEnds", answer.add(std::move(touched_ends_))},
            {"touched", answer.add(std::move(touched_))},
            {"rescheduledEnds", answer.add(std::move(rescheduled_ends_))},
            {"rescheduled", rescheduled_.moved_to(answer)}};
  }

 private:
  PackedEvents events_, rescheduled_;
  std::vector<std::uint32_t> touched_ends_, touched_, rescheduled_ends_;
};

/// Describes all strategies as JSON.
nlohmann::json strategies_json();

/// Describes the counters that all strategies share.
nlohmann::json counters_json();

/// The state of a world that the page asks for.
struct Wanted {
  bool positions = true, nodes = true, pairs = true, queue = true, counters = true;
  std::size_t most_pairs = 0, most_events = 0;  ///< the first of each
};
/// A world between frames shows the time of its last event: positions are those of the plans, boxes are made
/// from realisers, pairs are those of the last frame.
struct Moment {
  double time = 0;
  bool between_frames = false;
};
/// Adds the state to `answer`, and returns the JSON object that describes it.
nlohmann::json state_json(World& world, std::uint32_t bodies, const Moment& moment, const Wanted& wanted,
                          const std::vector<WorldPair>& pairs, Answer& answer);

}  // namespace kbvh::lab
