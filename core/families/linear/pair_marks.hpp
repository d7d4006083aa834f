#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

namespace kbvh {

/// Marks the pairs of a segment, by their index in the join: those that have been reported as changes of
/// answers, and those that may have changed since.
class PairMarks {
 public:
  /// Starts a segment: no pair is reported. O(pairs).
  void start(std::size_t pairs) {
    marks_.assign(pairs, 0);
    touched_.clear();
  }
  /// Adds unreported pairs to the segment, up to the given number. O(added pairs).
  void extend(std::size_t pairs) { marks_.resize(std::max(marks_.size(), pairs), 0); }
  /// Records that a pair may have begun or ended.
  void touch(std::uint32_t pair) {
    if ((marks_[pair] & touched) != 0) return;
    marks_[pair] |= touched;
    touched_.push_back(pair);
  }
  bool is_reported(std::uint32_t pair) const { return (marks_[pair] & reported) != 0; }
  /// Returns true.
  bool set_reported(std::uint32_t pair) {
    marks_[pair] |= reported;
    return true;
  }
  /// Keeps the outcome of a test of the pair until the next report.
  void set_hit(std::uint32_t pair) { marks_[pair] |= hit; }
  bool is_hit(std::uint32_t pair) const { return (marks_[pair] & hit) != 0; }
  /// Calls tell(pair, whether it began) for every touched pair whose membership, as given by `is_in`, has
  /// changed. The pair then counts as reported, or no longer does.
  template <class IsIn, class Tell>
  void report(const IsIn& is_in, const Tell& tell) {
    for (const std::uint32_t pair : touched_) {
      const bool now = is_in(pair), before = (marks_[pair] & reported) != 0;
      marks_[pair] = now ? reported : 0;  // no longer touched
      if (now != before) tell(pair, now);
    }
    touched_.clear();
  }
  std::size_t bytes() const { return marks_.capacity() + touched_.capacity() * sizeof(std::uint32_t); }

 private:
  static constexpr std::uint8_t reported = 1, touched = 2, hit = 4;
  std::vector<std::uint8_t> marks_;  ///< [pair]
  std::vector<std::uint32_t> touched_;
};

/// The marks that follow a structure, one for each kind of answer, or null.
struct FollowingMarks {
  PairMarks* of[2] = {nullptr, nullptr};
  void touch(std::uint32_t pair) const {
    for (PairMarks* marks : of)
      if (marks != nullptr) marks->touch(pair);
  }
  void extend(std::size_t pairs) const {
    for (PairMarks* marks : of)
      if (marks != nullptr) marks->extend(pairs);
  }
};

}  // namespace kbvh
