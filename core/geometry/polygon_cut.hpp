#pragma once
#include <cstdint>
#include <memory>
#include <span>

namespace kbvh {

/// A polygon cut into triangles, and what is unusual about it.
struct PolygonCut {
  /// [triangle][3]: vertex ids, k - 2 triangles for a polygon of k > 3 corners, in its direction. Valid until
  /// the next call.
  std::span<const std::uint32_t> corners;
  /// No ear was left: the polygon crosses itself, or its area vector is zero although it is not straight. The
  /// union of the triangles is then not its even-odd region.
  bool crosses = false;
  /// The largest distance of a corner from the plane through the first one and across the area vector,
  /// divided by the largest distance of a corner from the first one; rounded, for messages only.
  double bent = 0;
};

/// Cuts polygons into triangles by ears. The inside is decided by the even-odd rule in the projection along
/// the polygon's area vector (the sum of the cross products of its corners). An ear is a corner that turns
/// with the polygon and whose triangle lies inside, free of edges. Ears whose diagonal avoids all other
/// corners are cut first, and among equals the one with the smallest diagonal (smaller id, larger id). The
/// triangles of a convex polygon are therefore the fan of its smallest id. If no ear is left, corners without
/// area are cut, then corners that turn with the polygon, then any. Without an area vector the cut is the fan
/// of the smallest id.
///
/// The result depends neither on the first corner nor on the direction of the list. All decisions are those
/// of real arithmetic on the given numbers (a filter first, then Boost.Multiprecision), for coordinates up to
/// admissible_magnitude<double>. For a simple planar polygon the union of the triangles is the polygon. Ids
/// and places may be repeated. O(k) for convex polygons. For other simple polygons, O(k) times the number of
/// corners and edges that overlap an ear or an edge in one coordinate; O(k^2) for all others. Keeps its
/// memory from call to call.
class PolygonCutter {
 public:
  PolygonCutter();
  ~PolygonCutter();
  PolygonCutter(PolygonCutter&&) noexcept;

  /// Cuts the polygon with the vertices `ids`, at least 4 of them; positions are [vertex][3].
  template <class S>
  PolygonCut cut(std::span<const std::uint32_t> ids, const S* positions);

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

extern template PolygonCut PolygonCutter::cut(std::span<const std::uint32_t>, const float*);
extern template PolygonCut PolygonCutter::cut(std::span<const std::uint32_t>, const double*);

}  // namespace kbvh
