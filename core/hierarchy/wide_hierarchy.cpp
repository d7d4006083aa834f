#include "core/hierarchy/wide_hierarchy.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <type_traits>

namespace kbvh {

namespace {

/// Leaf pairs that are collected before they are turned into pairs of primitives: few enough to stay in the
/// cache.
constexpr std::size_t leaf_pair_room = 2048;
constexpr std::size_t chunk_room = 2048;

template <class S>
const WideRefitKernels<S>& refit_kernels(KernelSet set) {
  if constexpr (std::is_same_v<S, float>)
    return KBVH_SELECT_KERNELS(set, wide_refit_float);
  else
    return KBVH_SELECT_KERNELS(set, wide_refit_double);
}
template <class S>
const WideOverlapKernels<S>& overlap_kernels(KernelSet set) {
  if constexpr (std::is_same_v<S, float>)
    return KBVH_SELECT_KERNELS(set, wide_overlap_float);
  else
    return KBVH_SELECT_KERNELS(set, wide_overlap_double);
}

/// The length to which shorter lists are padded. A loop whose length changes from node to node is
/// mispredicted, which costs as much as some 8 more vertices (measured on Zen 3: 65k triangles, 4 per
/// leaf, 1.4x).
std::size_t usual_length(const std::vector<std::size_t>& lengths) {
  constexpr std::size_t misprediction = 8;
  std::vector<std::size_t> nodes_of(1, 0);
  for (const std::size_t length : lengths) {
    if (length >= nodes_of.size()) nodes_of.resize(length + 1, 0);
    if (length > 0) ++nodes_of[length];
  }
  std::size_t best = 0, best_cost = std::numeric_limits<std::size_t>::max();
  for (std::size_t usual = 0; usual < nodes_of.size() && usual < 256; ++usual) {
    std::size_t cost = 0;
    for (std::size_t length = 1; length < nodes_of.size(); ++length)
      cost += nodes_of[length] * (length <= usual ? usual : length + misprediction);
    if (cost < best_cost) best_cost = cost, best = usual;
  }
  return best;
}

}  // namespace

template <class S>
void WideHierarchy<S>::assign(Topology topology, const Primitives& primitives, KernelSet kernels) {
  topology_ = std::move(topology);
  leaf_vertices_ = unique_leaf_vertices(topology_, primitives);
  kernels_ = kernels;
  refit_ = refit_kernels<S>(kernels).of(topology_.width);
  place_nodes();
  list_vertices();
  list_leaves(primitives);
}

template <class S>
void WideHierarchy<S>::place_nodes() {
  places_.assign(topology_.size(), Place{});
  nodes_.clear();
  levels_.clear();
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
    levels_ = {0, 1};
    return;
  }
  nodes_.reserve(inner);
  bool by_depth = true;
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
    }
    nodes_.push_back(node);
    const std::uint8_t depth = topology_.depths[i];
    if (depth == levels_.size())
      levels_.push_back(wide);
    else
      by_depth = by_depth && depth + 1U == levels_.size();
  }
  levels_.push_back(std::uint32_t(nodes_.size()));
  if (!by_depth) levels_.clear();
  if (nodes_.size() > (WidePair::leaf_bit >> 3))
    throw std::length_error("a hierarchy of more than 2^28 nodes");
}

template <class S>
void WideHierarchy<S>::list_vertices() {
  const std::uint32_t width = topology_.width;
  vertices_.clear();
  lanes_.assign(nodes_.size() * lane_scalars(width), std::numeric_limits<S>::infinity());
  own_.assign(nodes_.size() * 8, S(0));
  // The leaves of each wide node, by lane.
  std::vector<std::uint32_t> leaf_of(nodes_.size() * width, none);
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (topology_.nodes[i].is_leaf()) leaf_of[std::size_t(places_[i].node) * width + places_[i].lane] = i;
  std::vector<std::size_t> lengths(nodes_.size(), 0);
  for (std::uint32_t n = 0; n < nodes_.size(); ++n)
    for (std::uint32_t lane = 0; lane < nodes_[n].leaf_count; ++lane)
      lengths[n] = std::max(lengths[n], leaf_vertices_[leaf_of[std::size_t(n) * width + lane]].size());
  const std::size_t usual = usual_length(lengths);
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) {
    WideNode& node = nodes_[n];
    if (node.leaf_count == 0) continue;
    const std::size_t length = std::max(lengths[n], usual);
    if (length > std::numeric_limits<std::uint16_t>::max() ||
        vertices_.size() + length * width > std::numeric_limits<std::uint32_t>::max())
      throw std::length_error("a leaf with " + std::to_string(length) + " vertices is too large");
    node.list = std::uint32_t(vertices_.size());
    node.length = std::uint16_t(length);
    for (std::size_t i = 0; i < length; ++i)
      for (std::uint32_t lane = 0; lane < width; ++lane) {
        const auto list =
            leaf_vertices_[leaf_of[std::size_t(n) * width + (lane < node.leaf_count ? lane : 0)]];
        vertices_.push_back(3 * list[std::min(i, list.size() - 1)]);
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
  stamp_ = 1;
  // Leaves of one primitive need no boxes besides their own.
  rows_.assign(topology_.leaf_size == 1 ? 0 : leaves * lane_scalars(padded_leaf_size()), S(0));
}

template <class S>
Box<S> WideHierarchy<S>::box(std::uint32_t node) const {
  const Place place = places_[node];
  Box<S> box;
  if (place.node == none) {
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = own_[std::size_t(axis)];
      box.upper[axis] = own_[std::size_t(axis) + 4];
    }
    return box;
  }
  const std::uint32_t width = topology_.width;
  const S* rows = lanes_.data() + place.node * lane_scalars(width) + place.lane;
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
      S* rows = lanes_.data() + place.node * lane_scalars(width) + place.lane;
      rows[axis * width] = box.lower[axis];
      rows[(axis + 3) * width] = -box.upper[axis];
    }
    // The root's own box is read even if the root is a leaf.
    const std::uint32_t own = place.wide != none ? place.wide : node == 0 ? 0 : none;
    if (own == none) continue;
    own_[std::size_t(8) * own + axis] = box.lower[axis];
    own_[std::size_t(8) * own + axis + 4] = box.upper[axis];
  }
}

