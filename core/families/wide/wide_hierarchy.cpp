#include "core/families/wide/wide_hierarchy.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "core/families/wide/leaf_slots.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

namespace {

/// The number of leaf pairs that are collected before they are turned into pairs of primitives: few enough to
/// stay in the cache.
constexpr std::size_t leaf_pair_room = 2048;
constexpr std::size_t chunk_room = 2048;

}  // namespace

template <class S>
void WideHierarchy<S>::assign(Topology topology, const Primitives& primitives, KernelSet kernels) {
  topology_ = std::move(topology);
  leaf_vertices_ = unique_leaf_vertices(topology_, primitives);
  kernels_ = kernels;
  refit_ = wide_refit_kernels<S>(kernels).of(topology_.width);
  place_nodes();
  find_subtrees();
  list_vertices();
  list_leaves(primitives);
}

template <class S>
void WideHierarchy<S>::place_nodes() {
  places_.assign(topology_.size(), Place{});
  parent_.assign(1, 0);
  nodes_.clear();
  if (topology_.empty()) return;
  // A root that is a leaf still needs a wide node to lie in.
  std::uint32_t inner = 0, leaves = 0;
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (!topology_.nodes[i].is_leaf()) places_[i].wide = inner++;
  if (inner == 0) {
    places_[0].node = 0;
    WideNode node;
    node.leaf_count = node.count = 1;
    nodes_.push_back(node);
    return;
  }
  nodes_.reserve(inner);
  parent_.assign(inner, 0);
  for (std::uint32_t i = 0; i < topology_.size(); ++i) {
    const TopologyNode source = topology_.nodes[i];
    if (source.is_leaf()) continue;
    WideNode node;
    const auto wide = std::uint32_t(nodes_.size());
    node.first_leaf = leaves;
    node.count = std::uint8_t(source.count());
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (!topology_.nodes[c].is_leaf()) continue;
      places_[c].node = wide;
      places_[c].lane = node.leaf_count++;
      ++leaves;
    }
    std::uint32_t lane = node.leaf_count;
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (topology_.nodes[c].is_leaf()) continue;
      if (lane == node.leaf_count) node.first_child = places_[c].wide;
      places_[c].node = wide;
      places_[c].lane = lane++;
      parent_[places_[c].wide] = wide;
    }
    nodes_.push_back(node);
  }
  if (nodes_.size() > (WidePair::leaf_bit >> 3))
    throw std::length_error("a hierarchy of more than 2^28 nodes");
}

template <class S>
void WideHierarchy<S>::find_subtrees() {
  subtrees_.clear();
  above_subtrees_.clear();
  // Descendants are contiguous if nodes are numbered depth first with siblings in one row; other topologies
  // are not divided.
  std::vector<std::uint32_t> size(nodes_.size(), 1);
  for (std::uint32_t n = node_count(); n-- > 0;) {
    const WideNode& node = nodes_[n];
    const std::uint32_t inner = node.count - node.leaf_count;
    std::uint32_t next = node.first_child + inner;
    for (std::uint32_t c = node.first_child; c < node.first_child + inner; ++c) {
      if (nodes_[c].count != nodes_[c].leaf_count && nodes_[c].first_child != next) return;
      next += size[c] - 1;
      size[n] += size[c];
    }
  }
  const std::uint32_t largest = std::max<std::uint32_t>(256, node_count() / 64);
  for (std::uint32_t n = node_count(); n-- > 0;) {
    const bool below_largest = size[n] <= largest;
    if (below_largest && n != 0 && size[parent_[n]] <= largest) continue;
    above_subtrees_.push_back(n);
    if (below_largest && size[n] > 1)
      subtrees_.push_back({nodes_[n].first_child, nodes_[n].first_child + size[n] - 1});
  }
  if (subtrees_.size() < 2) subtrees_.clear();
}

