#include "core/topology/topology_edit.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/assert.hpp"

namespace kbvh {

namespace {
std::uint8_t below(std::uint8_t depth) {
  return std::uint8_t(std::min(255, depth + 1));
}
}  // namespace

TopologyEditor::TopologyEditor(const Topology& topology, std::uint32_t primitive_ids)
    : leaf_of_(primitive_ids, none), packed_entries_(std::uint32_t(topology.primitives.size())) {
  for (std::uint32_t node = 0; node < topology.size(); ++node) {
    const TopologyNode content = topology.nodes[node];
    if (!content.is_leaf()) continue;
    ++leaf_count_;
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
      leaf_of_[topology.primitives[k]] = node;
  }
}

std::uint32_t TopologyEditor::new_pair(Topology& topology) {
  if (!free_pairs_.empty()) {
    const std::uint32_t first = free_pairs_.back();
    free_pairs_.pop_back();
    return first;
  }
  const std::uint32_t first = topology.size();
  topology.nodes.resize(first + 2);
  topology.parents.resize(first + 2, none);
  topology.depths.resize(first + 2, 0);
  return first;
}

std::uint32_t TopologyEditor::new_entries(Topology& topology) {
  if (!free_entries_.empty()) {
    const std::uint32_t first = free_entries_.back();
    free_entries_.pop_back();
    return first;
  }
  const auto first = std::uint32_t(topology.primitives.size());
  topology.primitives.resize(first + topology.leaf_size, none);
  return first;
}

void TopologyEditor::free_entries(const Topology& topology, std::uint32_t first) {
  // Built leaves have no recorded capacity, so their entries are not recycled.
  if (first >= packed_entries_ || topology.leaf_size == 1) free_entries_.push_back(first);
}

void TopologyEditor::move(Topology& topology, std::uint32_t from, std::uint32_t to) {
  const TopologyNode content = topology.nodes[to] = topology.nodes[from];
  for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
    if (content.is_leaf())
      leaf_of_[topology.primitives[k]] = to;
    else
      topology.parents[k] = to;
}

std::uint32_t TopologyEditor::insert(Topology& topology, std::uint32_t leaf, std::uint32_t primitive,
                                     TopologyEdit& edit) {
  edit.clear();
  topology.perfect = false;
  if (leaf_of_.size() <= primitive) leaf_of_.resize(std::size_t(primitive) + 1, none);
  KBVH_ASSERT(leaf_of_[primitive] == none);
  const auto make_leaf = [&](std::uint32_t node) {
    const std::uint32_t entry = new_entries(topology);
    topology.primitives[entry] = primitive;
    topology.nodes[node] = TopologyNode::leaf(entry, 1);
    leaf_of_[primitive] = node;
    ++leaf_count_;
    return node;
  };
  if (topology.empty()) {
    topology.nodes.resize(1);
    topology.parents.assign(1, 0);
    topology.depths.assign(1, 0);
    edit.fresh.push_back(0);
    return make_leaf(0);
  }
  const TopologyNode content = topology.nodes[leaf];
  KBVH_ASSERT(content.is_leaf());
  if (content.count() < topology.leaf_size) {
    std::uint32_t first = content.first();
    if (first < packed_entries_) {  // no free entries behind it
      first = new_entries(topology);
      for (std::uint32_t i = 0; i < content.count(); ++i)
        topology.primitives[first + i] = topology.primitives[content.first() + i];
    }
    topology.primitives[first + content.count()] = primitive;
    topology.nodes[leaf] = TopologyNode::leaf(first, content.count() + 1);
    leaf_of_[primitive] = leaf;
    edit.changed.push_back(leaf);
    return leaf;
  }
  const std::uint32_t pair = new_pair(topology);
  move(topology, leaf, pair);
  topology.nodes[leaf] = TopologyNode::inner(pair, 2);
  make_leaf(pair + 1);
  for (std::uint32_t node = pair; node < pair + 2; ++node) {
    topology.parents[node] = leaf;
    topology.depths[node] = below(topology.depths[leaf]);
    edit.fresh.push_back(node);
  }
  edit.moved.push_back({leaf, pair});
  edit.changed.push_back(leaf);
  return pair + 1;
}

void TopologyEditor::remove(Topology& topology, std::uint32_t primitive, TopologyEdit& edit) {
  edit.clear();
  topology.perfect = false;
  const std::uint32_t leaf = leaf_of_[primitive];
  KBVH_ASSERT(leaf != none);
  leaf_of_[primitive] = none;
  const TopologyNode content = topology.nodes[leaf];
  if (content.count() > 1) {
    const std::uint32_t last = content.first() + content.count() - 1;
    for (std::uint32_t k = content.first(); k < last; ++k)
      if (topology.primitives[k] == primitive) topology.primitives[k] = topology.primitives[last];
    topology.nodes[leaf] = TopologyNode::leaf(content.first(), content.count() - 1);
    edit.changed.push_back(leaf);
    return;
  }
  free_entries(topology, content.first());
  --leaf_count_;
  edit.vacated.push_back(leaf);
  if (leaf == 0) {  // the tree is empty
    topology.nodes.clear();
    topology.parents.clear();
    topology.depths.clear();
    topology.primitives.clear();
    free_pairs_.clear();
    free_entries_.clear();
    packed_entries_ = 0;
    return;
  }
  take_out(topology, leaf, edit);
}

/// Removes a node from its parent; its own content is lost.
void TopologyEditor::take_out(Topology& topology, std::uint32_t node, TopologyEdit& edit) {
  const std::uint32_t parent = topology.parents[node];
  const TopologyNode siblings = topology.nodes[parent];
  const std::uint32_t last = siblings.first() + siblings.count() - 1;
  edit.changed.push_back(parent);
  const auto vacate = [&](std::uint32_t id) {
    topology.nodes[id] = TopologyNode();
    topology.parents[id] = none;
  };
  if (siblings.count() > 2) {
    topology.nodes[parent] = TopologyNode::inner(siblings.first(), siblings.count() - 1);
    if (node != last) {
      move(topology, last, node);
      topology.depths[node] = topology.depths[last];
      edit.moved.push_back({last, node});
      edit.vacated.push_back(last);
      edit.fresh.push_back(node);
    }
    vacate(last);
    return;
  }
  const std::uint32_t sibling = node == last ? siblings.first() : last;
  move(topology, sibling, parent);
  edit.moved.push_back({sibling, parent});
  edit.vacated.push_back(sibling);
  vacate(siblings.first());
  vacate(last);
  free_pairs_.push_back(siblings.first());
}

void TopologyEditor::placed(const Topology& topology, std::uint32_t leaf) {
  const TopologyNode content = topology.nodes[leaf];
  for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
    leaf_of_[topology.primitives[k]] = leaf;
}

std::uint32_t TopologyEditor::unbalanced_above(const Topology& topology, std::uint32_t primitive) const {
  const std::uint32_t leaf = leaf_of_[primitive];
  std::uint32_t depth = 0;
  for (std::uint32_t node = leaf; node != 0; node = topology.parents[node]) ++depth;
  if (double(depth) <= 2 * std::log2(double(leaf_count_))) return none;
  const auto leaves_below = [&](std::uint32_t top) {
    std::vector<std::uint32_t> open{top};
    std::uint64_t leaves = 0;
    while (!open.empty()) {
      const TopologyNode node = topology.nodes[open.back()];
      open.pop_back();
      if (node.is_leaf()) {
        ++leaves;
        continue;
      }
      for (std::uint32_t child = node.first(); child < node.first() + node.count(); ++child)
        open.push_back(child);
    }
    return leaves;
  };
  std::uint64_t below_child = 1;
  for (std::uint32_t child = leaf; child != 0;) {
    const std::uint32_t parent = topology.parents[child];
    const TopologyNode node = topology.nodes[parent];
    std::uint64_t below_parent = below_child;
    for (std::uint32_t other = node.first(); other < node.first() + node.count(); ++other)
      if (other != child) below_parent += leaves_below(other);
    if (double(below_child) > std::sqrt(0.5) * double(below_parent)) return parent;
    child = parent;
    below_child = below_parent;
  }
  return none;
}

void TopologyEditor::collect(const Topology& topology, std::uint32_t node, std::vector<PlacedLeaf>& leaves) {
  std::vector<std::uint32_t> open{node};
  while (!open.empty()) {
    const std::uint32_t top = open.back();
    open.pop_back();
    const TopologyNode content = topology.nodes[top];
    if (content.is_leaf()) {
      leaves.push_back({top, content});
      continue;
    }
    for (std::uint32_t child = content.first() + content.count(); child-- > content.first();)
      open.push_back(child);
  }
}

void TopologyEditor::rebuild(Topology& topology, std::uint32_t node, std::span<PlacedLeaf> leaves,
                             TopologyEdit& edit) {
  edit.clear();
  topology.perfect = false;
  std::vector<std::uint32_t> open{node};
  while (!open.empty()) {
    const std::uint32_t top = open.back();
    open.pop_back();
    const TopologyNode content = topology.nodes[top];
    if (content.is_leaf()) continue;
    for (std::uint32_t child = content.first(); child < content.first() + content.count(); ++child) {
      edit.vacated.push_back(child);
      open.push_back(child);
      if ((child - content.first()) % 2 == 1) free_pairs_.push_back(child - 1);
    }
  }
  for (const std::uint32_t gone : edit.vacated) {
    topology.nodes[gone] = TopologyNode();
    topology.parents[gone] = none;
  }
  edit.changed.push_back(node);
  place(topology, node, leaves, edit);
}

void TopologyEditor::place(Topology& topology, std::uint32_t node, std::span<PlacedLeaf> leaves,
                           TopologyEdit& edit) {
  if (leaves.size() == 1) {
    const TopologyNode content = topology.nodes[node] = leaves[0].content;
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
      leaf_of_[topology.primitives[k]] = node;
    edit.moved.push_back({leaves[0].node, node});
    return;
  }
  double lower[3], upper[3];
  for (int axis = 0; axis < 3; ++axis) lower[axis] = upper[axis] = leaves[0].centre[axis];
  for (const PlacedLeaf& leaf : leaves)
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], leaf.centre[axis]);
      upper[axis] = std::max(upper[axis], leaf.centre[axis]);
    }
  int longest = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (upper[axis] - lower[axis] > upper[longest] - lower[longest]) longest = axis;
  const std::size_t half = leaves.size() / 2;
  std::nth_element(leaves.begin(), leaves.begin() + std::ptrdiff_t(half), leaves.end(),
                   [longest](const PlacedLeaf& a, const PlacedLeaf& b) {
                     return a.centre[longest] != b.centre[longest] ? a.centre[longest] < b.centre[longest]
                                                                   : a.node < b.node;
                   });
  const std::uint32_t pair = new_pair(topology);
  topology.nodes[node] = TopologyNode::inner(pair, 2);
  for (std::uint32_t child = pair; child < pair + 2; ++child) {
    topology.parents[child] = node;
    topology.depths[child] = below(topology.depths[node]);
    edit.fresh.push_back(child);
  }
  place(topology, pair, leaves.first(half), edit);
  place(topology, pair + 1, leaves.subspan(half), edit);
}

