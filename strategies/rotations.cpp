// Tree rotations at every refit (Kopta et al. 2012), on wide nodes: two grandchildren of a node change places
// if that saves surface, so all leaves keep their depth. A node is checked again only when the surface of its
// children has grown since its last check.
//
// When it wins: nowhere that was tried. On the built-in scenes that age most it is as fast as the refit
// without rotations, or slower. In these scenes the leaves age, because their primitives drift apart, and no
// rotation divides a leaf. With smaller leaves, better places are too far away for exchanges within two
// levels.

#include "core/contract/registry.hpp"
#include "core/families/restructure/cousins.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "core/families/wide/surface_sums.hpp"
#include "core/topology/subtree_swap.hpp"

namespace kbvh {
namespace {

template <class S>
class Rotations final : public EditedHierarchyStrategy<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  Rotations(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
            const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        most_(std::uint32_t(params.number("most"))),
        settled_(scene.body_count()) {
    for (std::uint32_t body = 0; body < settled_.size(); ++body) topology_changed(body);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (auto& settled : settled_) std::fill(settled.begin(), settled.end(), S(0));
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + settled_.capacity() * sizeof(std::vector<S>) + swap_.bytes();
    for (const auto& settled : settled_) total += settled.capacity() * sizeof(S);
    return total;
  }

 private:
  void topology_changed(std::uint32_t body) override {
    settled_[body].assign(this->hierarchies_[body].topology().size(), S(0));
  }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    this->refit_counted(body);
    const std::uint64_t before = rotations_;
    for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) rotate(body, node);
    if (rotations_ != before) this->refit_counted(body);
  }

  /// Exchanges grandchildren of a node as long as that pays, unless its children are the same as when nothing
  /// could be gained.
  void rotate(std::uint32_t body, std::uint32_t node) {
    auto& hierarchy = this->hierarchies_[body];
    const std::uint32_t wide = hierarchy.wide_node(node);
    if (wide == hierarchy.no_node ||
        hierarchy.arrays().nodes[wide].leaf_count + 1 >= hierarchy.arrays().nodes[wide].count)
      return;
    const double own = own_surface(hierarchy.arrays(), wide);
    if (!(own > 0)) return;
    double ratio = children_surface(hierarchy.arrays(), hierarchy.topology().width, wide) / own;
    S& settled = settled_[body][node];
    if (ratio <= settled * 1.01) return;
    settled = S(ratio);
    for (std::uint32_t i = 0; i < most_ && cousins_.read(hierarchy, node); ++i) {
      const auto best = cousins_.best();
      if (!(double(best.gain) > 1e-3 * own)) return;
      hierarchy.edit([&](Topology& topology, TopologyEdit& edit) {
        swap_.exchange(topology, best.first, best.second, edit);
      });
      settled = S(ratio -= double(best.gain) / own);
      ++rotations_;
    }
  }

  void counts_cleared() override { rotations_ = 0; }
  void add_counts(Counters& table) const override { table.add("rotations", rotations_); }

  std::uint32_t most_;
  std::vector<std::vector<S>> settled_;  // [body][node]: surface ratio of its children at the last check
  Cousins<S> cousins_;
  SubtreeSwap swap_;
  std::uint64_t rotations_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(rotations) {
  using namespace kbvh;
  return {make_entry<Rotations>({
      .id = "rotations",
      .title = "refit with tree rotations",
      .family = "restructuring",
      .citation = "Kopta et al. 2012",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"most",
                      "4",
                      {},
                      "maximum number of exchanges per frame, each of two grandchildren of a node",
                      1,
                      1000,
                      Numbers::whole}},
  })};
}
