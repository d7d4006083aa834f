#pragma once
#include "core/families/volumes/kernels/sphere.hpp"
#include "core/families/volumes/lane_query.hpp"
#include "core/geometry/volumes/sphere.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// The contents of an inner node's sphere.
enum class SphereBounds : std::uint8_t {
  wrapped,  ///< the points below the node
  layered,  ///< the spheres of its children
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
class SphereHierarchy {
 public:
  using Scalar = S;
  using Volume = Sphere<S>;
  using Scratch = LaneScratch;

  SphereHierarchy(Topology topology, const Primitives& primitives, Cover cover,
                  KernelSet kernels = active_kernel_set());

  /// Takes a topology of width 8 over primitives that must outlive this object; volumes are empty until the
  /// next refit.
  void assign(Topology topology, const Primitives& primitives);
  /// Computes all spheres from positions [vertex][3], readable up to one scalar past the end.
  void refit(const S* positions);
  /// Does nothing: the topology stays as assigned.
  void restore() {}

  const Topology& topology() const { return tree_.topology(); }
  bool empty() const { return tree_.empty(); }
  Volume volume(std::uint32_t node) const;
  std::vector<Volume> volumes() const;
  void set_volume(std::uint32_t node, const Volume& volume);
  std::size_t leaf_vertex_count() const { return tree_.leaf_point_count(); }
  std::size_t bytes() const;

  /// Appends the pairs of primitives of two bodies, or of one, whose boxes and all spheres above them
  /// overlap. Counts the tests. Returns the number of pairs of nodes that the budget left undone.
  static std::size_t find_pairs(SphereHierarchy& a, std::uint32_t body_a, SphereHierarchy& b,
                                std::uint32_t body_b, Scratch& scratch, std::uint64_t& tests,
                                const Budget& budget, PairBuffer& out);

 private:
  void refit_without_kernels();

  const SphereKernels<S>* kernels_;
  KernelSet set_;
  LaneTree<S> tree_;
  Cover cover_;
  const S* placed_ = nullptr;
  std::vector<std::uint32_t> list_;  ///< points of a leaf, if kernels are not used
  AlignedArray<S> rows_, own_, boxes_, coordinates_, scratch_;
};

extern template class SphereHierarchy<float, SphereBounds::wrapped>;
extern template class SphereHierarchy<float, SphereBounds::layered>;
extern template class SphereHierarchy<double, SphereBounds::wrapped>;
extern template class SphereHierarchy<double, SphereBounds::layered>;

}  // namespace kbvh
