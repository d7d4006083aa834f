#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/build/kernels/build_wide.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/parallel/workers.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// An 8-wide tree that is built from scratch at every frame, in the layout that queries read and without a
/// topology. Keeps its memory: a build allocates only if it needs more nodes or leaves than ever before.
template <class S>
class BuiltTree : public WideTree<S> {
 public:
  static constexpr std::uint32_t most_children = 8;

  /// Sets the largest number of primitives of a leaf, 1 to 16.
  void start(std::uint32_t leaf_size, KernelSet kernels);

  /// Begins a tree over `primitives` primitives, without any node.
  void clear(std::uint32_t primitives);
  /// Returns space for the primitives in the order of the leaves.
  std::uint32_t* entries() { return this->primitives_.data(); }
  /// Adds consecutive leaves, to be set by `set_leaf`; returns the first.
  std::uint32_t add_leaves(std::uint32_t count);
  /// Gives a leaf the entries [begin, end).
  void set_leaf(std::uint32_t leaf, std::uint32_t begin, std::uint32_t end) {
    KBVH_ASSERT(begin < end && end - begin <= this->leaf_size_);
    this->first_entry_[leaf] = begin;
    this->end_entry_[leaf] = end;
  }
  std::uint32_t leaf_count() const { return leaves_; }
  /// Adds consecutive nodes, to be set by `node`; returns the first. Children come after their parents.
  std::uint32_t add_nodes(std::uint32_t count);
  WideNode& node(std::uint32_t index) { return this->nodes_[index]; }
  std::uint32_t node_count() const { return std::uint32_t(this->nodes_.size()); }
  /// Computes all boxes from those of the primitives, [primitive][8]: lower x, y, z, unused, upper x, y, z,
  /// unused.
  void fit(const S* primitive_boxes);
  /// Does the same on the threads of `workers`: leaves first, then level by level up to the root. The nodes
  /// of a level must have consecutive numbers, in the order of their parents.
  void fit(Workers& workers, const S* primitive_boxes);

  /// Returns the boxes of the leaves, [leaf][8], like those of primitives: `fit` computes them.
  S* leaf_boxes() { return leaf_boxes_.data(); }

  /// Returns the tree as a topology, and the box of each node: for audits.
  Topology topology(std::vector<Box<double>>& boxes) const;

  std::size_t bytes() const {
    return this->tree_bytes() + leaf_boxes_.capacity() * sizeof(S) + levels_.capacity() * sizeof(levels_[0]);
  }

 private:
  /// Makes room for all boxes.
  void grow();
  /// Lists the first node of each level, and the number of nodes.
  void find_levels();
  /// Computes the rows and boxes of the leaves [begin, end).
  void fit_leaves(const S* primitive_boxes, std::uint32_t begin, std::uint32_t end);

  std::uint32_t leaves_ = 0;
  AlignedArray<S> leaf_boxes_;
  std::vector<std::uint32_t> levels_;  ///< for temporary use by `fit`
};

/// The children of a node: parts, of which those with a weight below 0 are leaves.
template <class Part>
struct Division {
  static constexpr std::uint32_t most = 8;
  std::array<Part, most> parts;
  std::array<double, most> weights;
  std::uint32_t count = 0;
  std::uint32_t leaves = 0, primitives = 0;  ///< leaves among the children, and their primitives
  /// The numbers of the first leaf and of the first node among the children, and the number of primitives in
  /// the leaves before: set by `number_children`.
  std::uint32_t first_leaf = 0, first_child = 0, placed = 0;
};

/// Memory for temporary use by `lay_out` on several threads.
template <class Part>
struct LayOutRoom {
  std::vector<Part> parts;                ///< of all nodes
  std::vector<Division<Part>> divisions;  ///< of the nodes of one level
  std::size_t bytes() const {
    return parts.capacity() * sizeof(Part) + divisions.capacity() * sizeof(Division<Part>);
  }
};

/// Divides a part into the children of a node: see `lay_out`.
template <class Source, class Part>
void divide(Source& source, std::uint32_t leaf_size, const Part& whole, Division<Part>& to) {
  const auto put = [&](std::uint32_t place, const Part& part) {
    to.parts[place] = part;
    to.weights[place] = source.count(part) <= leaf_size ? -1.0 : source.weight(part);
  };
  to.count = 1;
  put(0, whole);
  while (to.count < Division<Part>::most) {
    std::uint32_t heaviest = 0;
    for (std::uint32_t c = 1; c < to.count; ++c)
      if (to.weights[c] > to.weights[heaviest]) heaviest = c;
    if (to.weights[heaviest] < 0) break;
    const auto [first, second] = source.split(to.parts[heaviest]);
    put(heaviest, first);
    put(to.count++, second);
  }
  to.leaves = to.primitives = 0;
  for (std::uint32_t c = 0; c < to.count; ++c)
    if (to.weights[c] < 0) {
      ++to.leaves;
      to.primitives += source.size(to.parts[c]);
    }
}

