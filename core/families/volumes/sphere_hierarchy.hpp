#pragma once
#include "core/families/volumes/kernels/sphere.hpp"
#include "core/families/volumes/lane_volumes.hpp"
#include "core/geometry/volumes/sphere.hpp"

namespace kbvh {

/// The contents of an inner node's sphere.
enum class SphereBounds : std::uint8_t {
  wrapped,  ///< the points below the node
  layered,  ///< the spheres of its children
};

/// The numbers of a sphere in rows (kernels/sphere.hpp).
template <class S>
struct SphereLayout {
  using Volume = Sphere<S>;
  using Kernels = SphereKernels<S>;
  static constexpr std::size_t rows = 4, own = 4;
  template <class Any, class Visitor>
  static void visit(Any& ball, const Visitor& visitor) {
    for (std::size_t d = 0; d < 3; ++d) visitor(d, ball.centre[d]);
    visitor(std::size_t(3), ball.radius);
  }
};

/// The spheres of one body's hierarchy, refitted and compared eight at a time. Each has the centre of the box
/// around the points below.
///
/// Wrapped spheres measure the distance to every point below each node: O(points x depth), but the points of
/// a node lie side by side, so that a register measures up to 16 at once. Layered spheres measure the
/// children: O(nodes); their radius is cut at the furthest corner of the box around the points.
///
/// Rounding: distances are computed in S and enlarged by 8 roundings (relative, 2^-24 or 2^-53 each), and by
/// 2^-70 (float) or 2^-500 (double) for underflow. Bodies with all coordinates below 2^-40 (2^-300), or with
/// a coordinate above 2^60 (2^400), are fitted by `fit` and `enclose` of Sphere, layered, without SIMD.
template <class S, SphereBounds bounds>
class SphereHierarchy : public LaneVolumes<S, SphereLayout<S>> {
  using Base = LaneVolumes<S, SphereLayout<S>>;

 public:
  SphereHierarchy(Topology topology, const Primitives& primitives, Cover cover,
                  KernelSet kernels = active_kernel_set());

  /// Takes a topology of width 8 over primitives that must outlive this object; volumes are empty until the
  /// next refit.
  void assign(Topology topology, const Primitives& primitives);
  /// Computes all spheres from positions [vertex][3], readable up to one scalar past the end.
  void refit(const S* positions);

  std::size_t bytes() const { return Base::bytes() + boxes_.capacity() * sizeof(S); }

 private:
  void refit_without_kernels();

  using Base::coordinates_, Base::kernels_, Base::list_, Base::own_, Base::placed_, Base::rows_,
      Base::scratch_, Base::tree_;
  AlignedArray<S> boxes_;
};

extern template class LaneVolumes<float, SphereLayout<float>>;
extern template class LaneVolumes<double, SphereLayout<double>>;
extern template class SphereHierarchy<float, SphereBounds::wrapped>;
extern template class SphereHierarchy<float, SphereBounds::layered>;
extern template class SphereHierarchy<double, SphereBounds::wrapped>;
extern template class SphereHierarchy<double, SphereBounds::layered>;

}  // namespace kbvh