bool is_perfect(const Topology& topology) {
  int leaf_depth = -1;
  for (std::uint32_t i = 0; i < topology.size(); ++i) {
    const TopologyNode node = topology.nodes[i];
    if (node.is_leaf()) {
      if (leaf_depth >= 0 && topology.depths[i] != leaf_depth) return false;
      leaf_depth = topology.depths[i];
    } else if (i != 0 && node.count() != topology.width) {
      return false;
    }
  }
  return true;
}

Topology compacted(const Topology& topology, std::vector<std::uint32_t>& order) {
  Topology result;
  result.width = topology.width;
  result.leaf_size = topology.leaf_size;
  order.clear();
  if (topology.empty()) return result;
  const auto add = [&](std::uint32_t old, std::uint32_t parent, std::uint8_t depth) {
    order.push_back(old);
    result.nodes.push_back(topology.nodes[old]);
    result.parents.push_back(parent);
    result.depths.push_back(depth);
  };
  add(0, 0, 0);
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const std::uint32_t node = open.back();
    open.pop_back();
    const TopologyNode old = topology.nodes[order[node]];
    if (old.is_leaf()) {
      result.nodes[node] = TopologyNode::leaf(std::uint32_t(result.primitives.size()), old.count());
      const auto first = topology.primitives.begin() + old.first();
      result.primitives.insert(result.primitives.end(), first, first + old.count());
      continue;
    }
    const std::uint32_t first = result.size();
    result.nodes[node] = TopologyNode::inner(first, old.count());
    for (std::uint32_t i = 0; i < old.count(); ++i) add(old.first() + i, node, below(result.depths[node]));
    for (std::uint32_t i = old.count(); i-- > 0;) open.push_back(first + i);
  }
  result.perfect = is_perfect(result);
  return result;
}

