// Linear BVH, kept and refitted until it has drifted: a new tree is built when the queries have made as many
// box tests beyond those of a new tree as a build is worth (Lauterbach, Yoon & Manocha 2006, with the builder
// of `lbvh`).
//
// When it wins: where a tree ages so fast that it lasts for one or two frames, it is as fast as `lbvh`; where
// it lasts longer, it is faster than `lbvh` and than a tree that keeps its shape (plan `ageing`). Its refit
// is slower than that of `bottom_up`, which wins where nothing ages.
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/curve_builders.hpp"
#include "core/families/restructure/tree_age.hpp"

namespace kbvh {
namespace {

template <class S>
struct DriftBuilder : LinearBuilder<S> {
  explicit DriftBuilder(const Params& /*params*/) {}
};

template <class S>
class LbvhDrift final : public BuiltStrategy<S, DriftBuilder<S>> {
  using Base = BuiltStrategy<S, DriftBuilder<S>>;

 public:
  LbvhDrift(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies& topologies,
            const Params& params)
      : Base(scene, motion, topologies, params), price_(params.number("price")), trees_(scene.body_count()) {}

  double growth() const override {
    double sum = 0;
    for (const Tree& tree : trees_) sum += tree.age.growth();
    return sum;
  }
  std::size_t bytes() const override { return Base::bytes() + trees_.capacity() * sizeof(Tree); }

 private:
  struct Tree {
    TreeAge age;
    bool wanted = true;  // there is no tree of the current primitives
  };

  void list_changed(std::uint32_t body) override { trees_[body] = {}; }
  void build(std::uint32_t body) override {
    Tree& tree = trees_[body];
    const double surplus = tree.age.end_frame();
    if (!tree.wanted && surplus <= price_ * double(this->lists_[body].count)) {
      this->refit(body);
      return;
    }
    Base::build(body);
    tree.age.renew();
    tree.wanted = false;
    ++builds_;
  }
  bool watches_searches() const override { return true; }
  void searched(const BodyPair& pair, std::uint64_t tests, std::uint64_t found) override {
    trees_[pair.first].age.add(tests, found);
    if (pair.second != pair.first) trees_[pair.second].age.add(tests, found);
  }
  void followed(std::uint32_t body, const RayWork& work) override {
    trees_[body].age.add_rays(work.tests, work.rays);
  }
  void counts_cleared() override { builds_ = 0; }
  void add_counts(Counters& table) const override { table.add("rebuilds", builds_); }

  double price_;
  std::vector<Tree> trees_;
  std::uint64_t builds_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(lbvh_drift) {
  using namespace kbvh;
  return {make_entry<LbvhDrift>({
      .id = "lbvh_drift",
      .title = "linear BVH, rebuilt at drift",
      .family = "restructuring",
      .citation = "Lauterbach, Yoon & Manocha 2006; Lauterbach et al. 2009",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::morton, .width = 8, .leaf_size = 16}},
      .parameters = {{"price", "5", {}, "surplus box tests per primitive from which on a build pays", 0, 1e6},
                     threads_parameter("positions, builds, refits, rays and triangle tests")},
  })};
}
