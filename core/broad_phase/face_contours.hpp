#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/kernels/element_pairs.hpp"

namespace kbvh {

/// A side of a face, directed as the face's corners are listed.
struct FaceSide {
  std::uint32_t from, to;
  bool operator==(const FaceSide&) const = default;
};

/// The contours of the patches below the nodes of a tree over faces. The contour of a patch is what is left
/// of the sides of its faces when sides of opposite directions cancel each other. Contours depend on the
/// shape of the tree and on the faces' vertices only: a refit keeps them.
class FaceContours {
 public:
  /// Lists the contours of the nodes [0, nodes) of a tree whose parents have smaller numbers than children.
  /// `padded` is the number of lanes of a leaf. O(sides log(sides of a node) + contours). Keeps its memory.
  template <class S>
  void build(const ElementLeaves<S>& faces, std::uint32_t nodes, std::uint32_t padded,
             std::uint32_t vertices);

  /// Returns the contour of the patch below a node, loop after loop: each side begins where the one before
  /// ends, and the last side of a loop ends where its first one begins. No two sides begin at the same
  /// vertex. Empty if the contour is no such list, because loops have a common vertex or faces are directed
  /// inconsistently, and for closed surfaces.
  std::span<const FaceSide> of(std::uint32_t node) const {
    const Range& range = ranges_[node];
    return {sides_.data() + range.begin, range.simple ? range.count : 0};
  }
  std::size_t bytes() const;

 private:
  struct Range {
    std::size_t begin;
    std::uint32_t count;
    bool simple;   ///< a list of loops without common vertices
    bool tangled;  ///< a side is left several times; the sides are not listed
  };
  /// Lists the sides that are left of `keys_` as the contour of a node, loop after loop if possible.
  void keep_contour(std::uint32_t node);

  std::vector<Range> ranges_;  // [node]
  std::vector<FaceSide> sides_;
  // For temporary use.
  std::vector<std::uint64_t> keys_;
  std::vector<FaceSide> left_;
  std::vector<std::uint32_t> side_from_;  // [vertex]: 1 + the side of `left_` that begins there; 0: none
};

extern template void FaceContours::build(const ElementLeaves<float>&, std::uint32_t, std::uint32_t,
                                         std::uint32_t);
extern template void FaceContours::build(const ElementLeaves<double>&, std::uint32_t, std::uint32_t,
                                         std::uint32_t);

}  // namespace kbvh
