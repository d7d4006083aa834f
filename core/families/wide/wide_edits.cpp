// The layout of a wide hierarchy follows edits of its topology. It requires that the leaves below a wide node
// lie side by side, and so do its other children; everything else may lie anywhere. An edit therefore moves
// only children of the nodes that it changed.
#include "core/families/wide/wide_edits.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/assert.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Follows one edit of a hierarchy's topology. First reads everything that moves; then writes.
template <class S>
class WideFollower {
 public:
  explicit WideFollower(WideHierarchy<S>& hierarchy)
      : h_(hierarchy), e_(hierarchy.edits_), width_(hierarchy.topology_.width) {}

  void follow() {
    move_places();
    find_changed();
    e_.children.clear();
    e_.contents.clear();
    for (Changed& changed : e_.changed) read(changed);
    const std::uint32_t root = read_root();
    for (const Gone& gone : e_.gone) release(gone);
    for (const Changed& changed : e_.changed) release_moving(changed);
    e_.nodes.clear();
    for (Changed& changed : e_.changed) seat(changed);
    if (root != stays) seat_node(0, 0, root);
    for (const std::uint32_t wide : e_.nodes) e_.order.insert(wide);
    for (const Changed& changed : e_.changed) write(changed);
    for (const Changed& changed : e_.changed) update_heights(h_.places_[changed.node].wide);
  }

 private:
  using Changed = typename WideEdits<S>::Changed;
  using Child = typename WideEdits<S>::Child;
  using Content = typename WideEdits<S>::Content;
  using Gone = typename WideEdits<S>::Gone;
  static constexpr std::uint32_t none = WidePlace::none;
  static constexpr std::uint32_t stays = none - 1;

  std::span<Child> children(const Changed& changed) {
    return {e_.children.data() + changed.first, changed.leaves + changed.inner};
  }
  std::span<Child> leaves(const Changed& changed) { return children(changed).first(changed.leaves); }
  std::span<Child> inner(const Changed& changed) { return children(changed).last(changed.inner); }
  static std::uint32_t inner_count(const WideNode& node) { return node.count - node.leaf_count; }
  std::size_t scalars() const { return lane_scalars(width_); }

  /// Contents with new ids keep their places; records the contents that no longer exist.
  void move_places() {
    auto& places = h_.places_;
    places.resize(h_.topology_.size());
    e_.places.clear();
    e_.gone.clear();
    const auto clear = [&](std::uint32_t id) {
      const std::uint32_t wide = places[id].wide;
      places[id] = {};
      if (wide == none) return;
      e_.gone.push_back({h_.nodes_[wide], e_.list_room[wide]});
      e_.order.remove(wide);
    };
    for (const auto& move : e_.edit.moved) e_.places.push_back(places[move.from]);
    for (const auto& move : e_.edit.moved) places[move.from] = {};
    for (const std::uint32_t id : e_.edit.vacated) clear(id);
    for (const auto& move : e_.edit.moved) clear(move.to);
    for (std::size_t i = 0; i < e_.places.size(); ++i) places[e_.edit.moved[i].to] = e_.places[i];
    places[0].node = none;  // a former child has no parent now
  }

  /// Finds the nodes whose children do not lie next to each other.
  void find_changed() {
    const Topology& topology = h_.topology_;
    e_.changed.clear();
    e_.node_marks.resize(topology.size(), 0);
    const auto check = [&](std::uint32_t node) {
      const TopologyNode content = topology.nodes[node];
      if (content.is_leaf() || e_.node_marks[node] != 0 || is_settled(node)) return;
      e_.node_marks[node] = 1;
      e_.changed.push_back({.node = node});
    };
    for (const auto* const list : {&e_.edit.changed, &e_.edit.fresh})
      for (const std::uint32_t node : *list) {
        check(node);
        check(topology.parents[node]);
      }
    for (const auto& move : e_.edit.moved) check(topology.parents[move.to]);
    for (const Changed& changed : e_.changed) e_.node_marks[changed.node] = 0;
  }
  bool is_settled(std::uint32_t node) const {
    const TopologyNode content = h_.topology_.nodes[node];
    const std::uint32_t wide = h_.places_[node].wide;
    if (wide == none || h_.nodes_[wide].count != content.count()) return false;
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      if (h_.places_[c].node != wide) return false;
    return true;
  }

