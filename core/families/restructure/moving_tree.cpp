#include "core/families/restructure/moving_tree.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/base/assert.hpp"
#include "core/families/wide/tree_topology.hpp"

namespace kbvh {

template <class S>
void MovingTree<S>::assign(const Topology& topology, const Primitives& primitives, KernelSet kernels) {
  KBVH_ASSERT(topology.width == 8);
  this->width_ = 8;
  this->leaf_size_ = topology.leaf_size;
  this->kernels_ = kernels;
  this->nodes_.clear();
  block_parent_.clear();
  free_blocks_.clear();
  leaves_.clear();
  order_.assign({});
  list_room_ = 0;
  if (topology.empty()) return;

  leaf_vertices_ = unique_leaf_vertices(topology, primitives);
  std::vector<std::uint32_t> offsets{0};  // by leaf: lists of inner nodes are empty
  std::vector<std::uint32_t> id(topology.size(), none);
  for (std::uint32_t n = 0; n < topology.size(); ++n) {
    if (!topology.nodes[n].is_leaf()) continue;
    id[n] = std::uint32_t(leaves_.size());
    leaves_.push_back(topology.nodes[n]);
    offsets.push_back(leaf_vertices_.offsets[n + 1]);
    list_room_ = std::max(list_room_, offsets.back() - offsets[offsets.size() - 2]);
  }
  leaf_vertices_.offsets = std::move(offsets);
  if (list_room_ > std::numeric_limits<std::uint16_t>::max())
    throw std::length_error("a leaf has " + std::to_string(list_room_) + " vertices; 65535 are possible");

  this->primitives_ = topology.primitives;
  this->list_corners(primitives);

  // A root that is a leaf still needs a node to hold it.
  new_block(none);
  std::vector<std::uint32_t> number(topology.size(), 0);
  const S infinity = std::numeric_limits<S>::infinity();
  const S no_box[6] = {infinity, infinity, infinity, infinity, infinity, infinity};
  make_node(0);
  if (topology.nodes[0].is_leaf()) add_leaf(0, 0, no_box);
  for (std::uint32_t n = 0; n < topology.size(); ++n) {
    const TopologyNode content = topology.nodes[n];
    if (content.is_leaf()) continue;
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      if (topology.nodes[c].is_leaf()) add_leaf(number[n], id[c], no_box);
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      if (!topology.nodes[c].is_leaf()) make_node(number[c] = add_inner(number[n], no_box));
  }
  order_.assign(this->nodes_);
  for (std::uint32_t n = 0; n < numbers(); ++n)
    if (this->nodes_[n].count == 0) order_.remove(n);
  std::fill(this->stamps_.begin(), this->stamps_.end(), 0);
  std::fill(this->fetched_.begin(), this->fetched_.end(), 0);
  this->stamp_ = 1;
}

template <class S>
void MovingTree<S>::refit(const S* positions) {
  wide_refit_kernels<S>(this->kernels_)
      .listed8(this->arrays(), positions, order_.nodes().data(), node_count());
}

template <class S>
ReinsertionSearch<S> MovingTree<S>::best_place(std::uint32_t node, std::uint32_t lane, S lane_price, S least,
                                               std::uint32_t most_visits) {
  KBVH_ASSERT(lane < this->nodes_[node].count);
  stack_.resize(std::max<std::size_t>(stack_.size(), std::size_t(8) * (order_.height(0) + 1)));
  ReinsertionSearch<S> job{};
  job.tree = {this->arrays(), block_parent_.data()};
  job.lane_price = lane_price;
  job.least = least;
  job.most_visits = most_visits;
  job.stack = stack_.data();
  job.node = node;
  job.lane = lane;
  if (this->nodes_[node].count > (node == 0 ? 2 : 1)) reinsertion_kernels<S>(this->kernels_).search(job);
  return job;
}

/// The child is at both places until it is taken out of the first one, so that no other node's number changes
/// in between.
template <class S>
void MovingTree<S>::move(const ReinsertionSearch<S>& found) {
  std::uint32_t from = found.node;
  const WideNode& node = this->nodes_[from];
  KBVH_ASSERT(found.gain > 0 && found.lane < node.count);
  S box[6];
  read_lane(from, found.lane, box);
  const bool is_leaf = found.lane < node.leaf_count;
  const std::uint32_t leaf = is_leaf ? leaf_at_[8 * from + found.lane] : none;
  const std::uint32_t child = is_leaf ? none : node.first_child + found.lane - node.leaf_count;
  for (std::uint32_t above = found.target; !is_leaf && above != 0; above = parent(above))
    if (above == child)
      throw std::invalid_argument("cannot move node " + std::to_string(child) + " below itself, to node " +
                                  std::to_string(found.target));
  const std::uint32_t to = found.target_lane == into ? found.target : pair_place(found);
  if (to == from && to != found.target)
    from = this->nodes_[to].first_child;  // next to the node that it leaves
  put_child(to, leaf, child, box);
  box_changed(to);
  settle(to);
  update_heights(to);
  update_heights(found.target);

  if (is_leaf)
    remove_leaf(from, lane_of_leaf(from, leaf));
  else
    remove_inner(from, child);
  box_changed(from);
  settle(from);
  update_heights(from);
  if (absorbs(from, found.lane_price)) absorb(from);
}

/// Makes a new node in the place of the target, with the target as its only child.
template <class S>
std::uint32_t MovingTree<S>::pair_place(const ReinsertionSearch<S>& found) {
  const std::uint32_t above = found.target, lane = found.target_lane, leaves = this->nodes_[above].leaf_count;
  S box[6];
  read_lane(above, lane, box);
  std::uint32_t place;
  if (lane < leaves) {
    const std::uint32_t leaf = leaf_at_[8 * above + lane];
    remove_leaf(above, lane);
    place = add_inner(above, box);
    make_node(place);
    order_.insert(place);
    add_leaf(place, leaf, box);
  } else {
    place = this->nodes_[above].first_child + lane - leaves;
    const std::uint32_t block = new_block(place);
    move_node(place, block);
    make_node(place);
    order_.insert(place);
    this->nodes_[place].first_child = block;
    this->nodes_[place].count = 1;
    set_lane(place, 0, box);
  }
  reinsertion_kernels<S>(this->kernels_).box(rows(place), own(place));
  return place;
}

template <class S>
void MovingTree<S>::put_child(std::uint32_t node, std::uint32_t leaf, std::uint32_t child, const S* box) {
  if (leaf != none)
    add_leaf(node, leaf, box);
  else
    move_node(child, add_inner(node, box));
}

/// Returns whether a node's children are better placed in its parent, as an only child always is.
template <class S>
bool MovingTree<S>::absorbs(std::uint32_t node, S lane_price) {
  if (node == 0) return false;
  const std::uint32_t count = this->nodes_[node].count, above = parent(node);
  if (count == 1) return true;
  if (this->nodes_[above].count + count - 1 > 8) return false;
  return surface(node) * (1 + lane_price * S(count)) > surface(above) * lane_price * S(count - 1);
}

/// Moves a node's children to its parent, in place of the node. The parent's box stays.
template <class S>
void MovingTree<S>::absorb(std::uint32_t node) {
  const std::uint32_t above = parent(node);
  const WideNode content = this->nodes_[node];
  S boxes[8][6];
  std::uint32_t leaves[8];
  for (std::uint32_t lane = 0; lane < content.count; ++lane) {
    read_lane(node, lane, boxes[lane]);
    if (lane < content.leaf_count) leaves[lane] = leaf_at_[8 * node + lane];
  }
  order_.remove(node);
  this->nodes_[node] = {};
  // Removes the node's number first: its parent may have no room for another child.
  remove_inner(above, node);
  for (std::uint32_t lane = 0; lane < content.leaf_count; ++lane) add_leaf(above, leaves[lane], boxes[lane]);
  for (std::uint32_t lane = content.leaf_count; lane < content.count; ++lane)
    move_node(content.first_child + lane - content.leaf_count, add_inner(above, boxes[lane]));
  if (content.leaf_count != content.count) {
    block_parent_[content.first_child / 8] = none;
    free_blocks_.push_back(content.first_child / 8);
  }
  update_heights(above);
}

template <class S>
void MovingTree<S>::settle() {
  for (const std::uint32_t node : order_.nodes()) settle(node);
}

template <class S>
S MovingTree<S>::surface(std::uint32_t node) {
  const S* const box = own(node);
  const S x = box[4] - box[0], y = box[5] - box[1], z = box[6] - box[2];
  return x * y + y * z + z * x;
}

/// Returns the first number of a block without nodes.
template <class S>
std::uint32_t MovingTree<S>::new_block(std::uint32_t parent) {
  if (free_blocks_.empty()) {
    free_blocks_.push_back(std::uint32_t(block_parent_.size()));
    block_parent_.push_back(none);
    grow(numbers() + 8);
  }
  const std::uint32_t block = free_blocks_.back();
  free_blocks_.pop_back();
  block_parent_[block] = parent;
  return 8 * block;
}

template <class S>
void MovingTree<S>::grow(std::uint32_t numbers) {
  if (numbers > WidePair::leaf_bit >> 3) throw std::length_error("a hierarchy of more than 2^28 nodes");
  const std::size_t lists = std::size_t(numbers) * 8 * list_room_;
  if (lists > std::numeric_limits<std::uint32_t>::max())
    throw std::length_error("the vertex lists of a hierarchy exceed 2^32 entries");
  const auto at_least = [](auto& list, std::size_t size) {
    if (list.size() < size) list.resize(size);
  };
  this->nodes_.resize(numbers);
  at_least(this->child_bounds_, numbers * lane_scalars(8));
  at_least(this->node_bounds_, std::size_t(8) * numbers);
  at_least(this->vertices_, lists);
  for (auto* const list :
       {&this->first_entry_, &this->end_entry_, &this->stamps_, &this->fetched_, &leaf_at_})
    at_least(*list, std::size_t(8) * numbers);
  if (this->padded_leaf_size() != 1)
    at_least(this->rows_, std::size_t(8) * numbers * lane_scalars(this->padded_leaf_size()));
  at_least(settled_, numbers);
  order_.resize(numbers);
}

template <class S>
void MovingTree<S>::make_node(std::uint32_t node) {
  WideNode& made = this->nodes_[node] = {};
  made.first_leaf = 8 * node;
  made.list = 8 * node * list_room_;
  std::fill_n(rows(node), lane_scalars(8), std::numeric_limits<S>::infinity());
}

/// Gives a node another, unused number. The parents' rows stay.
template <class S>
void MovingTree<S>::move_node(std::uint32_t from, std::uint32_t to) {
  const WideNode content = std::exchange(this->nodes_[from], {});
  WideNode& moved = this->nodes_[to] = content;
  moved.first_leaf = 8 * to;
  moved.list = 8 * to * list_room_;
  std::copy_n(rows(from), lane_scalars(8), rows(to));
  std::copy_n(own(from), 8, own(to));
  settled_[to] = settled_[from];
  for (std::uint32_t lane = 0; lane < content.leaf_count; ++lane)
    put_leaf(8 * to + lane, leaf_at_[8 * from + lane]);
  if (content.leaf_count != 0)
    std::copy_n(this->vertices_.begin() + content.list, std::size_t(8) * content.length,
                this->vertices_.begin() + moved.list);
  if (content.leaf_count != content.count) block_parent_[content.first_child / 8] = to;
  order_.renumber(order_.rank(from), to, order_.height(from));
}

template <class S>
void MovingTree<S>::put_leaf(std::uint32_t number, std::uint32_t leaf) {
  leaf_at_[number] = leaf;
  this->first_entry_[number] = leaves_[leaf].first();
  this->end_entry_[number] = leaves_[leaf].first() + leaves_[leaf].count();
  this->stamps_[number] = this->fetched_[number] = 0;
}

template <class S>
void MovingTree<S>::write_lists(std::uint32_t index) {
  WideNode& node = this->nodes_[index];
  std::size_t length = 0;
  for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane)
    length = std::max(length, leaf_vertices_[leaf_at_[8 * index + lane]].size());
  node.length = std::uint16_t(length);
  if (length == 0) return;
  std::uint32_t* const lists = this->vertices_.data() + node.list;
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const auto list = leaf_vertices_[leaf_at_[8 * index + (lane < node.leaf_count ? lane : 0)]];
    std::uint32_t* const to = lists + list_place(lane, 8);
    for (std::size_t i = 0; i < length; ++i) to[8 * i] = 3 * list[std::min(i, list.size() - 1)];
  }
}

