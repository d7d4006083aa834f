#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/element_search.hpp"
#include "core/broad_phase/patch_certificate.hpp"

namespace kbvh {

/// Cuts the search of a tree over faces with itself into pairs of different subtrees, and leaves out what
/// lies within a patch that certainly does not touch itself. Keeps its memory.
template <class S>
class PatchCulling {
 public:
  /// Tests patches from the root down to the nodes above leaves, until one is certified. Positions are those
  /// of PatchCertificate::take.
  void run(const ElementLeaves<S>& faces, std::uint32_t padded, const FaceContours& contours, const S* begin,
           const S* end);

  /// What is left: pairs of nodes, or of a node and a leaf, whose boxes overlap; and pairs of leaves, also of
  /// a leaf with itself. Valid until the next `run`.
  std::span<const WidePair> starts() const { return starts_; }
  std::span<const LeafSlot> leaf_pairs() const { return leaf_pairs_; }
  /// The certified nodes: none lies below another.
  std::span<const std::uint32_t> certified() const { return certified_; }
  /// Returns the number of patches tested, and of box tests.
  std::uint64_t patches() const { return patches_; }
  std::uint64_t box_tests() const { return box_tests_; }
  std::size_t bytes() const;

 private:
  void split(const ElementLeaves<S>& faces, std::uint32_t node);

  PatchCertificate<S> certificate_;
  std::vector<std::uint32_t> nodes_, certified_;
  std::vector<WidePair> starts_;
  std::vector<LeafSlot> leaf_pairs_;
  std::uint64_t patches_ = 0, box_tests_ = 0;
};

extern template class PatchCulling<float>;
extern template class PatchCulling<double>;

}  // namespace kbvh
