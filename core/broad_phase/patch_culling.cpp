#include "core/broad_phase/patch_culling.hpp"

namespace kbvh {
namespace {

/// Returns whether the boxes of two lanes of a node overlap.
template <class S>
bool lanes_overlap(const S* rows, std::uint32_t i, std::uint32_t j) {
  bool meet = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const S* const lower = rows + 8 * axis;
    const S* const minus_upper = rows + 8 * (axis + 3);
    meet = meet & (lower[i] <= -minus_upper[j]) & (lower[j] <= -minus_upper[i]);
  }
  return meet;
}

}  // namespace

template <class S>
void PatchCulling<S>::split(const ElementLeaves<S>& faces, std::uint32_t node) {
  const WideNode& of = faces.tree.nodes[node];
  const S* const rows = faces.tree.child_bounds + node * lane_scalars(8);
  const auto child = [&](std::uint32_t lane) {
    return lane < of.leaf_count ? WidePair::leaf_bit | LeafSlot::of(node, lane)
                                : of.first_child + lane - of.leaf_count;
  };
  for (std::uint32_t i = 0; i < of.count; ++i) {
    if (i < of.leaf_count)
      leaf_pairs_.insert(leaf_pairs_.end(), 2, LeafSlot{LeafSlot::of(node, i)});
    else
      nodes_.push_back(child(i));
    for (std::uint32_t j = i + 1; j < of.count; ++j) {
      if (!lanes_overlap(rows, i, j)) continue;
      if (j < of.leaf_count) {
        leaf_pairs_.push_back({LeafSlot::of(node, i)});
        leaf_pairs_.push_back({LeafSlot::of(node, j)});
      } else {
        starts_.push_back({child(i), child(j)});
      }
    }
  }
  box_tests_ += std::uint64_t(of.count) * (of.count - 1U) / 2;
}

template <class S>
void PatchCulling<S>::run(const ElementLeaves<S>& faces, std::uint32_t padded, const FaceContours& contours,
                          const S* begin, const S* end) {
  certificate_.take(begin, end);
  certified_.clear();
  starts_.clear();
  leaf_pairs_.clear();
  patches_ = box_tests_ = 0;
  nodes_.assign(1, 0);
  while (!nodes_.empty()) {
    const std::uint32_t node = nodes_.back();
    nodes_.pop_back();
    ++patches_;
    if (certificate_.holds(faces, padded, node, contours.of(node)))
      certified_.push_back(node);
    else
      split(faces, node);
  }
}

template <class S>
std::size_t PatchCulling<S>::bytes() const {
  return certificate_.bytes() + (nodes_.capacity() + certified_.capacity()) * sizeof(std::uint32_t) +
         starts_.capacity() * sizeof(WidePair) + leaf_pairs_.capacity() * sizeof(LeafSlot);
}

template class PatchCulling<float>;
template class PatchCulling<double>;

}  // namespace kbvh