template <class S>
void MovingTree<S>::copy_lane(std::uint32_t node, std::uint32_t from, std::uint32_t to) {
  S* const row = rows(node);
  for (std::uint32_t k = 0; k < 6; ++k) row[8 * k + to] = row[8 * k + from];
}
template <class S>
void MovingTree<S>::read_lane(std::uint32_t node, std::uint32_t lane, S* box) {
  for (std::uint32_t k = 0; k < 6; ++k) box[k] = rows(node)[8 * k + lane];
}
template <class S>
void MovingTree<S>::set_lane(std::uint32_t node, std::uint32_t lane, const S* box) {
  for (std::uint32_t k = 0; k < 6; ++k) rows(node)[8 * k + lane] = box[k];
}

/// Leaves come first, so the other children move by one lane.
template <class S>
void MovingTree<S>::add_leaf(std::uint32_t index, std::uint32_t leaf, const S* box) {
  WideNode& node = this->nodes_[index];
  KBVH_ASSERT(node.count < 8);
  for (std::uint32_t lane = node.count; lane > node.leaf_count; --lane) copy_lane(index, lane - 1, lane);
  set_lane(index, node.leaf_count, box);
  put_leaf(8 * index + node.leaf_count, leaf);
  ++node.leaf_count;
  ++node.count;
  write_lists(index);
}

