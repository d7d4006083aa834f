#pragma once
#include <algorithm>
#include <limits>

#include "core/contract/reports_work.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// A choice's knowledge about the use of slabs at the leaves. leaf_slabs reports its number of box tests. In
/// the frame after it, bottom_up reports its own number, and how many candidates slabs leave out. After some
/// choices, or when candidates have doubled or halved, the comparison is out of date, and bottom_up is tried
/// again where it may be faster; but not before a number of frames that doubles each time, up to 64.
class ObservedSlabs {
 public:
  /// `slabs`: whether there is a strategy with slabs; otherwise candidates are those of boxes.
  void start_over(bool slabs, Observed& seen) {
    *this = {};
    slabs_ = slabs;
    if (!slabs) seen.boxed = seen.plain_boxed = 1;
    seen.plain_known = !slabs;
  }
  /// Registers a frame of leaf_slabs. `all`: the count is of all candidates, not only of pairs that
  /// intersect.
  void slabs(double candidates, const ReportsWork& work, bool all, int frame, Observed& seen) {
    frame_ = all ? frame : never;
    seen.candidates = candidates;
    const double tests = double(work.last_box_tests());
    if (seen.slab_tests > 0) seen.plain_tests *= tests / seen.slab_tests;
    seen.slab_tests = tests;
  }
  /// Registers a frame of bottom_up: the first one after a frame of leaf_slabs is a comparison; later ones
  /// scale the values known of leaf_slabs by their box tests.
  void plain(double candidates, const ReportsWork& work, bool all, int frame, Observed& seen) {
    if (slabs_ && all && frame_ == frame - 1) {
      seen.boxed = seen.plain_boxed = std::max(1.0, candidates / std::max(1.0, seen.candidates));
      choices_ = 0;
      compared_ = seen.candidates;
      since_ = frame;
      wait_ = std::min(2 * wait_, most_wait);
      seen.plain_tests = double(work.last_box_tests());
      seen.plain_known = true;
      return;
    }
    const double tests = double(work.last_box_tests());
    if (!slabs_)
      seen.slab_tests = tests;
    else if (seen.plain_tests > 0)
      seen.slab_tests *= tests / seen.plain_tests;
    seen.plain_tests = tests;
    seen.candidates = candidates / seen.boxed;
  }
  /// Prepares a choice in the frame after `frame`.
  void prepare_choice(int frame, Observed& seen) {
    if (!slabs_) return;
    const bool alike = seen.candidates <= 2 * compared_ && 2 * seen.candidates >= compared_;
    if ((choices_ < most_choices && alike) || frame - since_ < wait_) {
      ++choices_;
      return;
    }
    seen.plain_known = false;
    // The best results ever seen: no more candidates, and half of the tests.
    seen.plain_boxed = frame_ == frame ? 1 : std::numeric_limits<double>::infinity();
    seen.plain_tests = 0.5 * seen.slab_tests;
  }

 private:
  static constexpr int never = -1, most_choices = 8, most_wait = 64;
  bool slabs_ = true;
  int frame_ = never;           // last frame of leaf_slabs that can be compared
  int choices_ = most_choices;  // since the comparison
  double compared_ = 0;         // candidates of leaf_slabs at the comparison
  int since_ = never;           // the frame of the comparison
  int wait_ = 1;                // frames before the next comparison; doubles each time
};

}  // namespace kbvh
