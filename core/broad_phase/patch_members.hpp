#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/kernels/element_pairs.hpp"

namespace kbvh {

/// The certified patches to which faces, their vertices and their sides belong. Two elements of one patch
/// that have no common vertex do not touch: this is what tests of impacts need to know. Keeps its memory.
class PatchMembers {
 public:
  /// Marks the elements of the patches below the nodes `certified` of the faces' tree, in place of those
  /// marked before. After `forget_sides` O(sides log(sides)), else O(elements).
  template <class S>
  void mark(const Elements& elements, const ElementLeaves<S>& faces, std::uint32_t padded,
            std::span<const std::uint32_t> certified);
  /// Takes other faces or edges.
  void forget_sides() { sides_listed_ = false; }

  /// Returns whether the two elements are known to belong to one patch. `kind` is face_vertex or edge_edge.
  /// Of an element that belongs to more than two patches, two are known.
  bool together(CandidateKind kind, const Candidate& pair) const {
    if (kind == CandidateKind::edge_edge) return common(edges_[pair.first], edges_[pair.second]);
    const std::uint32_t patch = faces_[pair.first];
    return patch != none && (patch == vertices_[pair.second][0] || patch == vertices_[pair.second][1]);
  }
  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  using Two = std::array<std::uint32_t, 2>;
  static bool common(const Two& a, const Two& b) {
    return (a[0] != none && (a[0] == b[0] || a[0] == b[1])) ||
           (a[1] != none && (a[1] == b[0] || a[1] == b[1]));
  }
  static void add(Two& list, std::uint32_t one) {
    if (list[0] == none)
      list[0] = one;
    else if (list[1] == none && list[0] != one)
      list[1] = one;
  }
  void list_sides(const Elements& elements);

  std::vector<std::uint32_t> faces_;  // [face]: its patch
  std::vector<Two> vertices_, edges_;
  std::vector<Two> faces_at_;  // [edge]: faces that have it as a side
  bool sides_listed_ = false;
  std::vector<std::uint32_t> nodes_;  // for temporary use
  struct Side {
    std::uint64_t key;
    std::uint32_t face;
  };
  std::vector<Side> sides_;
};

}  // namespace kbvh
