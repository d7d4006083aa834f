// Rebuilds subtrees whose children overlap more than when they were new, those with the largest gain per
// primitive first (Yoon, Curtis & Manocha 2007), within a budget of primitives per frame. A rebuild sorts the
// primitives of the subtree by medians into its leaves.
//
// When it wins: where some parts of a body age and others do not, and where no frame may be much more
// expensive than another. Over a clip in which all parts age it is slower than `drift_rebuild`.

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/restructure/leaf_strategy.hpp"
#include "core/families/wide/surface_sums.hpp"

namespace kbvh {
namespace {

template <class S>
class SelectiveRestructuring final : public LeafStrategy<S> {
  using Base = LeafStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  SelectiveRestructuring(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                         const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        drift_(params.number("drift")),
        budget_(params.number("budget")),
        trees_(scene.body_count()) {
    for (std::uint32_t body = 0; body < trees_.size(); ++body) prepare(body);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (Tree& tree : trees_) {
      std::fill(tree.fresh.begin(), tree.fresh.end(), unknown);
      tree.credit = 0;
    }
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + trees_.capacity() * sizeof(Tree) + aged_.capacity() * sizeof(Aged) +
                        (open_.capacity() + chosen_.capacity()) * sizeof(std::uint32_t);
    for (const Tree& tree : trees_) total += tree.fresh.capacity() * sizeof(double);
    return total;
  }

 private:
  static constexpr double unknown = -1;
  struct Tree {
    std::vector<double> fresh;  ///< [node]: least surface ratio of its children since they were new
    double credit = 0;          ///< number of primitives that may be sorted
  };
  /// A subtree to be rebuilt.
  struct Aged {
    std::uint32_t node;
    double worth;  ///< surface to be gained per primitive
  };

  void topology_changed(std::uint32_t body) override {
    Base::topology_changed(body);
    prepare(body);
  }
  void prepare(std::uint32_t body) {
    trees_[body].fresh.assign(this->hierarchies_[body].topology().size(), unknown);
    trees_[body].credit = 0;
  }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    this->refit_counted(body);
    if (hierarchy.topology().size() < 2) return;
    const double all = double(hierarchy.topology().primitives.size());
    Tree& tree = trees_[body];
    tree.credit = std::min(all, tree.credit + budget_ * all);
    find_aged(body);
    choose(body);
    if (chosen_.empty()) return;
    this->bodies_[body].contents.sort_primitives(hierarchy, this->scene_.primitives(body),
                                                 this->sampled_.positions(body), chosen_);
    restructured_ += chosen_.size();
    for (const std::uint32_t node : chosen_) forget(body, node);
    this->refit_counted(body);
  }

  /// Lists the highest nodes whose children's surface, compared with their own, has grown beyond the limit.
  void find_aged(std::uint32_t body) {
    auto& hierarchy = this->hierarchies_[body];
    const Topology& topology = hierarchy.topology();
    const WideArrays<S> arrays = hierarchy.arrays();
    aged_.clear();
    open_.assign(1, 0);
    while (!open_.empty()) {
      const std::uint32_t node = open_.back(), wide = hierarchy.wide_node(node);
      open_.pop_back();
      if (wide == hierarchy.no_node) continue;
      const double own = own_surface(arrays, wide);
      const double ratio = own > 0 ? children_surface(arrays, topology.width, wide) / own : 0;
      double& fresh = trees_[body].fresh[node];
      if (fresh == unknown || ratio < fresh) fresh = ratio;
      if (ratio > drift_ * fresh) {
        aged_.push_back({node, (ratio - fresh) * own / this->bodies_[body].contents.primitives_below(node)});
        continue;
      }
      const TopologyNode content = topology.nodes[node];
      for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c) open_.push_back(c);
    }
  }

  void choose(std::uint32_t body) {
    Tree& tree = trees_[body];
    std::sort(aged_.begin(), aged_.end(), [](const Aged& a, const Aged& b) {
      return a.worth != b.worth ? a.worth > b.worth : a.node < b.node;
    });
    chosen_.clear();
    for (const Aged& aged : aged_) {
      const double cost = this->bodies_[body].contents.primitives_below(aged.node);
      if (cost > tree.credit) break;  // saves for the subtree that is worth most
      tree.credit -= cost;
      chosen_.push_back(aged.node);
    }
  }

  void forget(std::uint32_t body, std::uint32_t node) {
    const Topology& topology = this->hierarchies_[body].topology();
    open_.assign(1, node);
    while (!open_.empty()) {
      const std::uint32_t next = open_.back();
      open_.pop_back();
      trees_[body].fresh[next] = unknown;
      const TopologyNode content = topology.nodes[next];
      if (content.is_leaf()) continue;
      for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c) open_.push_back(c);
    }
  }

  void counts_cleared() override { restructured_ = 0; }
  void add_counts(Counters& table) const override { table.add("subtrees_rebuilt", restructured_); }

  double drift_, budget_;
  std::vector<Tree> trees_;
  std::vector<Aged> aged_;
  std::vector<std::uint32_t> open_, chosen_;
  std::uint64_t restructured_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(selective_restructuring) {
  using namespace kbvh;
  return {make_entry<SelectiveRestructuring>({
      .id = "selective_restructuring",
      .title = "selective restructuring",
      .family = "restructuring",
      .citation = "Yoon, Curtis & Manocha 2007",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters =
          {{"drift",
            "1.3",
            {},
            "rebuild a subtree when the surfaces of its root's children over that of the root exceed "
            "the least value since it was new by this factor",
            1,
            1e6},
           {"budget",
            "0.25",
            {},
            "share of the primitives that may be sorted per frame; unused shares are saved up",
            0,
            1}},
  })};
}
