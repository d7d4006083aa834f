#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/boxtree/boxtree_leaves.hpp"
#include "core/families/boxtree/boxtree_sides.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/pairs.hpp"

namespace kbvh {

// A BoxTree (Zachmann 1995) is a binary hierarchy. Each node except the root owns at most one side of its
// box, and inherits the other sides from its parent. Sides are numbered 2 * axis + (0 lower, 1 upper).

/// The source of the leaf boxes that a query reads.
enum class LeafBoxes : std::uint8_t {
  inherited,  ///< as those of inner nodes: only realisers are read
  tight,      ///< computed from the leaf's vertices
};

/// A bounds view (traversal.hpp) of a kinetic BoxTree. A node's box is its parent's box with the own side
/// read from the realising vertex. Boxes are computed top-down, each once per frame; the caller must ensure a
/// parent before its children.
template <class S, class Tree>
class InheritedBoxes {
 public:
  InheritedBoxes(const Tree& tree, const SampledMotion<S>& motion, std::uint32_t body, BoxCache<S>& cache,
                 LeafBoxes leaf_boxes = LeafBoxes::inherited)
      : tree_(&tree), motion_(&motion), body_(body), cache_(&cache), leaf_boxes_(leaf_boxes) {}

  void ensure(std::uint32_t node) {
    if (!cache_->current(node)) cache_->store(node, make(node));
  }
  const Box<S>& operator()(std::uint32_t node) const { return cache_->volume(node); }

 private:
  Box<S> make(std::uint32_t node) const {
    if (leaf_boxes_ == LeafBoxes::tight && tree_->topology().nodes[node].is_leaf()) {
      const auto vertices = tree_->leaf_vertices(node);
      motion_->fetch(body_, vertices);
      return LaneBox<S>::of(vertices, motion_->positions(body_)).box();
    }
    if (node == 0) return box_of_realisers(tree_->root_realisers().data(), *motion_, body_);
    Box<S> box = cache_->volume(tree_->topology().parents[node]);
    const std::uint32_t side = tree_->own_side(node), axis = side >> 1;
    if (side == no_side) return box;
    const S value = motion_->position(body_, tree_->realiser(node))[axis];
    ((side & 1) != 0 ? box.upper : box.lower)[axis] = value;
    return box;
  }

  const Tree* tree_;
  const SampledMotion<S>* motion_;
  std::uint32_t body_;
  BoxCache<S>* cache_;
  LeafBoxes leaf_boxes_;
};

}  // namespace kbvh
