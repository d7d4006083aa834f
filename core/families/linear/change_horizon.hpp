#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/families/linear/segment_interval.hpp"

namespace kbvh {

/// Limits the length of segments while plans change at run time. Longer segments begin less often, but their
/// boxes get looser with their length and with every change in them (continuous intersection joins, Zhang et
/// al. 2008, limit the time of a join in the same way, by the time between two updates of an object). The
/// limit follows the rate of changes: a segment should end when a quarter of all leaves have been recomputed
/// in it, and the limit changes by a factor of two at most from one segment to the next. After a segment
/// without changes the limit doubles, until segments are as long as the flight plans foresee.
class ChangeHorizon {
 public:
  /// Takes the length in frames; 0: chosen.
  explicit ChangeHorizon(double fixed) : fixed_(fixed) {}

  void start_over() {
    frames_ = 0;
    changes_ = 0;
  }
  /// Records that plans changed.
  void changed() {
    ++changes_;
    if (frames_ == 0) frames_ = fixed_ > 0 ? fixed_ : first;
  }
  /// Records that plans changed, and the segment could not be kept: it was too long.
  void restarted() {
    if (frames_ > 0 && fixed_ == 0) frames_ = std::max(std::floor(frames_ / 2), shortest / 2);
    changed();
  }
  /// Records that a segment ends in which this share of all leaves was recomputed; every time counts.
  void next_segment(double share_of_leaves) {
    if (frames_ > 0 && changes_ == 0)
      frames_ = frames_ < most ? 2 * frames_ : 0;
    else if (frames_ > 0 && fixed_ == 0 && share_of_leaves > 0)
      frames_ = std::clamp(std::floor(frames_ * std::clamp(largest_share / share_of_leaves, 0.5, 2.0)),
                           shortest, longest);
    changes_ = 0;
  }
  /// Returns the length of segments in frames; 0: not limited.
  double frames() const { return frames_; }
  /// Cuts the interval around t to the limit, with frames of `step` seconds. `before` is the end of the
  /// preceding segment: the interval begins there if it contains that time, else at t.
  void cut(SegmentInterval& interval, double t, double step, double before) const {
    if (frames_ == 0 || !(step > 0)) return;
    interval.begin = interval.begin <= before && before <= t ? before : std::max(interval.begin, t);
    const double end = t + (frames_ - 0.5) * step;
    if (!(end < interval.end)) return;
    interval.end = interval.knot = end;
    interval.endless = false;
  }

 private:
  static constexpr double first = 16, most = 1024;
  static constexpr double largest_share = 0.25, shortest = 4, longest = 32;
  double fixed_, frames_ = 0;
  std::size_t changes_ = 0;  ///< in this segment
};

}  // namespace kbvh
