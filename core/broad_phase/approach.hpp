#pragma once
#include "core/continuous/impact.hpp"

namespace kbvh {

/// Finds the first t in [0, 1] at which the distance of a closed vertex and a closed face, or of two closed
/// edges, is at most `distance`: a finite number of at least 0 and at most admissible_magnitude<double>. The
/// verdict is that of real arithmetic on the given numbers, as that of find_impact: no epsilon; a distance
/// that is reached at a single instant, t = 0 and t = 1 included, counts. Degenerate faces and edges count as
/// the segments or points that their corners span at t. The interval encloses the first such t.
///
/// Elements are near while the squared distance of two features is at most distance squared and the nearest
/// points of the features' lines or plane lie inside: inequalities of polynomials of degree 2 to 6 in t. The
/// filter bisects the motion: per unit of t, no two points come closer by more than the largest difference of
/// two corners' displacements, so a distance at the middle that exceeds `distance` by more than half an
/// interval's share excludes the interval. Distances are compared in double with bounds on all rounding, then
/// in dyadic numbers. An interval that this does not decide, a grazing motion for instance, is decided with
/// integers: the first t is its start or a root of one of the polynomials, roots are isolated by Sturm
/// sequences, and signs at a root are Tarski queries (as in find_impact).
///
/// The filter compares at most about a hundred distances; integers isolate the roots of up to 21 polynomials,
/// which is far slower and allocates. Thread-safe; `stats`, if given, must not be shared between threads.
Impact find_approach(Contact::Kind kind, const MovingPoints& points, double distance,
                     ImpactStats* stats = nullptr);

/// Decides the same without the filter, for tests.
Impact find_approach_exact(Contact::Kind kind, const MovingPoints& points, double distance);

/// Decides the same for t in [k, k + 1] / 2^exponent, without the filter; exponent is at most 20. The result
/// is in the whole motion's time.
Impact find_approach_within(Contact::Kind kind, const MovingPoints& points, double distance, unsigned k,
                            unsigned exponent);

}  // namespace kbvh