template <class S>
void WideHierarchy<S>::list_vertices() {
  const std::uint32_t width = topology_.width;
  vertices_.clear();
  child_bounds_.assign(nodes_.size() * lane_scalars(width), std::numeric_limits<S>::infinity());
  node_bounds_.assign(nodes_.size() * 8, S(0));
  // The leaves of each wide node, by lane.
  std::vector<std::uint32_t> leaf_of(nodes_.size() * width, none);
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (topology_.nodes[i].is_leaf()) leaf_of[std::size_t(places_[i].node) * width + places_[i].lane] = i;
  std::vector<std::size_t> lengths(nodes_.size(), 0);
  listed_.assign(nodes_.size(), 0);
  for (std::uint32_t n = 0; n < nodes_.size(); ++n)
    for (std::uint32_t lane = 0; lane < nodes_[n].leaf_count; ++lane) {
      const std::size_t size = leaf_vertices_[leaf_of[std::size_t(n) * width + lane]].size();
      lengths[n] = std::max(lengths[n], size);
      listed_[n] += std::uint32_t(size);
    }
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) {
    WideNode& node = nodes_[n];
    if (node.leaf_count == 0) continue;
    const std::size_t length = lengths[n];
    if (length > std::numeric_limits<std::uint16_t>::max())
      throw std::length_error("a leaf has " + std::to_string(length) + " vertices; 65535 are possible");
    if (vertices_.size() + length * width > std::numeric_limits<std::uint32_t>::max())
      throw std::length_error("the vertex lists of a hierarchy exceed 2^32 entries");
    node.list = std::uint32_t(vertices_.size());
    node.length = std::uint16_t(length);
    vertices_.resize(vertices_.size() + length * width);
    for (std::uint32_t lane = 0; lane < width; ++lane) {
      const auto list = leaf_vertices_[leaf_of[std::size_t(n) * width + (lane < node.leaf_count ? lane : 0)]];
      for (std::size_t i = 0; i < length; ++i)
        vertices_[node.list + i * width + list_place(lane, width)] = 3 * list[std::min(i, list.size() - 1)];
    }
  }
}

template <class S>
void WideHierarchy<S>::list_leaves(const Primitives& primitives) {
  std::uint32_t leaves = 0;
  for (const TopologyNode& node : topology_.nodes) leaves += node.is_leaf() ? 1 : 0;
  std::vector<std::uint32_t> source(leaves);  // topology node of each numbered leaf
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (topology_.nodes[i].is_leaf()) source[nodes_[places_[i].node].first_leaf + places_[i].lane] = i;
  first_entry_.assign(1, 0);
  first_corner_.assign(1, 0);
  corners_.clear();
  primitives_.clear();
  for (const std::uint32_t i : source) {
    const TopologyNode node = topology_.nodes[i];
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k) {
      const std::uint32_t primitive = topology_.primitives[k];
      primitives_.push_back(primitive);
      for (const std::uint32_t v : primitives[primitive]) corners_.push_back(3 * v);
      first_corner_.push_back(std::uint32_t(corners_.size()));
    }
    first_entry_.push_back(std::uint32_t(primitives_.size()));
  }
  stamps_.assign(leaves, 0);
  fetched_.assign(leaves, 0);
  stamp_ = 1;
  // Leaves of one primitive need no boxes besides their own.
  rows_.assign(padded_leaf_size() == 1 ? 0 : leaves * lane_scalars(padded_leaf_size()), S(0));
}

template <class S>
Box<S> WideHierarchy<S>::box_in(const S* child_bounds, const S* node_bounds, std::uint32_t node) const {
  const Place place = places_[node];
  Box<S> box;
  if (place.node == none) {
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = node_bounds[axis];
      box.upper[axis] = node_bounds[axis + 4];
    }
    return box;
  }
  const std::uint32_t width = topology_.width;
  const S* rows = child_bounds + place.node * lane_scalars(width) + place.lane;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = rows[axis * width];
    box.upper[axis] = -rows[(axis + 3) * width];
  }
  return box;
}

