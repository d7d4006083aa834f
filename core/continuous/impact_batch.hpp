#pragma once
#include <array>
#include <cstdint>

#include "core/continuous/impact.hpp"
#include "core/continuous/kernels/impacts.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// Up to `room` queries of one kind that are decided together: as find_impact decides each, with the same
/// verdicts and the same enclosures, bit for bit, by a filter that is vectorised over queries. Queries that
/// the filter leaves open go to find_impact one by one. 15 KiB; allocates only in exact tests.
///
/// Typical use, with pairs of ids from a broad phase: `add` until `full`, then `decide`, read `impact`, and
/// `clear`.
class ImpactBatch {
 public:
  static constexpr std::size_t room = ImpactBlock::room;
  /// A set of queries: bit i stands for query i, in the order in which they were added.
  using Mask = std::uint64_t;

  /// Smaller errors than the proved ones are for tests.
  explicit ImpactBatch(Contact::Kind kind, KernelSet kernels = active_kernel_set(),
                       const ImpactErrors& errors = impact_errors);

  Contact::Kind kind() const { return kind_; }
  std::size_t size() const { return size_; }
  bool full() const { return size_ == room; }
  void clear() { size_ = 0; }
  /// Returns all queries.
  Mask all() const { return size_ == 0 ? 0 : ~Mask(0) >> (room - size_); }

  /// Adds a query: the 3 coordinates of each point at t = 0 and at t = 1, in the order of MovingPoints. There
  /// must be room. The arrays need not live any longer.
  template <class S>
  void add(const S* const (&begin)[4], const S* const (&end)[4]) {
    for (std::size_t point = 0; point < 4; ++point)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        block_.points[0][point][axis][size_] = double(begin[point][axis]);
        block_.points[1][point][axis][size_] = double(end[point][axis]);
      }
    ++size_;
  }
  void add(const MovingPoints& points) { add(points.begin, points.end); }

  /// The numbers of one query.
  struct Query {
    double begin[4][3], end[4][3];
    MovingPoints points() const {
      return {{begin[0], begin[1], begin[2], begin[3]}, {end[0], end[1], end[2], end[3]}};
    }
  };
  Query query(std::size_t i) const;

  /// Returns queries whose elements are proved to be farther apart than `separation` from t = 0 to `until`,
  /// which is in [0, 1]. It need not find all of them.
  Mask apart_until(double until, double separation) const;
  /// Decides the given queries, and counts them as find_impact does.
  void decide(Mask which, ImpactStats* stats = nullptr);
  void decide(ImpactStats* stats = nullptr) { decide(all(), stats); }
  /// Returns the result of a query that the last `decide` was called for.
  const Impact& impact(std::size_t i) const { return impacts_[i]; }
  /// Returns those among the given queries that the vectorised filter decides by itself, and stores their
  /// results.
  Mask filter(Mask which);

 private:
  ImpactBlock block_{};
  std::array<Impact, room> impacts_;
  std::size_t size_ = 0;
  Contact::Kind kind_;
  const ImpactKernels* kernels_;
  ImpactErrors errors_;
};

}  // namespace kbvh
