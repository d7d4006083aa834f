#pragma once
// The patches of a cloth below the nodes of one tree over its faces, and linear segments of its motion.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/element_tree.hpp"
#include "core/broad_phase/elements.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh::experiments::micro {

/// A tree over the faces of a mesh as the broad phase builds it, whose shape stays: certificates of patches
/// read the shape of a tree and positions, not its boxes.
class PatchTree {
 public:
  /// `v` are positions, three numbers a vertex, `f` faces, three vertices each.
  PatchTree(const std::vector<double>& v, const std::vector<std::uint32_t>& f, std::uint32_t leaf_size)
      : elements_(make_elements(v.size() / 3, MatrixView<std::uint32_t>(),
                                MatrixView<std::uint32_t>::by_rows(f.data(), f.size() / 3, 3))) {
    std::vector<double> boxes;
    for (std::size_t i = 0; i < v.size(); i += 3)
      for (int end = 0; end < 2; ++end) boxes.insert(boxes.end(), {v[i], v[i + 1], v[i + 2], 0});
    tree_.start(elements_.of(Element::face), leaf_size, active_kernel_set());
    tree_.refresh(boxes.data(), 2);
    leaves_ = tree_.leaves();
    contours_ = &tree_.contours(elements_.vertex_count());
    faces_below_.resize(1);
    for (std::uint32_t n = 0; n < faces_below_.size(); ++n)
      if (node(n).count > node(n).leaf_count)
        faces_below_.resize(std::size_t(node(n).first_child) + node(n).count - node(n).leaf_count);
    // Parents have smaller numbers than children.
    for (auto n = std::uint32_t(faces_below_.size()); n-- > 0;) {
      const WideNode& at = node(n);
      for (std::uint32_t leaf = at.first_leaf; leaf < at.first_leaf + at.leaf_count; ++leaf)
        faces_below_[n] += leaves_.end_entry[leaf] - leaves_.first_entry[leaf];
      for_children(n, [&](std::uint32_t child) { faces_below_[n] += faces_below_[child]; });
    }
  }
  PatchTree(const PatchTree&) = delete;
  PatchTree& operator=(const PatchTree&) = delete;

  const ElementLeaves<double>& leaves() const { return leaves_; }
  std::uint32_t padded() const { return tree_.padded_leaf_size(); }
  const FaceContours& contours() const { return *contours_; }
  std::uint32_t faces_below(std::uint32_t node) const { return faces_below_[node]; }

  /// Calls take(child) for the children of a node that are no leaves.
  template <class Take>
  void for_children(std::uint32_t parent, const Take& take) const {
    const WideNode& at = node(parent);
    for (std::uint32_t c = at.leaf_count; c < at.count; ++c) take(at.first_child + c - at.leaf_count);
  }
  /// Calls take(a, b, c) with the corners of the faces below a node, in the order of certificates, until it
  /// returns false; returns whether it never did.
  template <class Take>
  bool for_faces(std::uint32_t below, const Take& take) const {
    const WideNode& at = node(below);
    for (std::uint32_t leaf = at.first_leaf; leaf < at.first_leaf + at.leaf_count; ++leaf) {
      const std::uint32_t* const corners = leaves_.corners + std::size_t(3) * leaf * padded();
      for (std::uint32_t lane = 0; lane < leaves_.end_entry[leaf] - leaves_.first_entry[leaf]; ++lane)
        if (!take(corners[lane], corners[padded() + lane], corners[2 * padded() + lane])) return false;
    }
    for (std::uint32_t c = at.count; c-- > at.leaf_count;)
      if (!for_faces(at.first_child + c - at.leaf_count, take)) return false;
    return true;
  }

 private:
  const WideNode& node(std::uint32_t n) const { return leaves_.tree.nodes[n]; }

  Elements elements_;
  ElementTree<double> tree_;
  ElementLeaves<double> leaves_{};
  const FaceContours* contours_ = nullptr;
  std::vector<std::uint32_t> faces_below_;  // [node]
};

/// A linear segment of a flight plan: positions at its keyframes, three numbers a vertex.
struct ClothSegment {
  const std::vector<double>&begin, &end;
  /// Returns positions [vertex][4] at a time in [0, 1].
  std::vector<double> at(double t) const {
    std::vector<double> points;
    points.reserve(begin.size() / 3 * 4);
    for (std::size_t i = 0; i < begin.size(); ++i) {
      points.push_back((1 - t) * begin[i] + t * end[i]);
      if (i % 3 == 2) points.push_back(0);
    }
    return points;
  }
};

}  // namespace kbvh::experiments::micro