template <class S>
void WideHierarchy<S>::set_box(std::uint32_t node, const Box<S>& box) {
  const Place place = places_[node];
  const std::uint32_t width = topology_.width;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    if (place.node != none) {
      S* rows = child_bounds_.data() + place.node * lane_scalars(width) + place.lane;
      rows[axis * width] = box.lower[axis];
      rows[(axis + 3) * width] = -box.upper[axis];
    }
    // The root's own box is read even if the root is a leaf.
    const std::uint32_t wide = place.wide != none ? place.wide : node == 0 ? 0 : none;
    if (wide == none) continue;
    node_bounds_[std::size_t(8) * wide + axis] = box.lower[axis];
    node_bounds_[std::size_t(8) * wide + axis + 4] = box.upper[axis];
  }
}

template <class S>
std::size_t WideHierarchy<S>::bytes() const {
  return topology_.bytes() + nodes_.capacity() * sizeof(WideNode) +
         (child_bounds_.capacity() + node_bounds_.capacity() + rows_.capacity()) * sizeof(S) +
         (vertices_.capacity() + leaf_vertices_.offsets.capacity() + leaf_vertices_.vertices.capacity() +
          first_entry_.capacity() + first_corner_.capacity() + corners_.capacity() + primitives_.capacity() +
          stamps_.capacity() + fetched_.capacity() + parent_.capacity() + listed_.capacity()) *
             sizeof(std::uint32_t) +
         places_.capacity() * sizeof(Place) + subtrees_.capacity() * sizeof(Subtree) +
         above_subtrees_.capacity() * sizeof(std::uint32_t);
}

template <class S>
QueryStatus WideQuery<S>::run(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b,
                              std::uint32_t body_b, const SceneView<S>& scene, const SampledMotion<S>& motion,
                              const Budget& budget, PairBuffer& out, std::uint64_t& tests) {
  if (a.empty() || b.empty()) return {};
  if (!a.suits(b)) throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  WideTraversal state = fresh_traversal(budget);
  if (overlap(a.box(0), b.box(0))) stack_[state.depth++] = {0, 0};
  const auto& kernels = wide_overlap_kernels<S>(a.kernels());
  const std::uint32_t width = a.topology().width;
  const auto traverse = body_a == body_b ? kernels.self(width) : kernels.traverse(width);
  return complete(
      state, [&] { traverse(a.arrays(), b.arrays(), state); },
      [&] { leaves_to_pairs(a, body_a, b, body_b, scene, motion, state.found, out, tests); }, tests);
}

template <class S>
void WideQuery<S>::run_over(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a,
                            WideHierarchy<S>& b, std::uint32_t body_b, const S* positions_b, PairBuffer& out,
                            std::uint64_t& tests) {
  if (a.empty() || b.empty()) return;
  if (!a.suits(b)) throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  WideTraversal state = fresh_traversal(Budget{});
  if (overlap(a.box(0), b.box(0))) stack_[state.depth++] = {0, 0};
  const auto& kernels = wide_overlap_kernels<S>(a.kernels());
  const std::uint32_t width = a.topology().width;
  const auto traverse = body_a == body_b ? kernels.self(width) : kernels.traverse(width);
  complete(
      state, [&] { traverse(a.arrays(), b.arrays(), state); },
      [&] {
        leaves_to_pairs(a, body_a, positions_a, b, body_b, positions_b, nullptr, state.found, out, tests);
      },
      tests);
}

template <class S>
template <class Traverse, class Take>
QueryStatus WideQuery<S>::complete(WideTraversal& state, const Traverse& traverse, const Take& take,
                                   std::uint64_t& tests) {
  while (state.depth > 0 && state.tests < state.test_limit) {
    traverse();
    take();
    state.found = 0;
    grow(state);
  }
  tests += state.tests;
  return {state.depth};
}

