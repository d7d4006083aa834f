// A new topology for every frame: the highest update cost, and the best boxes for a query. Building
// allocates; this is part of the strategy's cost.

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class Rebuild final : public StoredHierarchyStrategy<S>,
                      public AnswersSelfPairs,
                      public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  Rebuild(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
          const Params& params)
      : Base(scene, motion, std::move(topologies), params) {
    config_.method = build_method(params.word("method"));
    for (const auto& hierarchy : this->hierarchies_) {
      config_.width = hierarchy.topology().width;
      config_.leaf_size = hierarchy.topology().leaf_size;
    }
  }

  /// Treats the reset like any other frame: later builds leave no trace.
  void reset_to(double t) override {
    Base::reset_to(t);
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) update(body);
  }

  /// Rebuilds resting bodies, too.
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->plans_changed_ = true;
    for (const BodyChange& own : body_changes(this->scene_, change)) update(own.body);
  }

 private:
  void update(std::uint32_t body) override {
    const Primitives& primitives = this->scene_.primitives(body);
    auto& hierarchy = this->hierarchies_[body];
    hierarchy.assign(build_topology(primitives, this->sampled_.positions(body), config_), primitives,
                     hierarchy.kernels());
    this->refit(body);
    count_boxes(this->count_, hierarchy.topology().size(),
                primitives.vertices.size() + hierarchy.leaf_vertex_count());
  }

  BuilderConfig config_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(rebuild) {
  using namespace kbvh;
  return {make_entry<Rebuild>({
      .id = "rebuild",
      .title = "rebuild",
      .family = "rebuild",
      .citation = "van den Bergen 1997 (as the alternative to refitting)",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"method", "median", {"median", "sah", "morton"}, "builder of the new topology"}},
  })};
}
