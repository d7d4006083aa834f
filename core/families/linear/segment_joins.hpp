#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/pacer.hpp"
#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/triangle_span_filter.hpp"

namespace kbvh {

/// The joins of one segment, with the verdicts on their pairs of triangles: one join per pair of bodies, or,
/// with many pairs, two joins for all of them, one with span tests and one without.
template <class S>
struct Joins {
  std::vector<IntervalJoin<S>> joins;
  std::vector<TriangleSpanFilter<S>> answers;

  explicit Joins(std::size_t count) : joins(count), answers(count) {}
  std::size_t bytes() const {
    std::size_t total = 0;
    for (const auto& join : joins) total += join.bytes();
    for (const auto& one : answers) total += one.bytes();
    return total;
  }
};

/// The progress of the work on the next segment. All work is in units of the cost of a box test.
struct WorkAhead {
  enum class Stage : std::uint8_t { nothing, bounds, joins, answers, done };
  Stage stage = Stage::nothing;
  std::size_t join = 0;  ///< the next join
  bool begun = false;    ///< work on that join has begun
  bool joins_begun = false;
  Pacer pacer;
  double done = 0;
};

}  // namespace kbvh
