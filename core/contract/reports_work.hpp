#pragma once
#include <cstdint>

namespace kbvh {

/// Reports the cost of searches, even in timed instances: for strategies that choose among others.
class ReportsWork {
 public:
  virtual ~ReportsWork() = default;
  /// Returns the box tests of the last search for pairs.
  virtual std::uint64_t last_box_tests() const = 0;
  /// Searches for this frame before its query, if one search serves several frames and takes at most this
  /// many box tests. Returns whether the query then costs no more than that. A longer search is given up at
  /// the limit: its tests so far are counted, and the query repeats all of it.
  virtual bool searches_within(std::uint64_t /*box_tests*/) { return true; }
  /// Returns the summed surface of all boxes of moving bodies, each divided by that of its root; it grows as
  /// trees age. 0 if the trees do not age. O(nodes).
  virtual double surface() { return 0; }
  /// For rebuilding strategies: returns the growth per frame of the box tests beyond a new tree's, summed
  /// over bodies.
  virtual double growth() const { return 0; }
  /// Returns the box tests of the last call for rays; 0 if they are not reported.
  virtual std::uint64_t last_ray_tests() const { return 0; }
  /// Returns the attempts to decide a pair of triangles for a span of time, since the last reset.
  virtual std::uint64_t span_tests() const { return 0; }
  /// Returns the pairs of triangles decided at single frames, since the last reset; 0 if they are not
  /// reported. The same number as in counters(), but without allocating a table.
  virtual std::uint64_t frame_tests() const { return 0; }
};

}  // namespace kbvh
