#pragma once
#include "core/families/volumes/kernels/obb.hpp"
#include "core/families/volumes/lane_volumes.hpp"
#include "core/geometry/volumes/obb.hpp"

namespace kbvh {

/// How the frames of oriented boxes move.
struct ObbFrameRule {
  bool follow = true;       ///< with three of the points below; otherwise they stay until chosen again
  std::uint32_t every = 0;  ///< refits until frames are chosen again; 0: never
};

/// The numbers of an oriented box in rows (kernels/obb.hpp).
template <class S>
struct ObbLayout {
  using Volume = Obb<S>;
  using Kernels = ObbKernels<S>;
  static constexpr std::size_t rows = obb_rows, own = obb_own;
  template <class Any, class Visitor>
  static void visit(Any& box, const Visitor& visitor) {
    for (std::size_t i = 0; i < 3; ++i) {
      visitor(i, box.centre[i]);
      visitor(12 + i, box.half[i]);
      for (std::size_t d = 0; d < 3; ++d) visitor(3 + 3 * i + d, box.axis[i][d]);
    }
  }
};

/// The oriented boxes of one body's hierarchy, refitted and compared eight at a time. Each box contains the
/// points below its node, not the boxes of its children: O(points x depth), but the points of a node lie side
/// by side, so that a register measures up to 16 at once. Frames are chosen at the first refit
/// (obb_triples.hpp) and then follow three of the points.
///
/// Rounding (kernels/obb.cpp): halves are enlarged by 96 roundings (2^-24 or 2^-53 each) of the box's extents
/// and 4 of the centre's coordinates; a separating axis needs a gap of 512 roundings of the distance and the
/// extents. All admissible coordinates are sound; where squares of lengths would overflow or underflow, boxes
/// are aligned with the coordinate axes.
template <class S>
class ObbHierarchy : public LaneVolumes<S, ObbLayout<S>> {
  using Base = LaneVolumes<S, ObbLayout<S>>;

 public:
  ObbHierarchy(Topology topology, const Primitives& primitives, Cover cover,
               KernelSet kernels = active_kernel_set());

  /// Sets how frames move from the next refit on, which also chooses new frames.
  void set_rule(ObbFrameRule rule) {
    rule_ = rule;
    due_ = 0;
  }
  /// Takes a topology of width 8 over primitives that must outlive this object; volumes are empty until the
  /// next refit.
  void assign(Topology topology, const Primitives& primitives);
  /// Computes all boxes from positions [vertex][3], readable up to one scalar past the end.
  void refit(const S* positions);
  /// Chooses new frames at the next refit.
  void restore() { due_ = 0; }

  std::size_t bytes() const;

 private:
  void choose_frames();

  using Base::coordinates_, Base::kernels_, Base::list_, Base::own_, Base::placed_, Base::rows_,
      Base::scratch_, Base::tree_;
  ObbFrameRule rule_;
  std::uint32_t due_ = 0;  ///< refits until frames are chosen
  AlignedArray<std::uint32_t> leaf_frames_, node_frames_;
  AlignedArray<S> node_axes_;
};

extern template class LaneVolumes<float, ObbLayout<float>>;
extern template class LaneVolumes<double, ObbLayout<double>>;
extern template class ObbHierarchy<float>;
extern template class ObbHierarchy<double>;

}  // namespace kbvh
