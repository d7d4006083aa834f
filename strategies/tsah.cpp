// One topology for a whole clip, refitted: each split of the tree is chosen by the surfaces of its parts at
// several times of the clip, not only at the first (temporal surface-area heuristic).
#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "core/topology/builder_over_time.hpp"

namespace kbvh {
namespace {

/// Returns a topology of a body for `samples` times of the clip, with the width and leaf size of `before`;
/// nothing for a body that does not follow its keyframes.
template <class S>
std::optional<Topology> over_clip(const SceneView<S>& scene, const ClipMotion<S>& motion, std::uint32_t body,
                                  const Topology& before, std::size_t samples) {
  const FlightPlans<S>& plans = motion.plans(body);
  const auto times = plans.keyframe_times();
  if (!scene.moving(body) || times.size() < 2 || plans.has_own_plans()) return {};
  std::vector<std::vector<S>> positions(samples);
  std::vector<const S*> rows;
  for (std::size_t i = 0; i < samples; ++i) {
    const double share = double(i) / double(samples - 1);
    positions[i].resize(std::size_t(3) * scene.vertex_count(body) + 1);
    plans.evaluate(times.front() + share * (times.back() - times.front()), positions[i].data());
    rows.push_back(positions[i].data());
  }
  return build_topology_over_time<S>(scene.primitives(body), rows,
                                     {.width = before.width, .leaf_size = before.leaf_size});
}

template <class S>
class Tsah final : public EditedHierarchyStrategy<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;
  Tsah(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        motion_(motion),
        samples_(std::size_t(params.number("samples"))) {}

  /// The trees are made for one clip, so making them is part of its cost.
  void reset_to(double t) override {
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) {
      WideHierarchy<S>& hierarchy = this->hierarchies_[body];
      if (auto topology = over_clip(this->scene_, motion_, body, hierarchy.topology(), samples_))
        hierarchy.assign(std::move(*topology), this->scene_.primitives(body), hierarchy.kernels());
    }
    Base::reset_to(t);
  }

 private:
  void update(std::uint32_t body) override {
    this->hierarchies_[body].refit(this->sampled_.positions(body));
    this->count_refit(body);
  }
  ClipMotion<S> motion_;
  std::size_t samples_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(tsah) {
  using namespace kbvh;
  return {make_entry<Tsah>({
      .id = "tsah",
      .title = "refit, one tree for the clip",
      .family = "restructuring",
      .citation = "Bittner & Meister 2015",
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"samples",
                      "8",
                      {},
                      "times of the clip that the tree is built for, the first and the last among them",
                      2,
                      64,
                      Numbers::whole}},
  })};
}
