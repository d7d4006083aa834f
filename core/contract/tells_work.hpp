#pragma once
#include <cstdint>

namespace kbvh {

/// Tells what its searches cost, also where nothing is counted: for strategies that choose among others.
class TellsWork {
 public:
  virtual ~TellsWork() = default;
  /// Returns the box tests of the last search for pairs.
  virtual std::uint64_t last_box_tests() const = 0;
  /// Returns the surfaces of all boxes of moving bodies, each over that of its root: what grows as trees age.
  /// 0 if the trees do not age. O(nodes).
  virtual double surface() { return 0; }
  /// Pairs of leaves that slabs separate, and those that they leave open.
  struct SlabPairs {
    std::uint64_t separated = 0, open = 0;
  };
  /// Returns the pairs of leaves that the last search compared by slabs; none without slabs.
  virtual SlabPairs last_slab_pairs() const { return {}; }
};

}  // namespace kbvh