template <class S>
Topology edited_topology(Topology topology, std::vector<Box<S>> boxes, const BodyChange& change,
                         const Primitives& primitives, const S* positions) {
  TopologyEditor editor(topology, primitives.count());
  TopologyEdit edit;
  std::vector<std::pair<std::uint32_t, Box<S>>> moved;
  const auto carry_boxes = [&] {
    moved.clear();
    for (const auto& move : edit.moved) moved.emplace_back(move.to, boxes[move.from]);
    boxes.resize(topology.size());
    for (const auto& [node, box] : moved) boxes[node] = box;
  };
  // Boxes above removed primitives keep their size: they only guide insertions.
  for (const std::uint32_t p : change.removed_primitives) {
    editor.remove(topology, p, edit);
    carry_boxes();
  }
  for (std::uint32_t p = change.first_primitive; p < primitives.count(); ++p) {
    Box<S> box;
    for (const std::uint32_t v : primitives[p]) box.extend(positions + std::size_t(3) * v);
    const std::uint32_t old_leaf = leaf_for(topology, box, [&](std::uint32_t n) { return boxes[n]; });
    const std::uint32_t leaf = editor.insert(topology, old_leaf, p, edit);
    carry_boxes();
    if (!edit.fresh.empty()) boxes[leaf] = box;
    for (std::uint32_t node = leaf;; node = topology.parents[node]) {
      boxes[node].extend(box);
      if (node == 0) break;
    }
    for (std::uint32_t top; (top = editor.unbalanced_above(topology, p)) != TopologyEditor::none;) {
      editor.rebalance(topology, top, edit, [&](std::uint32_t n) { return to_double(boxes[n]); });
      carry_boxes();
      // Parents were placed before their children, so inner boxes are computed in reverse.
      for (std::size_t i = edit.fresh.size(); i-- > 0;) {
        const TopologyNode node = topology.nodes[edit.fresh[i]];
        if (node.is_leaf()) continue;
        boxes[edit.fresh[i]] = boxes[node.first()];
        boxes[edit.fresh[i]].extend(boxes[node.first() + 1]);
      }
    }
  }
  std::vector<std::uint32_t> order;
  return compacted(topology, order);
}

template Topology edited_topology(Topology, std::vector<Box<float>>, const BodyChange&, const Primitives&,
                                  const float*);
template Topology edited_topology(Topology, std::vector<Box<double>>, const BodyChange&, const Primitives&,
                                  const double*);

}  // namespace kbvh
