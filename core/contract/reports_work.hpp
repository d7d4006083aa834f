#pragma once
#include <cstdint>

namespace kbvh {

/// Tells what its searches cost, also where nothing is counted: for strategies that choose among others.
class ReportsWork {
 public:
  virtual ~ReportsWork() = default;
  /// Returns the box tests of the last search for pairs.
  virtual std::uint64_t last_box_tests() const = 0;
  /// Makes the search of this frame ahead of its query, if it serves several frames and takes no more than so
  /// many box tests; returns whether the query costs no more than these. A search that takes more is
  /// abandoned at that number, which is counted, and the query will make all of it.
  virtual bool searches_within(std::uint64_t /*box_tests*/) { return true; }
  /// Returns the surfaces of all boxes of moving bodies, each over that of its root: what grows as trees age.
  /// 0 if the trees do not age. O(nodes).
  virtual double surface() { return 0; }
  /// Returns by how many box tests the surplus of a frame over new trees grows from frame to frame, summed
  /// over bodies, of a strategy that builds new ones.
  virtual double growth() const { return 0; }
  /// Returns the box tests of the last call for rays; 0 if it does not tell.
  virtual std::uint64_t last_ray_tests() const { return 0; }
  /// Returns the attempts to decide a pair of triangles for a span of time, since the last reset.
  virtual std::uint64_t span_tests() const { return 0; }
  /// Returns the pairs of triangles decided at single frames, since the last reset; 0 if it does not tell.
  /// What counters() has, too, but without memory for a table.
  virtual std::uint64_t frame_tests() const { return 0; }
};

}  // namespace kbvh
