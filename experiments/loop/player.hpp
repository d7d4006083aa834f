#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "experiments/loop/recording.hpp"

namespace kbvh::experiments::loop {

/// What is asked at each iterate of a recording.
enum class IterateQuestion : std::uint8_t {
  near,    ///< the pairs within the radius at the start of the motion, exactly: equal in all ways
  swept,   ///< the pairs whose swept boxes overlap: equal in the ways that keep nothing, else a superset
  impact,  ///< the earliest impact of the motion, at the separation: equal in all ways
};
/// Returns the question in words.
const char* name(IterateQuestion question);

/// A strategy to which a recording is played.
struct PlayedStrategy {
  std::string label;  ///< for tables
  ContactStrategy strategy;
  bool exact = true;  ///< promises every pair
};

struct PlaySettings {
  /// If any, the questions `swept` and `impact` are asked of these and of the way `refit`, and nothing else:
  /// strategies know no exact distances.
  std::vector<PlayedStrategy> strategies{};
  std::vector<double> keep{0.5, 1, 2};  ///< bounds of the ways that keep candidates, in radii
  std::uint64_t truth_every = 100;  ///< iterates that are compared with all pairs, one of so many; 0: none
  std::uint64_t most_iterates = 0;  ///< 0: all
  std::uint32_t lose_every = 0;     ///< a fault for tests, of the ways that keep candidates and of strategies
};

/// How one way answered one question over a whole recording.
struct PlayedWay {
  IterateQuestion question;
  Detection detection;
  double keep = 0;  ///< radii
  double seconds = 0;
  std::uint64_t searches = 0;  ///< of one kind of pairs each
  std::uint64_t listed = 0;    ///< pairs that were listed, or candidates of impacts, summed over iterates
  std::uint64_t differences =
      0;                      ///< iterates whose answer differs from that of `refit`, or lacks pairs of it
  std::uint64_t lacking = 0;  ///< true pairs that were not listed, over the iterates that were compared
  /// Times of `refit` over times of this way.
  double over_refit = 0;
  std::string strategy{};  ///< its label; empty: kbvh::broad_phase
  bool exact = true;       ///< promises every pair
};

struct PlayResult {
  std::uint64_t iterates = 0, steps = 0;
  std::uint64_t truths = 0;      ///< iterates that were compared with all pairs
  std::uint64_t true_pairs = 0;  ///< within the radius at the start of these
  std::vector<PlayedWay> ways;
  /// Returns whether all ways that promise every pair agree and list all true pairs.
  bool agree() const;
};

/// Replays a recording against several ways to detect, in turns within each iterate, in an order that changes
/// from iterate to iterate. Every way has trees and candidates of its own for each question. Only updates and
/// answers are timed; comparisons are not. Calls done(iterates) after each iterate. Throws as
/// RecordingReader, and ConfigError as check_contact_strategy.
PlayResult play(const std::filesystem::path& file, const PlaySettings& settings,
                const std::function<void(std::uint64_t)>& done = {});

}  // namespace kbvh::experiments::loop