  void read(Changed& changed) {
    const TopologyNode content = h_.topology_.nodes[changed.node];
    const std::uint32_t wide = h_.places_[changed.node].wide;
    if (wide != none) changed.layout = h_.nodes_[wide];
    changed.first = std::uint32_t(e_.children.size());
    for (const bool leaf : {true, false})
      for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
        if (h_.topology_.nodes[c].is_leaf() == leaf) {
          read_child(c);
          ++(leaf ? changed.leaves : changed.inner);
        }
    for (Child& child : inner(changed))
      if (child.number != none &&
          !(keeps_nodes(changed) && lies_in(child, changed.layout.first_child, changed.inner)))
        child.carried = read_node(child.number);
  }
  /// A changed node keeps the place of its leaves, or of its other children, if their number stays the same.
  static bool keeps_leaves(const Changed& changed) { return changed.leaves == changed.layout.leaf_count; }
  static bool keeps_nodes(const Changed& changed) { return changed.inner == inner_count(changed.layout); }
  static bool lies_in(const Child& child, std::uint32_t first, std::uint32_t count) {
    return child.number >= first && child.number - first < count;
  }

  void read_child(std::uint32_t node) {
    const WidePlace place = h_.places_[node];
    Child child{node, place.wide, none, 0, 0, 0, {}};
    std::fill_n(child.bounds, 6, std::numeric_limits<S>::infinity());
    if (place.node != none || place.wide != none) {
      const Box<S> box = h_.box(node);
      for (int axis = 0; axis < 3; ++axis) {
        child.bounds[axis] = box.lower[axis];
        child.bounds[axis + 3] = -box.upper[axis];
      }
    }
    if (h_.topology_.nodes[node].is_leaf()) {
      KBVH_ASSERT(place.node != none);  // edits keep the leaves
      child.number = h_.nodes_[place.node].first_leaf + place.lane;
      child.first_entry = h_.first_entry_[child.number];
      child.end_entry = h_.end_entry_[child.number];
      child.home = e_.home[child.number];
    }
    e_.children.push_back(child);
  }
  std::uint32_t read_node(std::uint32_t wide) {
    Content& content = e_.contents.emplace_back();
    content.node = h_.nodes_[wide];
    content.listed = h_.listed_[wide];
    content.rank = e_.order.rank(wide);
    content.height = e_.order.height(wide);
    content.list_room = e_.list_room[wide];
    std::copy_n(h_.node_bounds_.data() + std::size_t(8) * wide, 8, content.own);
    std::copy_n(h_.child_bounds_.data() + wide * scalars(), scalars(), content.rows);
    return std::uint32_t(e_.contents.size()) - 1;
  }
  /// Reads the root's content unless it is in wide node 0, where it belongs.
  std::uint32_t read_root() {
    const std::uint32_t wide = h_.places_[0].wide;
    return wide == 0 ? stays : wide == none ? none : read_node(wide);
  }

  void release(const Gone& gone) {
    release_leaves(gone.node.first_leaf, gone.node.leaf_count);
    release_nodes(gone.node.first_child, inner_count(gone.node));
    release_list(gone.node.list, gone.list_room);
  }
  void release_moving(const Changed& changed) {
    const WideNode& before = changed.layout;
    if (!keeps_leaves(changed)) release_leaves(before.first_leaf, before.leaf_count);
    if (!keeps_nodes(changed)) release_nodes(before.first_child, inner_count(before));
  }
  void release_leaves(std::uint32_t first, std::uint32_t count) {
    if (count == 0) return;
    h_.first_entry_[first] = std::exchange(e_.free_leaves[count], first);
  }
  void release_nodes(std::uint32_t first, std::uint32_t count) {
    if (count == 0) return;
    h_.nodes_[first].first_child = std::exchange(e_.free_nodes[count], first);
  }
  void release_list(std::uint32_t first, std::uint32_t length) {
    if (length == 0) return;
    h_.vertices_[first] = std::exchange(free_list(length), first);
  }

  std::uint32_t take_leaves(std::uint32_t count) {
    std::uint32_t& free = e_.free_leaves[count];  // nothing was released if count is 0
    if (free != none) return std::exchange(free, h_.first_entry_[free]);
    const auto first = std::uint32_t(h_.stamps_.size());
    for (auto* const list : {&h_.first_entry_, &h_.end_entry_, &e_.home, &h_.stamps_, &h_.fetched_})
      list->resize(first + count, 0);
    if (h_.padded_leaf_size() != 1)
      h_.rows_.resize((first + count) * lane_scalars(h_.padded_leaf_size()), S(0));
    return first;
  }
  std::uint32_t take_nodes(std::uint32_t count) {
    std::uint32_t& free = e_.free_nodes[count];
    if (free != none) return std::exchange(free, h_.nodes_[free].first_child);
    const auto first = std::uint32_t(h_.nodes_.size());
    h_.nodes_.resize(first + count);
    h_.check_node_count();
    h_.child_bounds_.resize((first + count) * scalars(), S(0));
    h_.node_bounds_.resize(std::size_t(8) * (first + count), S(0));
    h_.parent_.resize(first + count);
    h_.listed_.resize(first + count);
    e_.list_room.resize(first + count);
    e_.wide_marks.resize(first + count);
    e_.order.resize(first + count);
    return first;
  }
  std::uint32_t take_list(std::uint32_t length) {
    std::uint32_t& free = free_list(length);
    return free == none ? h_.new_list(length) : std::exchange(free, h_.vertices_[free]);
  }
  std::uint32_t& free_list(std::uint32_t length) {
    if (e_.free_lists.size() <= length) e_.free_lists.resize(length + 1, none);
    return e_.free_lists[length];
  }

