#include "core/topology/builders.hpp"

#include "core/topology/collapse.hpp"
#include "core/topology/median_order.hpp"
#include "core/topology/median_tree.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>

namespace kbvh {

const char* name(BuildMethod method) {
  switch (method) {
    case BuildMethod::median:
      return "median";
    case BuildMethod::sah:
      return "sah";
    case BuildMethod::morton:
      return "morton";
  }
  return "?";
}

BuildMethod build_method(std::string_view text) {
  for (BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
    if (text == name(method)) return method;
  throw std::invalid_argument("unknown builder '" + std::string(text) + "'; known are median, sah, morton");
}

template <class S>
std::vector<Box<S>> primitive_boxes(const Primitives& primitives, const S* positions) {
  std::vector<Box<S>> boxes(primitives.count());
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.alive(p))
      for (std::uint32_t v : primitives[p]) boxes[p].extend(positions + std::size_t(3) * v);
  return boxes;
}

namespace {

/// A binary node under construction: a range of the permuted primitives, split or not.
struct BinaryNode {
  std::uint32_t begin, end;
  std::uint32_t left = 0, right = 0;  // 0: leaf (the root is no node's child)
  double weight = 0;                  // priority for opening a child when collapsing
};

template <class S>
class BinaryBuilder {
 public:
  BinaryBuilder(std::span<const Box<S>> boxes, const BuilderConfig& config) : boxes_(boxes), config_(config) {
    items_.reserve(boxes.size());
    for (std::uint32_t p = 0; p < boxes.size(); ++p) items_.push_back(build_item(boxes[p], p));
    if (config.method == BuildMethod::morton) sort_by_morton_code();
  }

  void build() {
    nodes_.push_back({0, std::uint32_t(items_.size())});
    nodes_.reserve(2 * items_.size());
    std::vector<std::uint32_t> open{0};
    while (!open.empty()) {
      const std::uint32_t index = open.back();
      open.pop_back();
      const std::uint32_t begin = nodes_[index].begin, end = nodes_[index].end;
      nodes_[index].weight = weight(begin, end);
      const std::uint32_t middle = split(begin, end);
      if (middle == begin) continue;
      nodes_[index].left = std::uint32_t(nodes_.size());
      nodes_[index].right = nodes_[index].left + 1;
      nodes_.push_back({begin, middle});
      nodes_.push_back({middle, end});
      open.push_back(nodes_[index].left);
      open.push_back(nodes_[index].right);
    }
  }

  const std::vector<BinaryNode>& nodes() const { return nodes_; }
  const std::vector<BuildItem>& items() const { return items_; }

  /// Moves the primitives of [begin, end) with the smallest centroids along the longest axis before `middle`.
  void median_split(std::uint32_t begin, std::uint32_t middle, std::uint32_t end) {
    split_at_median(range(begin, end), middle - begin);
  }

 private:
  /// Returns the split position; `begin` for a leaf.
  std::uint32_t split(std::uint32_t begin, std::uint32_t end) {
    const std::uint32_t count = end - begin;
    if (config_.method == BuildMethod::sah) return count < 2 ? begin : sah_split(begin, end);
    return count <= config_.leaf_size ? begin : morton_split(begin, end);
  }

  std::uint32_t halve(std::uint32_t begin, std::uint32_t end) {
    const std::uint32_t middle = begin + (end - begin) / 2;
    median_split(begin, middle, end);
    return middle;
  }

  std::uint32_t sah_split(std::uint32_t begin, std::uint32_t end) {
    const std::uint32_t count = end - begin, bins = config_.sah_bins;
    const CentroidBounds bounds(range(begin, end));
    const auto &lower = bounds.lower, &upper = bounds.upper;
    double best_cost = std::numeric_limits<double>::infinity();
    std::size_t best_axis = 3;
    std::uint32_t best_bin = 0, best_larger = 0;
    const auto bin_of = [&](const BuildItem& item, std::size_t axis) {
      const double scaled = (item.centroid[axis] - lower[axis]) / (upper[axis] - lower[axis]) * bins;
      return std::min(bins - 1, std::uint32_t(std::max(0.0, scaled)));
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!(lower[axis] < upper[axis])) continue;
      bins_.assign(bins, Bin{});
      for (std::uint32_t i = begin; i < end; ++i) {
        Bin& target = bins_[bin_of(items_[i], axis)];
        target.box.extend(boxes_[items_[i].primitive]);
        ++target.count;
      }
      right_cost_.assign(bins, 0);
      Box<S> box;
      std::uint32_t n = 0;
      for (std::uint32_t b = bins - 1; b > 0; --b) {
        box.extend(bins_[b].box);
        n += bins_[b].count;
        right_cost_[b] = surface_area(box) * n;
      }
      box = {};
      n = 0;
      for (std::uint32_t b = 0; b + 1 < bins; ++b) {
        box.extend(bins_[b].box);
        n += bins_[b].count;
        if (n == 0 || n == count) continue;
        const double cost = surface_area(box) * n + right_cost_[b + 1];
        // Among equal costs, as on a line, takes the most even split.
        const std::uint32_t larger = std::max(n, count - n);
        if (cost < best_cost || (cost == best_cost && larger < best_larger))
          best_cost = cost, best_axis = axis, best_bin = b, best_larger = larger;
      }
    }
    if (best_axis == 3) return count <= config_.leaf_size ? begin : halve(begin, end);
    Box<S> whole;
    for (std::uint32_t i = begin; i < end; ++i) whole.extend(boxes_[items_[i].primitive]);
    const double area = surface_area(whole);
    // Visiting a node costs as much as one test of a primitive.
    if (count <= config_.leaf_size && area * count <= best_cost + area) return begin;
    // A stable partition keeps the result independent of the library's order of swaps.
    const auto middle =
        std::stable_partition(items_.begin() + begin, items_.begin() + end,
                              [&](const BuildItem& item) { return bin_of(item, best_axis) <= best_bin; });
    return std::uint32_t(middle - items_.begin());
  }

