#pragma once
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

/// Plays a scene of curves through kinetic AABB trees (binary, one primitive per leaf), event by event, and
/// counts how often the realiser of each bound changes in each segment.
CurveRun measure_curves(const Scene<float>& scene);

/// Returns the largest degree of the scene's flight plans: 1, 2 or 3.
std::uint64_t degree_of(const Scene<float>& scene);

/// Returns the length of the longest Davenport-Schinzel sequence of n symbols of order 1 or 2, and an upper
/// bound for order 3: some symbol occurs at most l(n) / n times, and without it at most two neighbours are
/// equal, so that l(n) <= l(n - 1) + l(n) / n + 2 (Sharir & Agarwal 1995).
double most_pieces(std::uint64_t order, std::uint64_t n);

}  // namespace kbvh::theory