  /// Assigns places to the children of a node. Those that are already in place stay.
  void seat(Changed& changed) {
    WideNode& layout = changed.layout;
    if (!keeps_leaves(changed)) layout.first_leaf = take_leaves(changed.leaves);
    if (!keeps_nodes(changed)) layout.first_child = take_nodes(changed.inner);
    layout.leaf_count = std::uint8_t(changed.leaves);
    layout.count = std::uint8_t(changed.leaves + changed.inner);
    seat_each(leaves(changed), layout.first_leaf, [&](const Child& leaf, std::uint32_t number) {
      h_.first_entry_[number] = leaf.first_entry;
      h_.end_entry_[number] = leaf.end_entry;
      e_.home[number] = leaf.home;
      if (number != leaf.number) h_.stamps_[number] = h_.fetched_[number] = 0;
    });
    seat_each(inner(changed), layout.first_child, [&](const Child& child, std::uint32_t number) {
      if (child.carried != none || child.number == none) seat_node(child.node, number, child.carried);
    });
  }
  template <class Put>
  void seat_each(std::span<Child> children, std::uint32_t first, const Put& put) {
    const auto count = std::uint32_t(children.size());
    unsigned taken = 0;
    for (const Child& child : children)
      if (lies_in(child, first, count)) taken |= 1u << (child.number - first);
    for (Child& child : children) {
      std::uint32_t number = child.number;
      if (!lies_in(child, first, count)) {
        const auto free = std::uint32_t(std::countr_one(taken));
        taken |= 1u << free;
        number = first + free;
      }
      put(child, number);
      child.number = number;
    }
  }
  void seat_node(std::uint32_t node, std::uint32_t wide, std::uint32_t carried) {
    h_.places_[node].wide = wide;
    if (carried == none) {
      h_.nodes_[wide] = {};
      h_.listed_[wide] = 0;
      e_.list_room[wide] = 0;
      e_.nodes.push_back(wide);
      return;
    }
    const Content& content = e_.contents[carried];
    h_.nodes_[wide] = content.node;
    h_.listed_[wide] = content.listed;
    e_.list_room[wide] = content.list_room;
    e_.order.renumber(content.rank, wide, content.height);
    std::copy_n(content.own, 8, h_.node_bounds_.data() + std::size_t(8) * wide);
    std::copy_n(content.rows, scalars(), h_.child_bounds_.data() + wide * scalars());
    const TopologyNode source = h_.topology_.nodes[node];
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      h_.places_[c].node = wide;
      if (h_.places_[c].wide != none) h_.parent_[h_.places_[c].wide] = wide;
    }
  }

  /// Writes a node with its new children.
  void write(const Changed& changed) {
    const std::uint32_t wide = h_.places_[changed.node].wide;
    WideNode& node = h_.nodes_[wide];
    const std::uint32_t list = node.list;
    node = changed.layout;
    node.list = list;
    S* const rows = h_.child_bounds_.data() + wide * scalars();
    std::fill_n(rows, scalars(), std::numeric_limits<S>::infinity());
    const auto place = [&](const Child& child, std::uint32_t lane) {
      h_.places_[child.node].node = wide;
      h_.places_[child.node].lane = lane;
      for (std::uint32_t row = 0; row < 6; ++row) rows[row * width_ + lane] = child.bounds[row];
    };
    LeafLists lists;
    for (const Child& leaf : leaves(changed)) {
      const std::uint32_t lane = leaf.number - node.first_leaf;
      place(leaf, lane);
      lists[lane] = h_.leaf_vertices_[leaf.home];
    }
    for (const Child& child : inner(changed)) {
      place(child, changed.leaves + child.number - node.first_child);
      h_.parent_[child.number] = wide;
    }
    h_.measure_lists(wide, lists);
    if (node.length > e_.list_room[wide]) {
      release_list(node.list, e_.list_room[wide]);
      node.list = take_list(node.length);
      e_.list_room[wide] = node.length;
    }
    h_.write_lists(wide, lists);
  }

  void update_heights(std::uint32_t wide) {
    for (;; wide = h_.parent_[wide]) {
      const WideNode& node = h_.nodes_[wide];
      std::uint32_t height = 0;
      for (std::uint32_t i = 0; i < inner_count(node); ++i)
        height = std::max(height, e_.order.height(node.first_child + i) + 1);
      if (height == e_.order.height(wide)) return;
      e_.order.set_height(wide, height);
      if (wide == 0) return;
    }
  }

  WideHierarchy<S>& h_;
  WideEdits<S>& e_;
  const std::uint32_t width_;
};