  std::uint32_t morton_split(std::uint32_t begin, std::uint32_t end) {
    const std::uint64_t first = codes_[begin], last = codes_[end - 1];
    if (first == last) return begin + (end - begin) / 2;
    const std::uint64_t bit = std::uint64_t(1) << (63 - std::countl_zero(first ^ last));
    return std::uint32_t(std::partition_point(codes_.begin() + begin, codes_.begin() + end,
                                              [bit](std::uint64_t code) { return (code & bit) == 0; }) -
                         codes_.begin());
  }

  void sort_by_morton_code() {
    const CentroidBounds bounds(items_);
    const auto &lower = bounds.lower, &upper = bounds.upper;
    std::vector<std::uint64_t> code(items_.size(), 0);
    for (const BuildItem& item : items_)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!(lower[axis] < upper[axis])) continue;
        const double scaled = (item.centroid[axis] - lower[axis]) / (upper[axis] - lower[axis]) * 2097152.0;
        const auto cell = std::min<std::uint64_t>(2097151, std::uint64_t(std::max(0.0, scaled)));
        for (int b = 0; b < 21; ++b) code[item.primitive] |= ((cell >> b) & 1) << (3 * b + int(axis));
      }
    std::sort(items_.begin(), items_.end(), [&](const BuildItem& a, const BuildItem& b) {
      return code[a.primitive] != code[b.primitive] ? code[a.primitive] < code[b.primitive]
                                                    : a.primitive < b.primitive;
    });
    for (const BuildItem& item : items_) codes_.push_back(code[item.primitive]);
  }

  std::span<BuildItem> range(std::uint32_t begin, std::uint32_t end) {
    return {items_.data() + begin, end - begin};
  }

  double weight(std::uint32_t begin, std::uint32_t end) const {
    if (config_.width == 2 || config_.method != BuildMethod::sah) return end - begin;
    Box<S> box;
    for (std::uint32_t i = begin; i < end; ++i) box.extend(boxes_[items_[i].primitive]);
    return surface_area(box);
  }

  std::span<const Box<S>> boxes_;
  BuilderConfig config_;
  std::vector<BuildItem> items_;
  std::vector<std::uint64_t> codes_;
  std::vector<BinaryNode> nodes_;
  struct Bin {
    Box<S> box;
    std::uint32_t count = 0;
  };
  std::vector<Bin> bins_;
  std::vector<double> right_cost_;
};

/// The binary tree of a builder, in the form that `collapse_into` reads.
struct BuiltTree {
  const std::vector<BinaryNode>* nodes;
  std::pair<std::uint32_t, std::uint32_t> children(std::uint32_t node) const {
    return {(*nodes)[node].left, (*nodes)[node].right};
  }
  double weight(std::uint32_t node) const { return (*nodes)[node].weight; }
  TopologyNode leaf(std::uint32_t node) const {
    return TopologyNode::leaf((*nodes)[node].begin, (*nodes)[node].end - (*nodes)[node].begin);
  }
};

}  // namespace

void check_builder(const BuilderConfig& config) {
  if (config.width != 2 && config.width != 4 && config.width != 8)
    throw std::invalid_argument("tree width must be 2, 4 or 8, got " + std::to_string(config.width));
  if (config.leaf_size < 1 || config.leaf_size > 16)
    throw std::invalid_argument("leaf size must be 1 to 16, got " + std::to_string(config.leaf_size));
  if (config.sah_bins < 2)
    throw std::invalid_argument("SAH needs at least 2 bins, got " + std::to_string(config.sah_bins));
}

void sort_leaves(Topology& topology) {
  for (const TopologyNode node : topology.nodes)
    if (node.is_leaf())
      std::sort(topology.primitives.begin() + node.first(),
                topology.primitives.begin() + node.first() + node.count());
}

template <class S>
Topology build_topology(std::span<const Box<S>> boxes, const BuilderConfig& config) {
  check_builder(config);
  if (boxes.empty()) {
    Topology topology;
    topology.width = config.width;
    topology.leaf_size = config.leaf_size;
    return topology;
  }
  BinaryBuilder<S> builder(boxes, config);
  Topology topology;
  if (config.method == BuildMethod::median) {
    topology = MedianTree(builder, config).build(std::uint32_t(boxes.size()));
  } else {
    builder.build();
    topology = with_root(config.width, config.leaf_size);
    collapse_into(topology, BuiltTree{&builder.nodes()});
  }
  topology.primitives.reserve(boxes.size());
  for (const BuildItem& item : builder.items()) topology.primitives.push_back(item.primitive);
  sort_leaves(topology);
  topology.perfect = is_perfect(topology);
  return topology;
}

template <class S>
Topology build_topology(const Primitives& primitives, const S* positions, const BuilderConfig& config) {
  auto boxes = primitive_boxes(primitives, positions);
  if (primitives.removed_count == 0) return build_topology<S>(boxes, config);
  std::vector<std::uint32_t> living;
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.alive(p)) {
      boxes[living.size()] = boxes[p];
      living.push_back(p);
    }
  boxes.resize(living.size());
  Topology topology = build_topology<S>(boxes, config);
  for (std::uint32_t& p : topology.primitives) p = living[p];
  return topology;
}

#define KBVH_INSTANTIATE(S)                                                        \
  template std::vector<Box<S>> primitive_boxes(const Primitives&, const S*);       \
  template Topology build_topology(std::span<const Box<S>>, const BuilderConfig&); \
  template Topology build_topology(const Primitives&, const S*, const BuilderConfig&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
