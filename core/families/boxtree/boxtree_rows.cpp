#include "core/families/boxtree/boxtree_rows.hpp"

#include <algorithm>
#include <cmath>

#include "core/motion/round_positions.hpp"
#include "core/topology/collapse.hpp"

namespace kbvh {
namespace {

constexpr std::uint32_t none = ~std::uint32_t(0);
/// Entries of the table that fills a wide node's rows: its own sides, in the order of rows, the value of an
/// empty lane, and then its planes.
constexpr std::uint8_t empty_entry = 6, first_plane_entry = 7;

/// The row that contains a side: lower x, y, z, upper x, y, z.
std::uint32_t row_of(std::uint32_t side) {
  return (side >> 1) + 3 * (side & 1);
}

}  // namespace

template <class S>
void BoxTreeRows<S>::follow(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes) {
  if (!wide_of_.empty() && version_ == tree.version()) return;
  version_ = tree.version();
  lay_out(tree, primitives, leaf_boxes);
}

template <class S>
void BoxTreeRows<S>::lay_out(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes) {
  leaf_boxes_ = leaf_boxes;
  std::vector<std::uint32_t> order, node_of;
  const Topology binary = tree.compacted_topology(order);
  Topology wide = collapsed(binary, width, leaves_below(binary), node_of);
  // The inherited box of a leaf is larger than that of its primitive. The query tests the boxes of primitives
  // only where leaves may hold several.
  if (leaf_boxes != LeafBoxes::tight) wide.leaf_size = std::max(2U, wide.leaf_size);
  for (std::uint32_t& node : node_of) node = order[node];
  wide_of_.assign(std::max(1U, tree.topology().size()), none);
  for (std::uint32_t i = 0; i < node_of.size(); ++i) wide_of_[node_of[i]] = i;
  this->assign(std::move(wide), primitives, active_kernel_set());
  list_planes(tree, node_of);
}

template <class S>
void BoxTreeRows<S>::list_planes(const BoxTreeBounds& tree, std::span<const std::uint32_t> node_of) {
  const Topology& wide = this->hierarchy().topology();
  const std::uint32_t count = this->hierarchy().node_count();
  const std::size_t scalars = lane_scalars(width);
  first_plane_.assign(1, 0);
  planes_.clear();
  first_vertex_.assign(1, 0);
  vertices_.clear();
  sources_.assign(count * scalars, empty_entry);
  parent_row_.assign(count, 0);
  std::vector<std::uint32_t> list;
  const auto plane_entry = [&](std::uint32_t place, std::uint32_t side) {
    const std::uint32_t first = first_plane_.back();
    std::uint32_t i = first;
    while (i < planes_.size() && planes_[i].place != place) ++i;
    if (i == planes_.size()) planes_.push_back({place, side});
    return std::uint8_t(first_plane_entry + (i - first));
  };
  // The sides of a child of a wide node: those that binary nodes from it up to the wide node own, the
  // nearest first, and the wide node's.
  const auto list_child = [&](std::uint32_t child, std::uint32_t top, std::size_t place) {
    const bool tight = leaf_boxes_ == LeafBoxes::tight && wide.nodes[child].is_leaf();
    for (std::uint32_t row = 0; row < rows; ++row) sources_[place + row * width] = std::uint8_t(row);
    if (tight) return;
    std::uint32_t found = 0;
    for (std::uint32_t node = node_of[child]; node != top; node = tree.topology().parents[node]) {
      const std::uint32_t side = tree.own_side(node);
      if (side == no_side || (found >> side & 1) != 0) continue;
      found |= 1U << side;
      sources_[place + row_of(side) * width] = plane_entry(node + 5, side);
    }
  };
  for (std::uint32_t i = 0; i < wide.size(); ++i) {
    const TopologyNode n = wide.nodes[i];
    const bool only_leaf = i == 0 && n.is_leaf();
    if (n.is_leaf() && !only_leaf) continue;
    if (i == 0)
      for (std::uint32_t side = 0; side < 6; ++side) planes_.push_back({side, side});
    list.clear();
    const std::uint32_t first = only_leaf ? 0 : n.first(), last = only_leaf ? 1 : first + n.count();
    for (std::uint32_t child = first; child < last; ++child) {
      list_child(child, node_of[i], this->hierarchy().row_place(child, 0));
      if (!wide.nodes[child].is_leaf())
        parent_row_[this->hierarchy().wide_node(child)] =
            std::uint32_t(this->hierarchy().row_place(child, 0));
      const auto own = this->hierarchy().leaf_vertices(child);
      if (leaf_boxes_ == LeafBoxes::tight) list.insert(list.end(), own.begin(), own.end());
    }
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    vertices_.insert(vertices_.end(), list.begin(), list.end());
    first_vertex_.push_back(std::uint32_t(vertices_.size()));
    first_plane_.push_back(std::uint32_t(planes_.size()));
  }
}

template <class S>
std::uint64_t BoxTreeRows<S>::make_visited(const BoxTreeBounds& tree, const SegmentMotion<S>& motion,
                                           std::uint32_t body) {
  return make(this->due(), tree, motion, body);
}

template <class S>
std::uint64_t BoxTreeRows<S>::make(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                                   const SegmentMotion<S>& motion, std::uint32_t body) {
  std::uint64_t reads = 0;
  alignas(64) S values[made_together * most_planes];
  while (!nodes.empty()) {
    const auto some = nodes.first(std::min(nodes.size(), made_together));
    reads += read_planes(some, tree, motion, body, values);
    fetched_.clear();
    for (const std::uint32_t node : some)
      fetched_.insert(fetched_.end(), vertices_.begin() + first_vertex_[node],
                      vertices_.begin() + first_vertex_[node + 1]);
    if (!fetched_.empty()) motion.fetch(body, fetched_);
    reads += fetched_.size();
    const S* own = values;
    for (const std::uint32_t node : some) {
      if (first_vertex_[node] != first_vertex_[node + 1])
        this->hierarchy().refit_nodes(motion.positions(body), node, node + 1);
      write_rows(node, own);
      own += first_plane_[node + 1] - first_plane_[node];
      this->computed(node);
    }
    nodes = nodes.subspan(some.size());
  }
  return reads;
}

template <class S>
std::uint64_t BoxTreeRows<S>::read_planes(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                                          const SegmentMotion<S>& motion, std::uint32_t body, S* values) {
  const bool all_current = motion.all_current(body);
  const bool on_lines = this->on_lines() && !all_current;
  alignas(64) S ends[made_together * most_planes];
  std::uint32_t vertices[made_together * most_planes];
  std::size_t count = 0;
  for (const std::uint32_t node : nodes)
    for (std::uint32_t i = first_plane_[node]; i < first_plane_[node + 1]; ++i, ++count) {
      vertices[count] = tree.realiser_at(planes_[i].place);
      const std::size_t place = std::size_t(3) * vertices[count] + (planes_[i].side >> 1);
      if (!on_lines) continue;
      values[count] = this->line_end(0)[place];
      ends[count] = this->line_end(1)[place];
    }
  if (on_lines) {
    round_chord(values, ends, count, this->line_time(0), this->line_time(1), motion.time(), values);
    return count;
  }
  if (!all_current) motion.fetch(body, {vertices, count});
  const S* const positions = motion.positions(body);
  count = 0;
  for (const std::uint32_t node : nodes)
    for (std::uint32_t i = first_plane_[node]; i < first_plane_[node + 1]; ++i, ++count)
      values[count] = positions[std::size_t(3) * vertices[count] + (planes_[i].side >> 1)];
  return count;
}

template <class S>
void BoxTreeRows<S>::write_rows(std::uint32_t node, const S* values) {
  const WideArrays<S> arrays = this->hierarchy().arrays();
  const WideNode& wide = arrays.nodes[node];
  S table[first_plane_entry + most_planes];
  const std::uint32_t planes = first_plane_[node + 1] - first_plane_[node];
  for (std::uint32_t i = 0; i < planes; ++i) {
    const std::uint32_t side = planes_[first_plane_[node] + i].side;
    table[first_plane_entry + i] = (side & 1) != 0 ? -values[i] : values[i];
  }
  if (node == 0)
    for (std::uint32_t side = 0; side < 6; ++side) table[row_of(side)] = table[first_plane_entry + side];
  else
    for (std::uint32_t row = 0; row < rows; ++row)
      table[row] = arrays.child_bounds[parent_row_[node] + row * width];
  table[empty_entry] = std::numeric_limits<S>::infinity();

  const std::size_t scalars = lane_scalars(width);
  S* const to = arrays.child_bounds + node * scalars;
  const std::uint8_t* const from = sources_.data() + node * scalars;
  const std::uint32_t first = leaf_boxes_ == LeafBoxes::tight ? wide.leaf_count : 0;
  for (std::uint32_t row = 0; row < rows; ++row)
    for (std::uint32_t lane = first; lane < width; ++lane)
      to[row * width + lane] = table[from[row * width + lane]];
  S* const own = arrays.node_bounds + std::size_t(8) * node;
  for (std::uint32_t row = 0; row < rows; ++row) {
    S least = to[row * width];
    for (std::uint32_t lane = 1; lane < width; ++lane) least = std::min(least, to[row * width + lane]);
    own[row < 3 ? row : row + 1] = row < 3 ? least : -least;
  }
}

template <class S>
const Box<S>* BoxTreeRows<S>::read_box(std::uint32_t node, Box<S>& room) const {
  if (wide_of_.empty() || node >= wide_of_.size() || wide_of_[node] == none) return nullptr;
  if (this->hierarchy().wide_parent(wide_of_[node]) == WideHierarchy<S>::no_node) return nullptr;
  if (!this->current(wide_of_[node])) return nullptr;
  room = this->hierarchy().box(wide_of_[node]);
  return &room;
}

template <class S>
std::size_t BoxTreeRows<S>::bytes() const {
  return this->bytes_on_demand() + planes_.size() * sizeof(Plane) + sources_.size() +
         (wide_of_.size() + first_plane_.size() + first_vertex_.size() + vertices_.size() +
          parent_row_.size() + fetched_.capacity()) *
             sizeof(std::uint32_t);
}

template class BoxTreeRows<float>;
template class BoxTreeRows<double>;

}  // namespace kbvh
