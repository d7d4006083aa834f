// At each frame the largest leaves are taken apart.

#include "core/contract/registry.hpp"
#include "core/families/restructure/leaf_contents.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class PartialRebuild final : public StoredHierarchyStrategy<S, Count>,
                             public AnswersSelfPairs,
                             public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  PartialRebuild(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                 const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        share_(params.number("share")),
        contents_(scene.body_count()) {
    for (std::uint32_t body = 0; body < contents_.size(); ++body) topology_changed(body);
  }

  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + contents_.capacity() * sizeof(LeafContents<S>);
    for (const auto& contents : contents_) total += contents.bytes();
    return total;
  }

 private:
  void topology_changed(std::uint32_t body) override { contents_[body].prepare(this->hierarchies_[body]); }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    LeafContents<S>& contents = contents_[body];
    const auto count = std::uint32_t(share_ * contents.full_leaf_count() + 0.999999);
    contents.renew_leaves(hierarchy, this->scene_.primitives(body), this->sampled_.positions(body), count);
    renewed_ += count;
    this->refit(body);
    this->count_.add(Counter::nodes_visited, hierarchy.topology().size());
    this->count_.add(Counter::values_written, std::uint64_t(6) * hierarchy.topology().size());
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }
  void counts_cleared() override { renewed_ = 0; }
  void add_counts(Counters& table) const override { table.add("leaves_renewed", renewed_); }

  double share_;
  std::vector<LeafContents<S>> contents_;
  std::uint64_t renewed_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(partial_rebuild) {
  using namespace kbvh;
  return {make_entry<PartialRebuild>({
      .id = "partial_rebuild",
      .title = "partial rebuild",
      .family = "restructuring",
      .citation = "parry (Dimforge), incremental optimisation of its BVH",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters =
          {{"share", "0.05", {}, "share of the leaves that a frame renews, the largest first", 0, 1}},
  })};
}