/// Adds the children of a node to the tree, to be written by `write_children`; `placed` counts the primitives
/// of all leaves.
template <class S, class Part>
void number_children(BuiltTree<S>& tree, Division<Part>& division, std::uint32_t& placed) {
  division.first_leaf = tree.add_leaves(division.leaves);
  division.first_child =
      division.leaves != division.count ? tree.add_nodes(division.count - division.leaves) : 0;
  division.placed = placed;
  placed += division.primitives;
}

/// Sets node n and its leaves, and the parts of its other children in `parts`, those of all nodes.
template <class S, class Source, class Part>
void write_children(BuiltTree<S>& tree, Source& source, std::uint32_t n, const Division<Part>& division,
                    std::vector<Part>& parts) {
  WideNode node;
  node.first_leaf = division.first_leaf;
  node.first_child = division.first_child;
  node.leaf_count = std::uint8_t(division.leaves);
  node.count = std::uint8_t(division.count);
  tree.node(n) = node;
  std::uint32_t leaf = division.first_leaf, child = division.first_child, placed = division.placed;
  for (std::uint32_t c = 0; c < division.count; ++c) {
    const Part& part = division.parts[c];
    if (division.weights[c] < 0) {
      const auto [begin, end] = source.leaf(leaf, part, placed);
      tree.set_leaf(leaf++, begin, end);
      placed += source.size(part);
    } else {
      parts[child++] = part;
    }
  }
}

/// A binary tree that a builder makes from above, laid out with 8 children per node: a node takes the two
/// children of its binary node, then repeatedly replaces the heaviest child that is not a leaf by that
/// child's own two children until the node is full (Wald et al. 2008). `Source` has
///   Part                        a subtree: a range of primitives, or a node
///   count(part)                 primitives below, or a bound that tells a leaf
///   size(part)                  primitives of a leaf
///   weight(part)                of parts that are not leaves
///   split(part)                 the two children, as a std::pair
///   expect(leaves)              there will be this many leaves so far
///   leaf(number, part, placed)  the range of entries of a leaf, as a std::pair; `placed` is the number of
///                               primitives in the leaves before
/// A part with a count of at most `leaf_size` is a leaf. `parts` is for temporary use. O(nodes).
template <class S, class Source>
void lay_out(BuiltTree<S>& tree, Source& source, const typename Source::Part& root,
             std::vector<typename Source::Part>& parts) {
  const std::uint32_t first = tree.add_nodes(1);
  if (parts.size() <= first) parts.resize(first + 1);
  parts[first] = root;
  Division<typename Source::Part> division{};
  std::uint32_t placed = 0;
  for (std::uint32_t n = first; n < tree.node_count(); ++n) {
    divide(source, tree.leaf_size(), parts[n], division);
    number_children(tree, division, placed);
    if (parts.size() < tree.node_count()) parts.resize(tree.node_count());
    source.expect(tree.leaf_count());
    write_children(tree, source, n, division, parts);
  }
}

/// Lays out the same tree on the threads of `workers`, level by level: threads divide the nodes of a level,
/// the caller's thread numbers their children, and threads write them. Beyond the above, `Source` has
///   nodes_at_once      nodes that a thread divides at once
///   large(part)        whether the caller's thread divides the part, before the others; its `split` may then
///                      use all threads
/// Each thread works with a copy of `source`.
template <class S, class Source>
void lay_out(Workers& workers, BuiltTree<S>& tree, Source& source, const typename Source::Part& root,
             LayOutRoom<typename Source::Part>& room) {
  auto& parts = room.parts;
  if (!workers.several()) return lay_out(tree, source, root, parts);
  const std::uint32_t leaf_size = tree.leaf_size();
  std::uint32_t begin = tree.add_nodes(1), placed = 0;
  if (parts.size() <= begin) parts.resize(begin + 1);
  parts[begin] = root;
  while (begin < tree.node_count()) {
    const std::uint32_t end = tree.node_count();
    const Parts divided{end - begin, Source::nodes_at_once}, written{end - begin, 128};
    if (room.divisions.size() < divided.count) room.divisions.resize(divided.count);
    for (std::uint32_t n = begin; n < end; ++n)
      if (source.large(parts[n])) divide(source, leaf_size, parts[n], room.divisions[n - begin]);
    workers.for_each(divided.parts(), [&](std::size_t item, std::uint32_t) {
      Source own(source);
      for (std::size_t i = divided.begin(item); i < divided.end(item); ++i)
        if (!own.large(parts[begin + i])) divide(own, leaf_size, parts[begin + i], room.divisions[i]);
    });
    for (std::uint32_t i = 0; i < end - begin; ++i) number_children(tree, room.divisions[i], placed);
    if (parts.size() < tree.node_count()) parts.resize(tree.node_count());
    source.expect(tree.leaf_count());
    workers.for_each(written.parts(), [&](std::size_t item, std::uint32_t) {
      Source own(source);
      for (std::size_t i = written.begin(item); i < written.end(item); ++i)
        write_children(tree, own, std::uint32_t(begin + i), room.divisions[i], parts);
    });
    begin = end;
  }
}

extern template class BuiltTree<float>;
extern template class BuiltTree<double>;

}  // namespace kbvh
