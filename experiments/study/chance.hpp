#pragma once
#include <cstddef>
#include <cstdint>

namespace kbvh::experiments {

/// A random generator (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators"), the
/// same on every machine and in analysis/explorer/src/statistics.js.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : state_(seed) {}
  /// Returns a number below `count`, which is below 2^32.
  std::uint32_t below(std::size_t count) {
    std::uint64_t x = state_ += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return std::uint32_t(((x ^ (x >> 31)) >> 32) * count >> 32);
  }

 private:
  std::uint64_t state_;
};

}  // namespace kbvh::experiments
