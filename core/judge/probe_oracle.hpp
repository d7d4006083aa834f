#pragma once
#include <cstdint>
#include <span>
#include <string>

#include "core/scene/playback.hpp"
#include "core/scene/probes.hpp"

namespace kbvh {

/// Answers rays at the playback's current time by testing every living polygon exactly: no boxes. It shares
/// with strategies the exact test, the comparison and the triangles of polygons. At the time at which
/// polygons are cut, the even-odd rule decides which simple planar ones a ray meets (polygon_region.hpp);
/// where the triangles disagree, the ray has a hit without a parameter. O(rays x primitives).
template <class S>
void brute_force_hits(const Scene<S>& scene, Playback<S>& playback, RayQuery query,
                      std::span<const Ray<S>> rays, std::span<RayHit> hits);

/// The comparison of answers to rays or balls with the truth.
struct ProbeCheck {
  std::uint64_t probes = 0;  ///< rays or balls that were compared
  std::uint64_t hits = 0;    ///< rays that truly meet something; primitives within balls
  std::uint64_t missed = 0;  ///< of these, reported as misses
  std::uint64_t extra = 0;   ///< reported as hits, and are none
  std::uint64_t misplaced =
      0;  ///< hits of another primitive than the truth, or, for any hit, of one that is not met
  std::uint64_t rounded = 0;  ///< hits of the true primitive at another parameter
  double parameter_error =
      0;  ///< of these: the largest difference of parameters, over the true one if that is not 0
  std::string first_violation;  ///< the first wrong answer: ray, answer and truth; or empty

  void add(const ProbeCheck& other);
  /// Returns whether all answers are exact.
  bool holds() const { return missed + extra + misplaced + rounded == 0; }
};

/// Compares answers at the playback's current time with the closest hits `truth`. Closest hits must be equal;
/// a reported "any hit" must be a primitive that the ray meets at that parameter.
template <class S>
ProbeCheck compare_hits(const Scene<S>& scene, const Playback<S>& playback, RayQuery query,
                        std::span<const Ray<S>> rays, std::span<const RayHit> found,
                        std::span<const RayHit> truth);

/// Finds the primitives within balls at the playback's current time, sorted, by comparing the distance to
/// every living primitive, in exact arithmetic where bounded doubles do not decide: no boxes of bodies or
/// nodes. O(balls x primitives).
template <class S>
BallHits brute_force_within(const Scene<S>& scene, Playback<S>& playback, std::span<const Ball<S>> balls);

/// Compares sorted answers to `balls` balls with the truth: every primitive within a ball counts.
ProbeCheck compare_within(std::size_t balls, const BallHits& found, const BallHits& truth);

/// Does the same as `compare_hits`, with the truth by brute force.
template <class S>
ProbeCheck check_hits(const Scene<S>& scene, Playback<S>& playback, RayQuery query,
                      std::span<const Ray<S>> rays, std::span<const RayHit> found);

}  // namespace kbvh