template <class S>
QueryStatus WideQuery<S>::run_at(WideHierarchy<S>& a, const WideMoment<S>& moment_a, std::uint32_t body_a,
                                 WideHierarchy<S>& b, const WideMoment<S>& moment_b, std::uint32_t body_b,
                                 const SceneView<S>& scene, const SampledMotion<S>& motion,
                                 const Budget& budget, PairBuffer& out, std::uint64_t& tests) {
  if (a.empty() || b.empty()) return {};
  const std::uint32_t width = a.topology().width;
  const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(a.kernels());
  WideTraversal state = fresh_traversal(budget);
  for (const WideMoment<S>* moment : {&moment_a, &moment_b})
    if (moment->stale[0] != 0) {
      kernels.make(width)(*moment, 0);
      moment->stale[0] = 0;
    }
  if (overlap(a.box(0), b.box(0))) stack_[state.depth++] = {0, 0};
  return complete(
      state, [&] { kernels.at(width)(moment_a, moment_b, state); },
      [&] { leaves_to_pairs(a, body_a, b, body_b, scene, motion, state.found, out, tests); }, tests);
}

template <class S>
WideTraversal WideQuery<S>::fresh_traversal(const Budget& budget) {
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(2 * leaf_pair_room);
  return {stack_.data(), 0, stack_.size(), leaf_pairs_.data(), 0, leaf_pair_room, 1, budget.box_tests};
}

template <class S>
void WideQuery<S>::grow(WideTraversal& state) {
  if (state.depth + max_pairs_per_step < state.stack_room) return;
  stack_.resize(2 * stack_.size());
  state.stack = stack_.data();
  state.stack_room = stack_.size();
}

template <class S>
void WideQuery<S>::start_lazy(const LazySide& a, const LazySide& b, const Budget& budget) {
  lazy_ = fresh_traversal(budget);
  lazy_.stale_a = a.stale;
  lazy_.stale_b = b.stale;
  if (a.hierarchy->empty() || b.hierarchy->empty()) {
    lazy_.tests = 0;
    return;
  }
  if (!a.hierarchy->suits(*b.hierarchy))
    throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  if (overlap(a.hierarchy->box(0), b.hierarchy->box(0))) lazy_.stack[lazy_.depth++] = {0, 0};
}

template <class S>
typename WideQuery<S>::Wanted WideQuery<S>::step(const LazySide& a, const LazySide& b,
                                                 const SceneView<S>& scene, const SampledMotion<S>& motion,
                                                 PairBuffer& out, std::uint64_t& tests) {
  const auto traverse = wide_overlap_kernels<S>(a.hierarchy->kernels()).lazy(a.hierarchy->topology().width);
  while (lazy_.depth > 0 && lazy_.tests < lazy_.test_limit) {
    traverse(a.hierarchy->arrays(), b.hierarchy->arrays(), lazy_);
    if (lazy_.depth > 0 && lazy_.tests < lazy_.test_limit) {
      Wanted wanted;
      if (lazy_.first_is_stale()) wanted.first = lazy_.stack[lazy_.depth - 1].first;
      if (lazy_.second_is_stale()) wanted.second = lazy_.stack[lazy_.depth - 1].second;
      if (wanted) return wanted;
    }
    leaves_to_pairs(*a.hierarchy, a.body, *b.hierarchy, b.body, scene, motion, lazy_.found, out, tests);
    lazy_.found = 0;
    grow(lazy_);
  }
  // Processes the pairs found just before a pause, if no other work followed.
  if (lazy_.found != 0)
    leaves_to_pairs(*a.hierarchy, a.body, *b.hierarchy, b.body, scene, motion, lazy_.found, out, tests);
  lazy_.found = 0;
  tests += lazy_.tests;
  return {};
}

