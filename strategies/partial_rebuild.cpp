// The worst leaves are dissolved, and their primitives form new ones (the idea of parry, which treats a
// twentieth of the leaves at each frame). Then the tree is rebuilt over whole leaves, sorted by medians.
//
// When it wins: on bodies that are connected, or consist of many connected parts, it is as fast over a clip
// as `drift_rebuild`, and its worst frame costs less, because no frame sorts all primitives. On a soup of
// single triangles, whose leaves all age, it is slower than `drift_rebuild`. A share of a tenth was too small
// for two mixing swarms: leaves aged faster than they were renewed.

#include <cmath>

#include "core/contract/registry.hpp"
#include "core/families/restructure/leaf_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class PartialRebuild final : public LeafStrategy<S> {
  using Base = LeafStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  PartialRebuild(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                 const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        share_(params.number("share")),
        price_(params.number("price")) {}

 private:
  void update(std::uint32_t index) override {
    auto& hierarchy = this->hierarchies_[index];
    auto& body = this->bodies_[index];
    const double surplus = body.age.end_frame();
    if (surplus > price_ * double(hierarchy.topology().primitives.size())) {
      const auto count = std::uint32_t(std::ceil(share_ * body.contents.full_leaf_count()));
      body.contents.renew_leaves(hierarchy, this->scene_.primitives(index), this->sampled_.positions(index),
                                 count);
      body.age.repair();
      renewed_ += count;
    }
    this->refit_counted(index);
  }
  void counts_cleared() override { renewed_ = 0; }
  void add_counts(Counters& table) const override { table.add("leaves_renewed", renewed_); }

  double share_, price_;
  std::uint64_t renewed_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(partial_rebuild) {
  using namespace kbvh;
  return {make_entry<PartialRebuild>({
      .id = "partial_rebuild",
      .title = "refit, worst leaves rebuilt",
      .family = "restructuring",
      .citation = "after parry (Dimforge), which optimises a part of its tree at each step",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters =
          {{"share", "0.25", {}, "share of the leaves that one frame renews, the largest first", 0, 1},
           {"price",
            "20",
            {},
            "surplus box tests per primitive, beyond those of the tree at its best, from which on a "
            "frame renews leaves; 0: at every frame with a surplus",
            0,
            1e6}},
  })};
}