template <class S>
std::size_t WideHierarchy<S>::bytes() const {
  return topology_.bytes() + nodes_.size() * sizeof(WideNode) +
         (lanes_.size() + own_.size() + rows_.size()) * sizeof(S) +
         (vertices_.size() + leaf_vertices_.offsets.size() + leaf_vertices_.vertices.size() +
          first_entry_.size() + first_corner_.size() + corners_.size() + primitives_.size() +
          stamps_.size()) *
             sizeof(std::uint32_t) +
         places_.size() * sizeof(Place);
}

template <class S>
QueryStatus WideQuery<S>::run(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b,
                              std::uint32_t body_b, const SceneView<S>& scene, const SampledMotion<S>& motion,
                              const Budget& budget, PairBuffer& out, std::uint64_t& tests) {
  if (a.empty() || b.empty()) return {};
  if (a.topology().width != b.topology().width || a.padded_leaf_size() != b.padded_leaf_size())
    throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(2 * leaf_pair_room);
  WideTraversal state{stack_.data(),  0, stack_.size(),   leaf_pairs_.data(), 0,
                      leaf_pair_room, 1, budget.box_tests};
  if (overlap(a.box(0), b.box(0))) stack_[state.depth++] = {0, 0};
  const auto traverse = overlap_kernels<S>(a.kernels()).traverse(a.topology().width);
  while (state.depth > 0 && state.tests < state.test_limit) {
    traverse(a.arrays(), b.arrays(), state);
    leaves_to_pairs(a, body_a, b, body_b, scene, motion, state.found, out, tests);
    state.found = 0;
    if (state.depth + wide_step >= state.stack_room) {
      stack_.resize(2 * stack_.size());
      state.stack = stack_.data();
      state.stack_room = stack_.size();
    }
  }
  tests += state.tests;
  return {state.depth};
}

template <class S>
void WideQuery<S>::leaves_to_pairs(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b,
                                   std::uint32_t body_b, const SceneView<S>& scene,
                                   const SampledMotion<S>& motion, std::size_t count, PairBuffer& out,
                                   std::uint64_t& tests) {
  if (a.topology().leaf_size == 1 && b.topology().leaf_size == 1) {
    for (std::size_t i = 0; i < count; ++i)
      out.push_back({body_a, a.leaf_primitives(a.leaf_number(leaf_pairs_[2 * i]))[0], body_b,
                     b.leaf_primitives(b.leaf_number(leaf_pairs_[2 * i + 1]))[0]});
    return;
  }
  const auto fetch = [&](const WideHierarchy<S>& h, std::uint32_t body, std::size_t side) {
    if (motion.all_current(body)) return;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t leaf = h.leaf_number(leaf_pairs_[2 * i + side]);
      if (h.leaf_is_current(leaf)) continue;
      for (const std::uint32_t primitive : h.leaf_primitives(leaf))
        motion.fetch(body, scene.primitives(body)[primitive]);
    }
  };
  fetch(a, body_a, 0);
  fetch(b, body_b, 1);
  chunk_.resize(chunk_room);
  WideLeafPairs<S> state{a.arrays(),
                         b.arrays(),
                         a.leaves(motion.positions(body_a)),
                         b.leaves(motion.positions(body_b)),
                         leaf_pairs_.data(),
                         0,
                         count,
                         body_a,
                         body_b,
                         &chunk_.data()->body_a,
                         0,
                         chunk_room,
                         0};
  static_assert(std::is_standard_layout_v<PrimitivePair> &&
                sizeof(PrimitivePair) == 4 * sizeof(std::uint32_t));
  const auto kernel = overlap_kernels<S>(a.kernels()).pairs(a.topology().width, a.padded_leaf_size());
  while (state.next < state.count) {
    kernel(state);
    out.insert(out.end(), chunk_.begin(), chunk_.begin() + std::ptrdiff_t(state.found));
    state.found = 0;
  }
  tests += state.tests;
}

template class WideHierarchy<float>;
template class WideHierarchy<double>;
template class WideQuery<float>;
template class WideQuery<double>;

}  // namespace kbvh