template <class S>
void MovingTree<S>::remove_leaf(std::uint32_t index, std::uint32_t lane) {
  WideNode& node = this->nodes_[index];
  KBVH_ASSERT(lane < node.leaf_count);
  const std::uint32_t last = node.leaf_count - 1U;
  if (lane != last) {
    copy_lane(index, last, lane);
    put_leaf(8 * index + lane, leaf_at_[8 * index + last]);
  }
  for (std::uint32_t k = last; k + 1 < node.count; ++k) copy_lane(index, k + 1, k);
  --node.leaf_count;
  --node.count;
  constexpr S infinity = std::numeric_limits<S>::infinity();
  constexpr S no_box[6] = {infinity, infinity, infinity, infinity, infinity, infinity};
  set_lane(index, node.count, no_box);
  write_lists(index);
}

/// Returns the number of the new child, which is not a node yet.
template <class S>
std::uint32_t MovingTree<S>::add_inner(std::uint32_t index, const S* box) {
  if (inner_count(this->nodes_[index]) == 0) {
    const std::uint32_t block = new_block(index);
    this->nodes_[index].first_child = block;
  }
  WideNode& node = this->nodes_[index];
  KBVH_ASSERT(node.count < 8);
  set_lane(index, node.count, box);
  ++node.count;
  return node.first_child + inner_count(node) - 1;
}

