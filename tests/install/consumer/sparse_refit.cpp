// A refit that detects motion: it skips leaves whose vertices did not move, and all nodes above them whose
// children's boxes did not change. The comparisons pay where large parts of a body rest.

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace {

template <class S>
class SparseRefit final : public kbvh::StoredHierarchyStrategy<S> {
  using Base = kbvh::StoredHierarchyStrategy<S>;
  using Counter = kbvh::Counter;

 public:
  static constexpr kbvh::Foresight foresight = kbvh::Foresight::none;

  SparseRefit(const kbvh::SceneView<S>& scene, const kbvh::SampledMotion<S>& motion,
              kbvh::Topologies topologies, const kbvh::Params& params)
      : Base(scene, motion, std::move(topologies), params), seen_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      seen_[body].positions.resize(std::size_t(3) * scene.vertex_count(body));
      seen_[body].moved.resize(scene.vertex_count(body));
      seen_[body].changed.resize(this->hierarchies_[body].topology().size());
    }
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (std::uint32_t body = 0; body < seen_.size(); ++body)
      std::copy_n(this->sampled_.positions(body), seen_[body].positions.size(),
                  seen_[body].positions.begin());
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const Seen& seen : seen_)
      total += seen.positions.size() * sizeof(S) + seen.moved.size() + seen.changed.size();
    return total;
  }

 private:
  /// The inputs of one body's boxes.
  struct Seen {
    std::vector<S> positions;           ///< [vertex][3]
    std::vector<std::uint8_t> moved;    ///< per vertex: whether it moved since the last update
    std::vector<std::uint8_t> changed;  ///< per node: whether this update changed its box
  };

  void update(std::uint32_t body) override {
    const S* positions = this->sampled_.positions(body);
    this->count_.add(Counter::vertex_reads, seen_[body].moved.size());
    if (!note_moves(seen_[body], positions)) return;

    auto& hierarchy = this->hierarchies_[body];
    std::vector<std::uint8_t>& changed = seen_[body].changed;
    std::uint64_t recomputed = 0;
    for (std::uint32_t i = hierarchy.topology().size(); i-- > 0;) {
      const kbvh::TopologyNode node = hierarchy.topology().nodes[i];
      changed[i] = concerned(node, hierarchy.leaf_vertices(i), seen_[body]);
      if (changed[i] == 0) continue;
      ++recomputed;
      const kbvh::Box<S> box = node.is_leaf() ? kbvh::leaf_box(hierarchy.leaf_vertices(i), positions)
                                              : union_of_children(node, hierarchy);
      changed[i] = !(box == hierarchy.box(i));
      hierarchy.set_box(i, box);
    }
    this->count_.add(Counter::nodes_visited, hierarchy.topology().size());
    this->count_.add(Counter::values_written, 6 * recomputed);
  }

  static bool note_moves(Seen& seen, const S* positions) {
    std::uint8_t any = 0;
    for (std::size_t vertex = 0; vertex < seen.moved.size(); ++vertex) {
      const S* now = positions + 3 * vertex;
      S* before = seen.positions.data() + 3 * vertex;
      seen.moved[vertex] = (now[0] != before[0]) | (now[1] != before[1]) | (now[2] != before[2]);
      any |= seen.moved[vertex];
      std::copy_n(now, 3, before);
    }
    return any != 0;
  }

  static std::uint8_t concerned(kbvh::TopologyNode node, std::span<const std::uint32_t> vertices,
                                const Seen& seen) {
    std::uint8_t any = 0;
    if (node.is_leaf())
      for (const std::uint32_t vertex : vertices) any |= seen.moved[vertex];
    else
      for (std::uint32_t k = 0; k < node.count(); ++k) any |= seen.changed[node.first() + k];
    return any;
  }

  static kbvh::Box<S> union_of_children(kbvh::TopologyNode node, const kbvh::WideHierarchy<S>& hierarchy) {
    kbvh::Box<S> box = hierarchy.box(node.first());
    for (std::uint32_t k = 1; k < node.count(); ++k) box.extend(hierarchy.box(node.first() + k));
    return box;
  }

  std::vector<Seen> seen_;
};

}  // namespace

KBVH_STRATEGY(sparse_refit) {
  return {kbvh::make_entry<SparseRefit>({
      .id = "sparse_refit",
      .title = "refit of what moved",
      .family = "refit",
      .citation = "kbvh's example of a strategy from outside its tree",
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = kbvh::BuildMethod::median, .width = 2, .leaf_size = 4}},
  })};
}
