#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/families/boxtree/boxtree_planes.hpp"

namespace kbvh {

/// How the sides are chosen that the nodes of a BoxTree own.
enum class PlaneChoice : std::uint8_t {
  start,  ///< as Zachmann 1995: two children are cut on one axis, for the least summed area of their boxes
          ///< at the start
  clip,   ///< each child owns the side that cuts most off what its box is expected to overlap, over the
          ///< positions of the whole clip
};

/// How a certificate search finds its candidates.
enum class Candidates : std::uint8_t {
  searched,  ///< by going down the tree, each time (Z&W figs. 8, 9)
  listed,    ///< from a list that one search made at the start
};

/// What a kinetic BoxTree is built like; the default is the paper's.
struct BoxTreeConstruction {
  PlaneChoice planes = PlaneChoice::start;
  Candidates candidates = Candidates::searched;
  /// Subtrees of so many leaves, at most, have no sides below their top: their boxes are made of the vertices
  /// of their leaves where they are asked for. 0: every node but the root owns one.
  std::uint32_t bare_leaves = 0;
  /// The clip is looked at in so many moments, at most.
  std::uint32_t moments = 16;
};

/// A node that owns no side of its box.
inline constexpr std::uint8_t no_side = 6;

/// Chooses the own sides of the nodes of a subtree for positions at several moments. A node's candidates are
/// its six sides: each would cut its parent's box, as inherited, to what the node needs. The best one leaves
/// the least volume to a box that is somewhere near, as large as the node's tight box is on average: the
/// expected number of overlaps (for a flat node the volume itself would be 0 whatever is cut). Sums are over
/// moments. O(nodes x moments).
template <class S>
class ExpectedOverlap {
 public:
  /// `ids` as `subtree_of` gives them. leaf_box(leaf, moment) is the tight box of a leaf's content; `top` the
  /// box of ids[0] at all moments, or null: the tight one.
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

  /// The own sides, in the order of the nodes; nothing is said of the first.
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
    std::uint32_t first_child = 0;  ///< 0: a leaf
    std::uint32_t leaves = 0;       ///< below
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