/// Closes the gap of a child that is no longer a node.
template <class S>
void MovingTree<S>::remove_inner(std::uint32_t index, std::uint32_t child) {
  WideNode& node = this->nodes_[index];
  const std::uint32_t last = node.first_child + inner_count(node) - 1;
  KBVH_ASSERT(child >= node.first_child && child <= last && this->nodes_[child].count == 0);
  if (child != last) {
    copy_lane(index, node.count - 1U, node.leaf_count + child - node.first_child);
    move_node(last, child);
  }
  --node.count;
  constexpr S infinity = std::numeric_limits<S>::infinity();
  constexpr S no_box[6] = {infinity, infinity, infinity, infinity, infinity, infinity};
  set_lane(index, node.count, no_box);
  if (inner_count(node) != 0) return;
  block_parent_[node.first_child / 8] = none;
  free_blocks_.push_back(node.first_child / 8);
}

template <class S>
std::uint32_t MovingTree<S>::lane_of_leaf(std::uint32_t node, std::uint32_t leaf) const {
  std::uint32_t lane = 0;
  while (leaf_at_[8 * node + lane] != leaf) ++lane;
  KBVH_ASSERT(lane < this->nodes_[node].leaf_count);
  return lane;
}

/// Recomputes the boxes of a node and of those above that change.
template <class S>
void MovingTree<S>::box_changed(std::uint32_t node) {
  const auto box_of = reinsertion_kernels<S>(this->kernels_).box;
  for (;; node = parent(node)) {
    S box[8] = {};
    box_of(rows(node), box);
    S* const before = own(node);
    if (std::equal(box, box + 3, before) && std::equal(box + 4, box + 7, before + 4)) return;
    std::copy_n(box, 3, before);
    std::copy_n(box + 4, 3, before + 4);
    if (node == 0) return;
    const S sides[6] = {box[0], box[1], box[2], -box[4], -box[5], -box[6]};
    set_lane(parent(node), lane_in_parent(node), sides);
  }
}