template <class S>
void WideQuery<S>::fetch_leaves(WideHierarchy<S>& h, std::uint32_t body, std::size_t side, std::size_t count,
                                const SceneView<S>& scene, const SampledMotion<S>& motion) {
  // Fetches missing positions all at once: calls with a few vertices each cost more than the vertices.
  if (h.padded_leaf_size() == 1 || motion.all_current(body)) return;
  to_fetch_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t leaf = h.leaf_number(leaf_pairs_[2 * i + side]);
    if (!h.to_be_fetched(leaf)) continue;
    for (const std::uint32_t primitive : h.leaf_primitives(leaf)) {
      const auto vertices = scene.primitives(body)[primitive];
      to_fetch_.insert(to_fetch_.end(), vertices.begin(), vertices.end());
    }
  }
  motion.fetch(body, to_fetch_);
}

template <class S>
void WideQuery<S>::leaves_to_pairs(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b,
                                   std::uint32_t body_b, const SceneView<S>& scene,
                                   const SampledMotion<S>& motion, std::size_t count, PairBuffer& out,
                                   std::uint64_t& tests) {
  fetch_leaves(a, body_a, 0, count, scene, motion);
  fetch_leaves(b, body_b, 1, count, scene, motion);
  const Primitives* neighbours = body_a == body_b ? &scene.primitives(body_a) : nullptr;
  leaves_to_pairs(a, body_a, motion.positions(body_a), b, body_b, motion.positions(body_b), neighbours, count,
                  out, tests);
}

template <class S>
void WideQuery<S>::leaves_to_pairs(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a,
                                   WideHierarchy<S>& b, std::uint32_t body_b, const S* positions_b,
                                   const Primitives* neighbours, std::size_t count, PairBuffer& out,
                                   std::uint64_t& tests) {
  if (body_a != body_b) {
    append_pairs(a, body_a, positions_a, b, body_b, positions_b, 0, count, out, tests);
    return;
  }
  const std::size_t different = different_leaves_first(leaf_pairs_.data(), count);
  const auto append = [&](LeavesOf leaves, std::size_t begin, std::size_t end) {
    const std::size_t before = out.size();
    append_pairs(a, body_a, positions_a, b, body_b, positions_b, begin, end, out, tests);
    out.resize(before + keep_self_pairs(neighbours, leaves, out.data() + before, out.size() - before));
  };
  append(LeavesOf::two, 0, different);
  append(LeavesOf::one, different, count);
}

template <class S>
void WideQuery<S>::append_pairs(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a,
                                WideHierarchy<S>& b, std::uint32_t body_b, const S* positions_b,
                                std::size_t begin, std::size_t end, PairBuffer& out, std::uint64_t& tests) {
  if (a.padded_leaf_size() == 1) {
    for (std::size_t i = begin; i < end; ++i)
      out.push_back({body_a, a.leaf_primitives(a.leaf_number(leaf_pairs_[2 * i]))[0], body_b,
                     b.leaf_primitives(b.leaf_number(leaf_pairs_[2 * i + 1]))[0]});
    return;
  }
  chunk_.resize(chunk_room);
  WideLeafPairs<S> state{a.arrays(),
                         b.arrays(),
                         a.leaves(positions_a),
                         b.leaves(positions_b),
                         leaf_pairs_.data(),
                         begin,
                         end,
                         body_a,
                         body_b,
                         chunk_.data(),
                         0,
                         chunk_room,
                         0};
  const auto kernel = wide_overlap_kernels<S>(a.kernels()).pairs(a.topology().width, a.padded_leaf_size());
  while (state.next < state.count) {
    kernel(state);
    const std::size_t before = out.size();
    out.resize(before + state.found);
    for (std::size_t i = 0; i < state.found; ++i)
      out[before + i] = {chunk_[i].body_a, chunk_[i].primitive_a, chunk_[i].body_b, chunk_[i].primitive_b};
    state.found = 0;
  }
  tests += state.tests;
}

template class WideHierarchy<float>;
template class WideHierarchy<double>;
template class WideQuery<float>;
template class WideQuery<double>;

}  // namespace kbvh
