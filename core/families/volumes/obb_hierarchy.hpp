#pragma once
#include "core/families/volumes/kernels/obb.hpp"
#include "core/families/volumes/lane_query.hpp"
#include "core/geometry/volumes/obb.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// How the frames of oriented boxes move.
struct ObbFrameRule {
  bool follow = true;       ///< with three of the points below; otherwise they stay until chosen again
  std::uint32_t every = 0;  ///< refits until frames are chosen again; 0: never
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
class ObbHierarchy {
 public:
  using Scalar = S;
  using Volume = Obb<S>;
  using Scratch = LaneScratch;

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

  const Topology& topology() const { return tree_.topology(); }
  bool empty() const { return tree_.empty(); }
  Volume volume(std::uint32_t node) const;
  std::vector<Volume> volumes() const;
  void set_volume(std::uint32_t node, const Volume& volume);
  std::size_t leaf_vertex_count() const { return tree_.leaf_point_count(); }
  std::size_t bytes() const;

  /// Appends the pairs of primitives of two bodies, or of one, whose boxes and all oriented boxes above them
  /// overlap. Counts the tests. Returns the number of pairs of nodes that the budget left undone.
  static std::size_t find_pairs(ObbHierarchy& a, std::uint32_t body_a, ObbHierarchy& b, std::uint32_t body_b,
                                Scratch& scratch, std::uint64_t& tests, const Budget& budget,
                                PairBuffer& out);

 private:
  void choose_frames();

  const ObbKernels<S>* kernels_;
  KernelSet set_;
  LaneTree<S> tree_;
  Cover cover_;
  ObbFrameRule rule_;
  std::uint32_t due_ = 0;  ///< refits until frames are chosen
  const S* placed_ = nullptr;
  AlignedArray<std::uint32_t> leaf_frames_, node_frames_;
  std::vector<std::uint32_t> list_;  ///< of the leaf whose frame is being chosen
  AlignedArray<S> rows_, own_, node_axes_, coordinates_, scratch_;
};

extern template class ObbHierarchy<float>;
extern template class ObbHierarchy<double>;

}  // namespace kbvh
