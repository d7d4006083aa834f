#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/families/boxtree/boxtree_planes.hpp"

namespace kbvh {

/// How the own sides of a BoxTree's nodes are chosen.
enum class PlaneChoice : std::uint8_t {
  /// As in Zachmann 1995: both children are cut on one axis, for the least summed area of their boxes at the
  /// start.
  start,
  /// Each child owns the side that saves its box most of the expected overlaps, over the positions of the
  /// whole clip.
  clip,
};

/// How a certificate's candidates are found.
enum class Candidates : std::uint8_t {
  searched,  ///< by a search of the tree, each time (Z&W figs. 8, 9)
  listed,    ///< from a list made by one search at the start
};

/// Options for the construction of a kinetic BoxTree. The defaults are those of the paper.
struct BoxTreeConstruction {
  PlaneChoice planes = PlaneChoice::start;
  Candidates candidates = Candidates::searched;
  /// Subtrees of at most this many leaves have no own sides below their top, and no leaf has one: queries
  /// must compute the boxes of leaves from their vertices. 0: every node but the root owns a side.
  std::uint32_t bare_leaves = 0;
  /// Maximum number of moments of the clip that PlaneChoice::clip evaluates.
  std::uint32_t moments = 16;
  /// PlaneChoice::start: the split axis (0, 1, 2) of the root, and that of all other inner nodes; `best_axis`
  /// for the best one. Given axes make the trees of Z&W Theorem 5 and fig. 10.
  int root_axis = best_axis, inner_axis = best_axis;
};

/// The own side of a node that owns none.
inline constexpr std::uint8_t no_side = 6;

/// Chooses the own sides of the nodes of a subtree for positions at several moments. Each of a node's six
/// sides would cut the inherited box of its parent to the node's tight box on that side. The best side leaves
/// the least expected number of overlaps with a nearby box, which is a cube whose edge is the mean extent of
/// the node's tight box. This number is the volume of the cut box enlarged by that edge. (The plain volume of
/// a flat node would be 0 whatever side is cut.) Sums are over moments. O(nodes x moments).
template <class S>
class ExpectedOverlap {
 public:
  /// `ids` must come from `subtree_of`. leaf_box(leaf, moment) is the tight box of a leaf's content. `top` is
  /// the box of ids[0] at all moments; if null, its tight box.
  template <class LeafBox>
  ExpectedOverlap(const Topology& topology, const std::vector<std::uint32_t>& ids, std::size_t moments,
                  LeafBox&& leaf_box, const Box<S>* top)
      : moments_(moments), nodes_(ids.size()), tight_(ids.size() * moments), boxes_(tight_.size()) {
    std::uint32_t next = 1;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const TopologyNode n = topology.nodes[ids[i]];
      nodes_[i] = {n.is_leaf() ? 0 : next, n.is_leaf() ? 1U : 0U};
      if (!n.is_leaf()) next += 2;
    }
    for (std::size_t i = ids.size(); i-- > 0;) {
      const std::uint32_t first = nodes_[i].first_child;
      for (std::size_t m = 0; m < moments; ++m) {
        Box<S>& box = tight_[i * moments + m];
        if (first == 0) {
          box = leaf_box(topology.nodes[ids[i]], m);
        } else {
          box = tight_[first * moments + m];
          box.extend(tight_[(first + 1) * moments + m]);
        }
      }
      if (first != 0) nodes_[i].leaves = nodes_[first].leaves + nodes_[first + 1].leaves;
    }
    for (std::size_t m = 0; m < moments; ++m) boxes_[m] = top != nullptr ? *top : tight_[m];
  }

  /// Returns the own sides in the order of the nodes. The entry of the first node has no meaning.
  std::vector<std::uint8_t> choose(std::uint32_t bare_leaves) {
    std::vector<std::uint8_t> sides(nodes_.size(), no_side);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (nodes_[i].first_child == 0) continue;
      for (std::size_t child = nodes_[i].first_child; child < nodes_[i].first_child + 2; ++child) {
        std::copy_n(boxes_.begin() + std::ptrdiff_t(i * moments_), moments_,
                    boxes_.begin() + std::ptrdiff_t(child * moments_));
        const bool bare =
            bare_leaves != 0 && (nodes_[i].leaves <= bare_leaves || nodes_[child].first_child == 0);
        if (bare) continue;
        sides[child] = best_side(child);
        cut(child, sides[child]);
      }
    }
    return sides;
  }

 private:
  struct Node {
    std::uint32_t first_child = 0;  ///< 0 for a leaf
    std::uint32_t leaves = 0;       ///< leaves below
  };
  static double extent(const Box<S>& box, int axis) {
    return double(box.upper[axis]) - double(box.lower[axis]);
  }

  std::uint8_t best_side(std::size_t node) const {
    const Box<S>* const tight = tight_.data() + node * moments_;
    const Box<S>* const inherited = boxes_.data() + node * moments_;
    double near = 0;
    for (std::size_t m = 0; m < moments_; ++m)
      for (int axis = 0; axis < 3; ++axis) near += extent(tight[m], axis);
    near /= 3 * double(moments_);
    std::array<double, 6> left{};
    for (std::size_t m = 0; m < moments_; ++m) {
      double sizes[3];
      for (int axis = 0; axis < 3; ++axis) sizes[axis] = extent(inherited[m], axis) + near;
      for (int axis = 0; axis < 3; ++axis) {
        const double others = sizes[(axis + 1) % 3] * sizes[(axis + 2) % 3];
        const double lower = double(tight[m].lower[axis]) - double(inherited[m].lower[axis]);
        const double upper = double(inherited[m].upper[axis]) - double(tight[m].upper[axis]);
        left[std::size_t(2 * axis)] += others * (sizes[axis] - lower);
        left[std::size_t(2 * axis + 1)] += others * (sizes[axis] - upper);
      }
    }
    return std::uint8_t(std::min_element(left.begin(), left.end()) - left.begin());
  }
  void cut(std::size_t node, std::uint8_t side) {
    for (std::size_t m = 0; m < moments_; ++m) {
      const Box<S>& tight = tight_[node * moments_ + m];
      Box<S>& box = boxes_[node * moments_ + m];
      if ((side & 1) != 0)
        box.upper[side >> 1] = tight.upper[side >> 1];
      else
        box.lower[side >> 1] = tight.lower[side >> 1];
    }
  }

  std::size_t moments_;
  std::vector<Node> nodes_;
  std::vector<Box<S>> tight_, boxes_;  ///< [node][moment]
};

}  // namespace kbvh
