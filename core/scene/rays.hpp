#pragma once
#include <cstdint>
#include <limits>
#include <span>

#include "core/geometry/ray_box.hpp"
#include "core/geometry/ray_triangle.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// The points origin + s * direction with 0 <= s <= length. The direction may have any length; if it is zero,
/// the ray is the point `origin`.
template <class S>
struct Ray {
  S origin[3];
  S direction[3];
  S length = std::numeric_limits<S>::infinity();
};

/// Throws std::invalid_argument, naming the first ray with a coordinate or direction that is not finite or
/// beyond admissible_magnitude<S>, or with a length that is negative or not a number.
template <class S>
void check_rays(std::span<const Ray<S>> rays);

/// The question about a ray.
enum class RayQuery : std::uint8_t {
  closest,  ///< the primitive that the ray meets first; among equals, the smallest (body, primitive)
  any,      ///< one of the primitives that the ray meets
};

/// The answer to one ray. Polygons are the closed triangles into which they are cut and are met exactly
/// (core/geometry/ray_triangle.hpp), in both directions; points and control nets are not met.
struct RayHit {
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  std::uint32_t body = none;       ///< none: a miss
  std::uint32_t primitive = none;  ///< of a hit, none only in answers of peers that do not name it
  /// The parameter s at which the ray meets the primitive first; infinite for a miss. It differs from the
  /// exact one by a factor of at most 1 +- 2^-40.
  double parameter = std::numeric_limits<double>::infinity();

  explicit operator bool() const { return body != none; }
  bool operator==(const RayHit&) const = default;
};

/// Counts, for queries of rays, how bodies of polygons were treated, each body once a call. Bodies are
/// entered front to back: a ray enters a body only where it may meet the body's box before the closest hit so
/// far.
struct RayBodies {
  std::uint64_t entered = 0;  ///< searched for at least one ray
  std::uint64_t hidden = 0;   ///< never searched: each ray that meets the box had found its answer before
  std::uint64_t unmet = 0;    ///< never searched: no ray meets the box
};

/// The search for the answer to one ray: compares its candidates exactly.
template <class S>
class RaySearch {
 public:
  RaySearch(const Ray<S>& ray, RayQuery query) : query_(query) {
    for (int axis = 0; axis < 3; ++axis) {
      line_.origin[axis] = double(ray.origin[axis]);
      line_.direction[axis] = double(ray.direction[axis]);
    }
    line_.length = double(ray.length);
  }

  /// Tests a polygon; `positions` are those of its body. Returns whether the search has ended: any hit is
  /// wanted, and there is one.
  bool offer(std::uint32_t body, std::uint32_t primitive, const PolygonTriangles& polygon, const S* positions,
             TriangleTestStats& stats);

  /// Returns a parameter beyond which nothing can be the answer.
  double limit() const { return hit_ ? best_.parameter + best_.error : line_.length; }
  const RayLine& line() const { return line_; }
  /// Returns the test of boxes, whose `meet` never misses a box that the ray meets.
  RaySlabs box_test() const { return RaySlabs(line_); }
  const RayHit& hit() const { return hit_; }

 private:
  RayLine line_;
  RayQuery query_;
  RayHit hit_;
  RayMeeting best_;
  double corners_[9] = {};  ///< of the first triangle met
};

extern template class RaySearch<float>;
extern template class RaySearch<double>;

}  // namespace kbvh
