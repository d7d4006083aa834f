#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/broad_phase/elements.hpp"

namespace kbvh {

/// Counts how distances were compared. tests = apart + filtered + exact.
struct DistanceStats {
  std::uint64_t tests = 0;
  std::uint64_t apart = 0;     ///< boxes are farther apart than the distance
  std::uint64_t filtered = 0;  ///< decided in double, with a bound on all rounding
  std::uint64_t exact = 0;     ///< reached exact arithmetic
};

/// Decides whether the distance of two closed elements is at most `distance`, exactly: the squared distance
/// of the given numbers against distance squared, in real arithmetic. a and b hold the corners of the
/// elements of `kind`, 3 coordinates each, up to three; their magnitudes are at most
/// admissible_magnitude<double>. Edges and faces whose corners coincide are the points or segments that they
/// span. A filtered test of a vertex and a face takes about 0.1 us, an exact one microseconds.
bool is_within(CandidateKind kind, const double* const* a, const double* const* b, double distance,
               DistanceStats* stats = nullptr);

/// Decides the same without floating-point filters, for tests.
bool is_within_exact(CandidateKind kind, const double* const* a, const double* const* b, double distance);

/// Copies the candidates whose elements are within the distance to `out`, which has room for all of them, in
/// their order, and returns their number. Points are [vertex][4].
template <class S>
std::size_t keep_within(CandidateKind kind, const Elements& elements, const S* points, double distance,
                        std::span<const Candidate> candidates, Candidate* out,
                        DistanceStats* stats = nullptr);

extern template std::size_t keep_within(CandidateKind, const Elements&, const float*, double,
                                        std::span<const Candidate>, Candidate*, DistanceStats*);
extern template std::size_t keep_within(CandidateKind, const Elements&, const double*, double,
                                        std::span<const Candidate>, Candidate*, DistanceStats*);

}  // namespace kbvh