template <class S>
void MovingTree<S>::update_heights(std::uint32_t index) {
  for (;; index = parent(index)) {
    const WideNode& node = this->nodes_[index];
    std::uint32_t height = 0;
    for (std::uint32_t i = 0; i < inner_count(node); ++i)
      height = std::max(height, order_.height(node.first_child + i) + 1);
    if (height == order_.height(index)) return;
    order_.set_height(index, height);
    if (index == 0) return;
  }
}

template <class S>
Topology MovingTree<S>::topology(std::vector<Box<double>>& boxes) const {
  return topology_of(
      std::span<const WideNode>(this->nodes_), this->child_bounds_.data(), this->node_bounds_.data(), 8,
      this->leaf_size_, [&](std::uint32_t leaf) { return this->leaf_primitives(leaf); }, boxes);
}

template <class S>
std::string MovingTree<S>::check() const {
  if (this->nodes_.empty()) return {};
  std::vector<std::uint8_t> leaf_seen(leaves_.size(), 0);
  std::vector<std::uint32_t> open{0};
  std::uint32_t nodes = 0;
  const auto at = [](std::uint32_t node, const char* what) {
    return "node " + std::to_string(node) + ": " + what;
  };
  while (!open.empty()) {
    const std::uint32_t index = open.back();
    open.pop_back();
    ++nodes;
    const WideNode& node = this->nodes_[index];
    if (node.count > 8 || node.leaf_count > node.count || (index != 0 && node.count < 2))
      return at(index, "number of children");
    if (node.first_leaf != 8 * index || node.list != 8 * index * list_room_)
      return at(index, "its leaves' room");
    std::uint32_t height = 0;
    for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane) {
      const std::uint32_t leaf = leaf_at_[8 * index + lane];
      if (leaf >= leaves_.size() || leaf_seen[leaf]++ != 0)
        return at(index, "a leaf that lies elsewhere, too");
      if (this->first_entry_[8 * index + lane] != leaves_[leaf].first())
        return at(index, "entries of a leaf");
    }
    for (std::uint32_t i = 0; i < inner_count(node); ++i) {
      const std::uint32_t child = node.first_child + i;
      if (i == 0 && (child % 8 != 0 || block_parent_[child / 8] != index))
        return at(index, "block of children");
      if (order_.rank(child) >= order_.rank(index)) return at(index, "refitted before its children");
      height = std::max(height, order_.height(child) + 1);
      open.push_back(child);
    }
    if (order_.height(index) != height) return at(index, "height");
    if (order_.nodes()[order_.rank(index)] != index) return at(index, "place in the order");
  }
  if (nodes != node_count())
    return std::to_string(node_count()) + " nodes in the order, not " + std::to_string(nodes);
  const auto lost = std::find(leaf_seen.begin(), leaf_seen.end(), 0);
  if (lost != leaf_seen.end()) return "leaf " + std::to_string(lost - leaf_seen.begin()) + " is lost";
  return {};
}

template <class S>
std::size_t MovingTree<S>::bytes() const {
  return this->tree_bytes() +
         (block_parent_.capacity() + free_blocks_.capacity() + leaf_at_.capacity() +
          leaf_vertices_.offsets.capacity() + leaf_vertices_.vertices.capacity()) *
             sizeof(std::uint32_t) +
         settled_.capacity() * sizeof(S) + leaves_.capacity() * sizeof(TopologyNode) +
         stack_.capacity() * sizeof(ReinsertionOpen<S>) + order_.bytes();
}

template class MovingTree<float>;
template class MovingTree<double>;

}  // namespace kbvh
