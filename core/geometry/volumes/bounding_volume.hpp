#pragma once
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "core/geometry/box.hpp"

namespace kbvh {

/// Selects rows of an array of positions [point][3]: all of them, or those in a list.
template <class S>
class PointSet {
 public:
  PointSet(std::span<const std::uint32_t> vertices, const S* positions)
      : vertices_(vertices.data()), positions_(positions), size_(vertices.size()) {}
  PointSet(const S* positions, std::size_t count) : positions_(positions), size_(count) {}
  std::size_t size() const { return size_; }
  const S* operator[](std::size_t i) const {
    return positions_ + 3 * (vertices_ == nullptr ? i : std::size_t(vertices_[i]));
  }

 private:
  const std::uint32_t* vertices_ = nullptr;
  const S* positions_;
  std::size_t size_;
};

/// The scalar of a volume's numbers: its member type Scalar, or the scalar of a Box.
template <class V>
struct VolumeScalarOf {
  using type = typename V::Scalar;
};
template <class S>
struct VolumeScalarOf<Box<S>> {
  using type = S;
};
template <class V>
using VolumeScalar = typename VolumeScalarOf<V>::type;

/// A bounding volume: a closed convex set of points that a hierarchy keeps around the geometry below a node.
/// Models: Box<S> (aligned_box.hpp), Dop<S, K> (dop.hpp), Sphere<S> (sphere.hpp), Obb<S> (obb.hpp), each in
/// float and double.
///
/// A model is a plain value whose numbers are taken as exact: they define which real points are in the set.
/// All operations are conservative under rounding with regard to that set:
///   V{}                     the empty volume: contains nothing, overlaps nothing
///   fit(v, points)          v becomes a volume that contains every point of a set, exactly
///   enclose(v, children)    v becomes a volume that contains every volume of a list, exactly
///   overlap(a, b)           false only if no point is in both; may err to true where a model says so
///   surface_area(v)         in double, up to the rounding of a few operations; 0 if empty
///   protrusion(v, point)    how far 3 doubles lie outside: 0 if and only if the point is in the set, decided
///                           exactly; otherwise a positive distance, correct to rounding; infinite if empty
///   enclosing_box(v)        a Box<double> that contains the volume
/// Each model states which of its operations round outwards, and by how much. Numbers must be admissible
/// (`admissible_magnitude`). A volume occupies sizeof(V) bytes and owns no other memory.
template <class V>
concept BoundingVolume = std::is_trivially_copyable_v<V> && std::default_initializable<V> &&
    requires(V& v, const V& a, const V& b, PointSet<VolumeScalar<V>> points, std::span<const V> children,
             const double* point) {
  fit(v, points);
  enclose(v, children);
  { overlap(a, b) } -> std::same_as<bool>;
  { surface_area(a) } -> std::same_as<double>;
  { protrusion(a, point) } -> std::same_as<double>;
  { enclosing_box(a) } -> std::same_as<Box<double>>;
};

}  // namespace kbvh
