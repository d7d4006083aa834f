#pragma once
#include <cstdint>
#include <string>

namespace kbvh::theory {

/// The result of comparing a log with the envelopes (envelope.hpp).
struct EnvelopeReport {
  std::string violation;            ///< the first, empty if the log is right
  std::uint64_t bounds = 0;         ///< (node, side) pairs proved
  std::uint64_t logged = 0;         ///< entries
  std::uint64_t net = 0;            ///< net changes per node, side and instant
  std::uint64_t envelope = 0;       ///< forced changes if ties are resolved as in the log
  std::uint64_t canonical = 0;      ///< the same if ties are resolved by the smallest vertex id
  std::uint64_t several_steps = 0;  ///< entries beyond one per net change: several vertices met at one point
  std::uint64_t choices = 0;        ///< forced changes with more than one best successor (coincident lines)
  /// For every bound over every row: breakpoints of the envelope against the longest Davenport-Schinzel
  /// sequence of lines, lambda_1(n) - 1 = n - 1 for n vertices below.
  std::uint64_t pieces = 0;            ///< (bound, row) pairs
  std::uint64_t over_lambda = 0;       ///< of these, with more than n - 1 breakpoints
  std::uint64_t most_breakpoints = 0;  ///< of one bound in one row
  double fullest = 0;                  ///< largest used share of n - 1, over n >= 8

  bool holds() const { return violation.empty(); }
  void add(const EnvelopeReport& other);
};

}  // namespace kbvh::theory
