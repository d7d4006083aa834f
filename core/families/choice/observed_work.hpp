#pragma once
#include <algorithm>
#include <cstdint>

#include "core/base/cost_constants.hpp"
#include "core/contract/reports_work.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// The searches of the active strategy of a choice since it was last chosen.
class ObservedSearches {
 public:
  void start_over() { *this = {}; }
  /// Registers the search of a frame. `work`: of the strategy; null if it does not tell.
  void add(const ReportsWork* work, double candidates) {
    tests_ += work != nullptr ? double(work->last_box_tests()) : 0;
    candidates_ += candidates;
  }
  /// Returns the mean cost of box tests and candidates, in nanoseconds per frame.
  double cost(int frames) const {
    return costs::Work::plain.of(0, tests_, candidates_) / std::max(1, frames);
  }
  /// Returns the observations, with the number of candidates of these searches, which were of boxes alone;
  /// with more candidates a refit makes more box tests.
  Observed as_seen(const Observed& seen, int frames) const {
    Observed now = seen;
    now.candidates = candidates_ / std::max(1, frames) / seen.boxed;
    const double more = std::max(1.0, now.candidates / std::max(1.0, seen.candidates));
    now.slab_tests *= more;
    now.plain_tests *= more;
    return now;
  }

 private:
  double tests_ = 0, candidates_ = 0;
};

/// The frames over which the work of an interval join is measured: from the beginning of one segment to that
/// of another.
class JoinWindow {
 public:
  void close() { *this = {}; }
  /// Opens the window at the next frame, where a segment begins.
  void open_next() { opens_ = true; }
  /// Prepares a frame, before the join advances to it. `fetched`: positions fetched so far.
  void advance(int frame, const ReportsWork* join, std::uint64_t fetched) {
    if (!opens_) return;
    *this = {};
    frame_ = frame;
    fetched_ = fetched;
    if (join != nullptr) {
      span_tests_ = join->span_tests();
      frame_tests_ = join->frame_tests();
    }
  }
  /// Whether the window has frames before `frame`.
  bool has_frames(int frame) const { return frame_ != none && frame > frame_; }
  /// Returns the work per frame of the window, in nanoseconds by its counts.
  double work(int frame, const ReportsWork* join, std::uint64_t fetched, const Observed& seen) const {
    using Work = costs::Work;
    double boxes = 0, in_frames = Work::join_fetch * double(fetched - fetched_);
    if (join != nullptr) {
      boxes = double(join->last_box_tests());
      in_frames += Work::span_test * double(join->span_tests() - span_tests_) +
                   Work::join_triangle_test * double(join->frame_tests() - frame_tests_);
    }
    return (Work::join_read * seen.reads + Work::join_box_test * boxes) / seen.frames_per_segment +
           in_frames / (frame - frame_);
  }

 private:
  static constexpr int none = -1;
  bool opens_ = false;
  int frame_ = none;
  std::uint64_t span_tests_ = 0, frame_tests_ = 0, fetched_ = 0;  ///< before the window
};

}  // namespace kbvh
