#pragma once
#include <algorithm>
#include <cstdint>

namespace kbvh {

/// The age of a tree as queries feel it: the box tests that they made beyond those of the tree when it was
/// new.
///
/// The number of pairs of primitives whose boxes overlap does not depend on the tree. A new tree is therefore
/// expected to need as many tests per such pair, and per frame, as in its first frame. When the surplus
/// summed over frames has cost as much as a rebuild, a rebuild is due: for a surplus that grows linearly this
/// is the period of least total cost.
class TreeAge {
 public:
  /// Registers a new tree: the next frame says what it needs.
  void renew() {
    surplus_ = 0;
    new_ = true;
  }
  /// Registers a tree that was improved, but not made anew. What it needs is still known, and forgotten
  /// slowly.
  void repair() {
    surplus_ = 0;
    per_pair_ *= 1.05;
  }
  /// Adds the box tests of a query of the current frame, and the pairs of primitives that it found.
  void add(std::uint64_t tests, std::uint64_t found) {
    tests_ += double(tests);
    found_ += double(found);
  }
  /// Ends the current frame and returns the surplus since the tree was new, in box tests.
  double end_frame() {
    if (new_ && tests_ > 0) {
      new_ = false;
      per_pair_ = tests_ / (found_ + quiet);
    } else if (!new_) {
      // A tree whose first frame was a bad one is measured against its best.
      per_pair_ = std::min(per_pair_, std::max(tests_, 1.0) / (found_ + quiet));
      surplus_ += std::max(0.0, tests_ - per_pair_ * (found_ + quiet));
    }
    tests_ = found_ = 0;
    return surplus_;
  }

 private:
  static constexpr double quiet = 1000;  // pairs that stand for the traversal of bodies without contact
  double tests_ = 0, found_ = 0;         // of the current frame
  double per_pair_ = 0;                  // of the new tree
  double surplus_ = 0;
  bool new_ = true;
};

}  // namespace kbvh
