#pragma once
#include <array>
#include <cstdint>
#include <span>

namespace kbvh {

/// Chooses a frame for an oriented box that follows the points when they move: the direction from the first
/// point to the second, the normal to it in the plane of the third, and the normal of the plane. The
/// candidates are those of Larsson and Källberg 2011 (DiTO-14), all of which have this form: the triangle of
/// distant points among those extreme along seven directions, and the two tetrahedra on it. Chooses the
/// candidate with the least surface over the extreme points. Both `points` (at least one) and the returned
/// points are times 3. O(points).
template <class S>
std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t> points, const S* positions);

extern template std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t>, const float*);
extern template std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t>, const double*);

}  // namespace kbvh
