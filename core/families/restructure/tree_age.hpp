#pragma once
#include <algorithm>
#include <cstdint>

#include "core/base/cost_constants.hpp"

namespace kbvh {

/// The age of a tree, measured by its queries: the box tests that they made beyond those of the tree when it
/// was new.
///
/// The number of pairs of primitives whose boxes overlap does not depend on the tree, and neither does the
/// number of rays that enter the body's box. A new tree is therefore expected to need as many tests per such
/// pair or ray, and per frame, as in its first frame. When the surplus summed over frames has cost as much as
/// a rebuild, a rebuild is due: for a surplus that grows linearly this is the period of least total cost. The
/// unit of all work is a box test of a search for pairs; a box test of a ray counts as
/// costs::Ageing::ray_test.
class TreeAge {
 public:
  /// Registers a new tree: the next frame measures how many tests it needs.
  void renew() {
    growth_ = growth_now();
    lasted_ = frames_;
    surplus_ = frames_ = 0;
    pairs_.is_new = rays_.is_new = true;
  }
  /// Registers a tree that was improved but not rebuilt. Its former need is kept, and slowly forgotten.
  void repair() {
    surplus_ = frames_ = 0;
    pairs_.per_found *= 1.05;
    rays_.per_found *= 1.05;
  }
  /// Adds the box tests of a query of the current frame, and the pairs of primitives that it found.
  void add(std::uint64_t tests, std::uint64_t found) { pairs_.add(tests, found); }
  /// Adds the box tests of rays of the current frame, and the number of those that entered the body's box.
  void add_rays(std::uint64_t tests, std::uint64_t rays) { rays_.add(tests, rays); }
  /// Ends the current frame and returns the surplus since the tree was new, in box tests.
  double end_frame() {
    // 1000 pairs represent the traversal of bodies without contact; a ray that meets no box makes no tests.
    surplus_ += pairs_.end_frame(1000) + costs::Ageing::ray_test * rays_.end_frame(1);
    ++frames_;
    return surplus_;
  }
  /// Returns the growth of the surplus, in box tests per frame: of this tree, or, while it is younger than
  /// its predecessor became, of the predecessor.
  double growth() const { return frames_ < lasted_ ? growth_ : growth_now(); }

 private:
  /// The work of one kind of query.
  struct Work {
    double tests = 0, found = 0;  // of the current frame
    double per_found = 0;         // of the new tree
    bool is_new = true;           // its first frame with a query has not ended

    void add(std::uint64_t more_tests, std::uint64_t more_found) {
      tests += double(more_tests);
      found += double(more_found);
    }
    /// Ends the frame and returns its surplus. `quiet` is added to what was found.
    double end_frame(double quiet) {
      double surplus = 0;
      if (tests > 0) {  // otherwise no query came to the body
        const double needed = tests / (found + quiet);
        // A tree with an unusually bad first frame is measured against its best frame.
        per_found = is_new ? needed : std::min(per_found, needed);
        is_new = false;
        surplus = std::max(0.0, tests - per_found * (found + quiet));
      }
      tests = found = 0;
      return surplus;
    }
  };
  /// Returns the growth per frame that adds up to `surplus_`.
  double growth_now() const { return frames_ > 0 ? 2 * surplus_ / (frames_ * frames_) : 0; }

  Work pairs_, rays_;
  double surplus_ = 0, frames_ = 0;  // since the tree was new
  double growth_ = 0, lasted_ = 0;   // of the tree before: its growth, and the number of its frames
};

}  // namespace kbvh
