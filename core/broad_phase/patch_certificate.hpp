#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/face_contours.hpp"

namespace kbvh {

/// Proves that patches of a surface do not touch themselves (Volino & Magnenat-Thalmann 1994; in motion,
/// Provot 1997): all normals lie within a cone whose half-angle is less than a right angle, and the contour,
/// projected along the axis of the cone, does not touch itself.
///
/// Why this is enough, also for patches with holes, without connection, and where more than two faces have a
/// common side: every projected face has a positive area, so the number of faces over a point of the plane
/// that lies on no side is the sum of the winding numbers of the contour's loops around the point. If loops
/// neither touch each other nor themselves, and at most one of them turns to the left, that sum is at most 1:
/// projected faces have no common inner point. They have no common border point either, unless it belongs to
/// a common vertex or side: around the projection of a point inside the patch, the faces at that point
/// already cover every point once, and points of the contour are projected to different points. So two faces
/// without a common vertex have no common point, nor has a vertex or an edge with a face or an edge of the
/// patch to which it is not incident.
///
/// Every sign is proved with a bound on all rounding, in double: what is uncertain is not certified. Verdicts
/// are the same on every machine. Coordinates are at most admissible_magnitude<S>.
template <class S>
class PatchCertificate {
 public:
  /// Takes positions, [vertex][4]: at rest if `end` is null, else in straight motion from `begin` to `end`;
  /// certificates then hold for the whole motion. The positions have to outlive the calls.
  void take(const S* begin, const S* end) {
    begin_ = begin;
    end_ = end;
  }

  /// Returns whether no two elements of the patch below a node of the tree touch, unless they are incident.
  /// `contour` is the node's contour, `padded` the number of lanes of a leaf. O(faces + k log k) for a
  /// contour of k sides.
  bool holds(const ElementLeaves<S>& faces, std::uint32_t padded, std::uint32_t node,
             std::span<const FaceSide> contour);

  using Axis = std::array<double, 3>;
  /// The two conditions of `holds`: every normal of the faces has a positive component along the axis; and
  /// the loops of the contour do not touch in the projection along the axis, and at most one turns to the
  /// left. Contours whose sides' extents overlap very often are not certified.
  bool normals_agree(const ElementLeaves<S>& faces, std::uint32_t padded, std::uint32_t node,
                     const Axis& axis);
  bool contour_is_simple(std::span<const FaceSide> contour, const Axis& axis);
  /// Finds the axis: the direction of the patch's vector area, which is that of its contour; the largest
  /// magnitude of a component is 1. Returns false if the area is next to nothing.
  bool find_axis(std::span<const FaceSide> contour, Axis& axis) const;

  std::size_t bytes() const;

 private:
  struct Moving {
    double begin[3], end[3];
  };
  struct Extent {
    double low[2], high[2];  ///< contain the projection of the side at every time
    std::uint32_t side;
  };
  Moving difference(std::uint32_t to, std::uint32_t from) const;
  /// Returns the sign of axis . (a x b) throughout the motion; 0 if it is not certain, or changes.
  int turn(const Axis& axis, const Moving& a, const Moving& b) const;
  /// Returns whether two consecutive sides do not overlap: the second one begins where the first one ends.
  bool goes_on(const Axis& axis, const FaceSide& first, const FaceSide& second) const;
  /// Returns whether a line through one of two sides separates it from the other.
  bool apart(const Axis& axis, const FaceSide& a, const FaceSide& b) const;
  bool turns_right(const Axis& axis, std::span<const FaceSide> loop) const;
  void list_extents(std::span<const FaceSide> contour, const Axis& axis);

  const S *begin_ = nullptr, *end_ = nullptr;
  std::vector<std::uint32_t> nodes_, next_;  // next_: [side] the side that begins where this one ends
  std::vector<Extent> points_, extents_;
};

extern template class PatchCertificate<float>;
extern template class PatchCertificate<double>;

}  // namespace kbvh
