#pragma once
#include <algorithm>
#include <limits>

#include "core/contract/tells_work.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// What a choice knows of the use of slabs at the leaves. leaf_slabs tells how many pairs of leaves it
/// compares, and bottom_up, in the frame after, how many candidates slabs leave out. After some choices, or
/// where candidates become twice or half as many, the comparison is out of date, and bottom_up is tried again
/// where it may be faster.
class ObservedSlabs {
 public:
  /// `slabs`: whether there is a strategy with slabs; without, candidates are those of boxes.
  void start_over(bool slabs, Observed& seen) {
    *this = {};
    slabs_ = slabs;
    if (!slabs) seen.boxed = seen.plain_boxed = 1;
  }
  /// Registers a frame of leaf_slabs. `all`: the count is of all candidates, not only of pairs that
  /// intersect.
  void slabs(double candidates, const TellsWork& work, bool all, int frame, Observed& seen) {
    frame_ = all ? frame : never;
    seen.candidates = candidates;
    seen.slabs_separate = double(work.last_slab_pairs().separated);
    seen.slabs_leave = double(work.last_slab_pairs().open);
    seen.slab_tests = double(work.last_box_tests());
  }
  /// Registers a frame of bottom_up: the first after one of leaf_slabs is a comparison, and others scale what
  /// was known of leaf_slabs by the number of candidates.
  void plain(double candidates, bool all, int frame, Observed& seen) {
    if (slabs_ && all && frame_ == frame - 1) {
      seen.boxed = seen.plain_boxed = std::max(1.0, candidates / std::max(1.0, seen.candidates));
      choices_ = 0;
      compared_ = seen.candidates;
      return;
    }
    const double fewer = candidates / seen.boxed;
    if (seen.candidates > 0)
      for (double* count : {&seen.slabs_separate, &seen.slabs_leave, &seen.slab_tests})
        *count *= fewer / seen.candidates;
    seen.candidates = fewer;
  }
  /// Prepares a choice in the frame after `frame`.
  void prepare_choice(int frame, Observed& seen) {
    if (!slabs_) return;
    const bool alike = seen.candidates <= 2 * compared_ && 2 * seen.candidates >= compared_;
    if (choices_ < most_choices && alike)
      ++choices_;
    else
      seen.plain_boxed = frame_ == frame ? 1 : std::numeric_limits<double>::infinity();
  }

 private:
  static constexpr int never = -1, most_choices = 8;
  bool slabs_ = true;
  int frame_ = never;           // the last one of leaf_slabs that can be compared
  int choices_ = most_choices;  // since the comparison
  double compared_ = 0;         // candidates of leaf_slabs then
};

}  // namespace kbvh
