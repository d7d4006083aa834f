#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The grandchildren of a node, and the exchange of two of them that saves most surface: a tree rotation for
/// wide nodes (Kopta et al. 2012 rotate binary ones). Exchanging two cousins, instead of a child and a
/// grandchild, keeps the depth of all leaves. The node's own box, and those of its grandchildren, stay.
template <class S>
class Cousins {
 public:
  struct Exchange {
    std::uint32_t first, second;  ///< nodes of the topology
    S gain;                       ///< saved half surface; 0: no exchange saves any
  };

  /// Reads the boxes of the grandchildren. Returns false if fewer than two children have children.
  bool read(const WideHierarchy<S>& hierarchy, std::uint32_t node) {
    const Topology& topology = hierarchy.topology();
    const TopologyNode parent = topology.nodes[node];
    families_ = 0;
    for (std::uint32_t child = parent.first(); child < parent.first() + parent.count(); ++child)
      if (const TopologyNode content = topology.nodes[child]; !content.is_leaf())
        read(family_[families_++], hierarchy, content);
    return families_ > 1;
  }

  /// Finds the best exchange. O(width^4) operations; one vector performs `width` of them.
  Exchange best() const {
    Exchange best{0, 0, 0};
    for (std::uint32_t i = 0; i < families_; ++i)
      for (std::uint32_t j = i + 1; j < families_; ++j) {
        const Family &a = family_[i], &b = family_[j];
        for (std::uint32_t lane = 0; lane < a.count; ++lane) consider(a, lane, b, best);
      }
    return best;
  }

 private:
  static constexpr std::uint32_t width = 8;
  /// The children of one child: rows lower x, y, z, -upper x, y, z; empty lanes hold infinity.
  struct Family {
    S box[6][width];
    S rest[6][width];  ///< box of all other children
    S surface;         ///< half of the whole box's surface
    std::uint32_t first, count;
    bool leaf[width];
  };

  static S half_surface(S x, S y, S z) { return x * y + y * z + z * x; }

  static void read(Family& family, const WideHierarchy<S>& hierarchy, TopologyNode content) {
    constexpr S infinity = std::numeric_limits<S>::infinity();
    family.first = content.first();
    family.count = content.count();
    for (std::uint32_t lane = 0; lane < family.count; ++lane) {
      const Box<S> box = hierarchy.box(family.first + lane);
      for (int axis = 0; axis < 3; ++axis) {
        family.box[axis][lane] = box.lower[axis];
        family.box[axis + 3][lane] = -box.upper[axis];
      }
      family.leaf[lane] = hierarchy.topology().nodes[family.first + lane].is_leaf();
    }
    S whole[6];
    for (int row = 0; row < 6; ++row) {
      const S* const box = family.box[row];
      S* const rest = family.rest[row];
      for (std::uint32_t lane = family.count; lane < width; ++lane)
        family.box[row][lane] = rest[lane] = infinity;
      S before = infinity, behind = infinity;
      for (std::uint32_t lane = 0; lane < family.count; ++lane) {
        rest[lane] = before;
        before = std::min(before, box[lane]);
      }
      for (std::uint32_t lane = family.count; lane-- > 0;) {
        rest[lane] = std::min(rest[lane], behind);
        behind = std::min(behind, box[lane]);
      }
      whole[row] = before;
    }
    family.surface = half_surface(whole[0] + whole[3], whole[1] + whole[4], whole[2] + whole[5]);
  }

  /// Compares the exchanges of one grandchild with all of another family.
  static void consider(const Family& a, std::uint32_t lane, const Family& b, Exchange& best) {
    S moved[6], rest[6], cost[width];
    for (int row = 0; row < 6; ++row) {
      moved[row] = a.box[row][lane];
      rest[row] = a.rest[row][lane];
    }
    for (std::uint32_t k = 0; k < width; ++k) {
      S sum[2][3];
      for (int axis = 0; axis < 3; ++axis) {
        sum[0][axis] = std::min(rest[axis], b.box[axis][k]) + std::min(rest[axis + 3], b.box[axis + 3][k]);
        sum[1][axis] =
            std::min(moved[axis], b.rest[axis][k]) + std::min(moved[axis + 3], b.rest[axis + 3][k]);
      }
      cost[k] = half_surface(sum[0][0], sum[0][1], sum[0][2]) + half_surface(sum[1][0], sum[1][1], sum[1][2]);
    }
    const S now = a.surface + b.surface;
    for (std::uint32_t k = 0; k < b.count; ++k)
      if (now - cost[k] > best.gain && a.leaf[lane] == b.leaf[k])
        best = {a.first + lane, b.first + k, now - cost[k]};
  }

  Family family_[width];
  std::uint32_t families_ = 0;
};

}  // namespace kbvh
