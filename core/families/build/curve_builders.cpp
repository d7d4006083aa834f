#include "core/families/build/curve_builders.hpp"

#include <algorithm>
#include <bit>
#include <mutex>
#include <utility>

namespace kbvh {
namespace {

/// Splits ranges of keys between cells of the curve's grid. Threads split disjoint ranges.
template <class S>
struct CellSource {
  using Part = KeyRange;
  static constexpr std::size_t nodes_at_once = 32;
  CurveOrder<S>& order;
  std::uint32_t leaf_size;
  std::mutex& refining;

  static bool large(const Part& /*part*/) { return false; }
  static std::uint32_t count(const Part& part) { return part.end - part.begin; }
  static std::uint32_t size(const Part& part) { return count(part); }
  static double weight(const Part& part) { return count(part); }
  static void expect(std::uint32_t /*leaves*/) {}
  static std::pair<std::uint32_t, std::uint32_t> leaf(std::uint32_t /*number*/, const Part& part,
                                                      std::uint32_t /*placed*/) {
    return {part.begin, part.end};
  }
  std::pair<Part, Part> split(const Part& part) {
    const std::uint32_t middle = middle_of(part);
    return {{part.begin, middle}, {middle, part.end}};
  }
  std::uint32_t middle_of(const Part& part) {
    const std::uint32_t leaves = (count(part) + leaf_size - 1) / leaf_size;
    if (leaves <= BuiltTree<S>::most_children)
      return part.begin + std::uint32_t(std::uint64_t(count(part)) * (leaves / 2) / leaves);
    const std::uint64_t* const keys = order.keys().data();
    const auto differing = [&] { return std::uint32_t((keys[part.begin] ^ keys[part.end - 1]) >> 32); };
    // A code that more primitives share than fit into a leaf.
    if (differing() == 0 && !refine(part)) return part.begin + count(part) / 2;
    const std::uint64_t bit = std::uint64_t(1) << (32 + std::bit_width(differing()) - 1);
    return std::uint32_t(std::partition_point(keys + part.begin, keys + part.end,
                                              [bit](std::uint64_t key) { return (key & bit) == 0; }) -
                         keys);
  }
  bool refine(const Part& part) {
    const std::lock_guard lock(refining);  // the order has memory for one refinement at a time
    return order.refine(part.begin, part.end);
  }
};

/// Writes the primitives in the order of their keys.
template <class S>
void write_entries(Workers& workers, BuiltTree<S>& tree, const CurveOrder<S>& order) {
  std::uint32_t* const entries = tree.entries();
  const std::uint64_t* const keys = order.keys().data();
  const Parts parts{order.count(), 8192};
  workers.for_each(parts.parts(), [&](std::size_t part, std::uint32_t) {
    for (std::size_t k = parts.begin(part); k < parts.end(part); ++k)
      entries[k] = CurveOrder<S>::primitive(keys[k]);
  });
}

/// Lays out a tree of equal leaves and full nodes, level by level from the root.
template <class S>
void lay_out_evenly(BuiltTree<S>& tree, std::uint32_t primitives) {
  constexpr std::uint32_t width = BuiltTree<S>::most_children;
  const std::uint32_t leaves = (primitives + tree.leaf_size() - 1) / tree.leaf_size();
  // Returns how many of `whole` items go to the parts before the i-th of `parts`.
  const auto share = [](std::uint32_t i, std::uint32_t parts, std::uint32_t whole) {
    return std::uint32_t(std::uint64_t(i) * whole / parts);
  };
  tree.add_leaves(leaves);
  for (std::uint32_t leaf = 0; leaf < leaves; ++leaf)
    tree.set_leaf(leaf, share(leaf, leaves, primitives), share(leaf + 1, leaves, primitives));
  std::array<std::uint32_t, 32> level{leaves};  // number of nodes, from the leaves up
  std::uint32_t top = 0;
  do {
    level[top + 1] = (level[top] + width - 1) / width;
    ++top;
  } while (level[top] > 1);
  std::uint32_t first = tree.add_nodes(1);
  for (; top > 0; --top) {
    const std::uint32_t nodes = level[top], below = level[top - 1];
    const std::uint32_t first_below = top > 1 ? tree.add_nodes(below) : 0;
    for (std::uint32_t n = 0; n < nodes; ++n) {
      const std::uint32_t begin = share(n, nodes, below), end = share(n + 1, nodes, below);
      WideNode node;
      node.count = std::uint8_t(end - begin);
      node.leaf_count = top > 1 ? 0 : node.count;
      (top > 1 ? node.first_child : node.first_leaf) = first_below + begin;
      tree.node(first + n) = node;
    }
    first = first_below;
  }
}

}  // namespace

template <class S>
void LinearBuilder<S>::build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order,
                             const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(workers, list, Curve::morton);
  std::mutex refining;
  CellSource<S> source{order, tree.leaf_size(), refining};
  lay_out(workers, tree, source, KeyRange{0, order.count()}, room_);
  write_entries(workers, tree, order);
  tree.fit(workers, order.boxes());
}

template <class S>
void ImplicitBuilder<S>::build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order,
                               const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(workers, list, curve_);
  order.refine_runs(workers, tree.leaf_size());
  lay_out_evenly(tree, order.count());
  write_entries(workers, tree, order);
  tree.fit(workers, order.boxes());
}

template class LinearBuilder<float>;
template class LinearBuilder<double>;
template class ImplicitBuilder<float>;
template class ImplicitBuilder<double>;

}  // namespace kbvh
