// Top-down refit: every node's box is computed directly from the vertices below it, parents before children.
// It reads each vertex once per level, which makes it slower than `bottom_up`; it is the building block of
// refits on demand (van den Bergen 1998, Larsson & Akenine-Moeller 2001).

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class TopDown final : public EditedHierarchyStrategy<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  TopDown(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
          const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        ranges_(scene.body_count()),
        reads_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) topology_changed(body);
  }

 private:
  /// The entries below each node in the topology's list of primitives: contiguous, because leaves are laid
  /// out left to right.
  struct Range {
    std::uint32_t begin, end;
  };

  void topology_changed(std::uint32_t body) final {
    const Topology& topology = this->hierarchies_[body].topology();
    const Primitives& primitives = this->scene_.primitives(body);
    ranges_[body] = primitive_ranges(topology);
    reads_[body] = 0;
    for (const Range range : ranges_[body])
      for (std::uint32_t i = range.begin; i < range.end; ++i)
        reads_[body] += primitives[topology.primitives[i]].size();
  }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    const S* positions = this->sampled_.positions(body);
    const Primitives& primitives = this->scene_.primitives(body);
    const Topology& topology = hierarchy.topology();
    for (std::uint32_t node = 0; node < topology.size(); ++node) {
      Box<S> box;
      const Range range = ranges_[body][node];
      for (std::uint32_t i = range.begin; i < range.end; ++i) {
        for (std::uint32_t v : primitives[topology.primitives[i]]) box.extend(positions + std::size_t(3) * v);
      }
      hierarchy.set_box(node, box);
    }
    count_boxes(this->count_, topology.size(), reads_[body]);
  }

  static std::vector<Range> primitive_ranges(const Topology& topology) {
    std::vector<Range> ranges(topology.size());
    for (std::uint32_t i = topology.size(); i-- > 0;) {
      const TopologyNode node = topology.nodes[i];
      ranges[i] = node.is_leaf()
                      ? Range{node.first(), node.first() + node.count()}
                      : Range{ranges[node.first()].begin, ranges[node.first() + node.count() - 1].end};
    }
    return ranges;
  }

  std::vector<std::vector<Range>> ranges_;
  std::vector<std::uint64_t> reads_;  ///< [body] vertex reads per update
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(top_down) {
  using namespace kbvh;
  return {make_entry<TopDown>({
      .id = "top_down",
      .title = "top-down refit",
      .family = "refit",
      .citation = "van den Bergen 1998; Larsson & Akenine-Möller 2001",
      .baseline = true,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
  })};
}
