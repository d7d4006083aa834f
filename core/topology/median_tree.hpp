#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "core/topology/builders.hpp"
#include "core/topology/collapse.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Builds the median tree directly as a wide tree: every leaf except the last holds `leaf_size` primitives,
/// every node above the leaves except the last has `width` leaves, all leaves lie at one depth if the numbers
/// allow it, and nodes are as full as possible. With width^k full leaves the tree is perfect.
///
/// `Splitter` has median_split(begin, middle, end), which permutes the primitives in [begin, end) such that
/// those before `middle` belong together. `config` needs a width and a leaf size.
template <class Splitter>
class MedianTree {
 public:
  MedianTree(Splitter& splitter, const BuilderConfig& config) : splitter_(&splitter), config_(config) {}

  /// Returns the nodes; the primitives are those that the splitter has permuted.
  Topology build(std::uint32_t primitives) {
    Topology topology = with_root(config_.width, config_.leaf_size);
    std::uint64_t reach = 1;
    std::uint32_t height = 0;
    for (; reach < units(primitives, block()); reach *= config_.width) ++height;
    make(topology, 0, 0, primitives, height);
    return topology;
  }

 private:
  /// Returns the number of primitives below a full node of leaves.
  std::uint32_t block() const { return config_.leaf_size * config_.width; }
  static std::uint32_t units(std::uint32_t count, std::uint32_t unit) { return (count + unit - 1) / unit; }

  /// The recursion is as deep as the tree: at most 32.
  void make(Topology& topology, std::uint32_t index, std::uint32_t begin, std::uint32_t end,
            std::uint32_t height) {
    const std::uint32_t count = end - begin;
    if (count <= config_.leaf_size) {
      topology.nodes[index] = TopologyNode::leaf(begin, count);
      return;
    }
    std::array<std::uint32_t, 9> bounds;
    std::uint32_t parts = units(count, config_.leaf_size), unit = config_.leaf_size;
    if (parts > config_.width) {
      unit = block();
      std::uint64_t below = 1;
      for (std::uint32_t h = 1; h < height; ++h) below *= config_.width;
      parts = std::uint32_t((units(count, unit) + below - 1) / below);
      parts = std::clamp(parts, 2U, config_.width);
    }
    bounds[0] = begin;
    bounds[parts] = end;
    divide(bounds.data(), parts, unit);
    const std::uint32_t first = add_children(topology, index, parts);
    for (std::uint32_t p = 0; p < parts; ++p)
      make(topology, first + p, bounds[p], bounds[p + 1], height > 0 ? height - 1 : 0);
  }

  /// Sets the inner ones of `parts` + 1 bounds, halving the parts each time; all parts except the last are
  /// whole units.
  void divide(std::uint32_t* bounds, std::uint32_t parts, std::uint32_t unit) {
    if (parts == 1) return;
    const std::uint32_t left = (parts + 1) / 2, all = units(bounds[parts] - bounds[0], unit);
    const auto taken = std::uint32_t((std::uint64_t(all) * left + parts - 1) / parts);
    bounds[left] = bounds[0] + std::min(taken, all - (parts - left)) * unit;
    splitter_->median_split(bounds[0], bounds[left], bounds[parts]);
    divide(bounds, left, unit);
    divide(bounds + left, parts - left, unit);
  }

  Splitter* splitter_;
  BuilderConfig config_;
};

}  // namespace kbvh
