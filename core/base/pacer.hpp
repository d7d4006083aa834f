#pragma once
#include <algorithm>

namespace kbvh {

/// Spreads work that must be complete at a deadline over the frames until then, in equal shares if the frames
/// come at equal steps. Times in seconds.
struct Pacer {
  double begin = 0, deadline = 0;

  /// Returns the share of the work, from 0 to 1, that should be complete after the frame at `now` so that the
  /// next frame, `step` later, does not have to catch up.
  double share_due(double now, double step) const {
    return std::min(1.0, (now + step - begin) / (deadline - begin));
  }
};

}  // namespace kbvh