template <class S>
std::size_t WideEdits<S>::bytes() const {
  const auto of = [](const auto& list) { return list.capacity() * sizeof(list[0]); };
  return start.bytes() + order.bytes() + of(edit.moved) + of(edit.vacated) + of(edit.fresh) +
         of(edit.changed) + of(home) + of(list_room) + of(free_lists) + of(changed) + of(children) +
         of(contents) + of(gone) + of(places) + of(nodes) + of(node_marks) + of(wide_marks);
}

template <class S>
void WideHierarchy<S>::begin_edits() {
  KBVH_ASSERT(!refilled_);
  if (edited_ || empty()) return;
  edited_ = true;
  edits_.start = topology_;
  subtrees_.clear();
  above_subtrees_.clear();
  end_entry_.assign(first_entry_.begin() + 1, first_entry_.end());
  first_entry_.resize(leaf_count());
  edits_.home.resize(leaf_count());
  for (std::uint32_t node = 0; node < topology_.size(); ++node)
    if (topology_.nodes[node].is_leaf())
      edits_.home[nodes_[places_[node].node].first_leaf + places_[node].lane] = node;
  edits_.list_room.resize(nodes_.size());
  for (std::size_t n = 0; n < nodes_.size(); ++n) edits_.list_room[n] = nodes_[n].length;
  edits_.order.assign(nodes_);
  edits_.free_nodes.fill(none);
  edits_.free_leaves.fill(none);
  edits_.free_lists.clear();
  edits_.changed.clear();
  edits_.node_marks.assign(topology_.size(), 0);
  edits_.wide_marks.assign(nodes_.size(), 0);
}

template <class S>
void WideHierarchy<S>::follow_edit() {
  WideFollower<S>(*this).follow();
}

template <class S>
void WideHierarchy<S>::refit_edited(const S* positions) {
  auto& nodes = edits_.nodes;
  auto& marks = edits_.wide_marks;
  nodes.clear();
  for (const auto& changed : edits_.changed)
    for (std::uint32_t wide = places_[changed.node].wide; marks[wide] == 0; wide = parent_[wide]) {
      marks[wide] = 1;
      nodes.push_back(wide);
    }
  for (const std::uint32_t wide : nodes) marks[wide] = 0;
  const HeightOrder& order = edits_.order;
  std::sort(nodes.begin(), nodes.end(),
            [&](std::uint32_t a, std::uint32_t b) { return order.height(a) < order.height(b); });
  refit_listed(this->arrays(), positions, nodes);
}

template <class S>
void WideHierarchy<S>::undo_edits(const Primitives& primitives) {
  if (edited_) assign(Topology(edits_.start), primitives, kernels_);
  if (refilled_) refill(refill_.start, primitives);
}

template <class S>
Topology WideHierarchy<S>::built_topology(std::vector<std::uint32_t>& nodes) const {
  if (edited_) return compacted(topology_, nodes);
  nodes.resize(topology_.size());
  std::iota(nodes.begin(), nodes.end(), 0U);
  return topology_;
}

template struct WideEdits<float>;
template struct WideEdits<double>;
template void WideHierarchy<float>::begin_edits();
template void WideHierarchy<double>::begin_edits();
template void WideHierarchy<float>::follow_edit();
template void WideHierarchy<double>::follow_edit();
template void WideHierarchy<float>::refit_edited(const float*);
template void WideHierarchy<double>::refit_edited(const double*);
template void WideHierarchy<float>::undo_edits(const Primitives&);
template void WideHierarchy<double>::undo_edits(const Primitives&);
template Topology WideHierarchy<float>::built_topology(std::vector<std::uint32_t>&) const;
template Topology WideHierarchy<double>::built_topology(std::vector<std::uint32_t>&) const;

}  // namespace kbvh
