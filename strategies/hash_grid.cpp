// A uniform grid with hashed cells, without a hierarchy: built again for each pair of bodies and each frame
// by a counting sort. A box is entered once, into the cell of its lower corner, so that no pair is found
// twice; boxes much larger than most have coarser grids of their own. Only boxes that meet the box of the
// other body take part.
//
// When it wins: undecided. Where bodies mix or fly apart it competes with `lbvh` and `sweep` and is far ahead
// of a refit; plan `ageing` compares them. A refit wins by far where neighbours stay neighbours, as on cloth.
#include "core/families/grid/hash_grid.hpp"

#include "core/contract/registry.hpp"
#include "core/families/build/built_each_frame.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

template <class S>
class HashGridStrategy final : public BuiltEachFrame<S, GridBody<S>> {
  using Base = BuiltEachFrame<S, GridBody<S>>;
  using Base::bodies_;
  using Base::lists_;

 public:
  HashGridStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion,
                   const Topologies& /*topologies*/, const Params& params)
      : Base(scene, motion), grid_(params.number("cell"), this->kernels_) {}

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) { return bodies_[body].box(); };
    for (const std::uint32_t i : this->near_bodies_.find(box_of, tests)) {
      const auto [first, second] = this->scene_.pairs()[i];
      grid_.search(
          bodies_[first], lists_[first], bodies_[second], lists_[second], tests,
          [&, first = first, second = second](std::uint32_t a, std::uint32_t b) {
            if (first != second || keep_self_pair(&this->scene_.primitives(first), LeavesOf::two, a, b))
              out.push_back({first, a, second, b});
          });
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }
  std::size_t bytes() const override { return Base::bytes() + grid_.bytes(); }

 private:
  void build(std::uint32_t body) override {
    bodies_[body].update(this->scene_.primitives(body), lists_[body], this->sampled_.positions(body),
                         this->kernels_);
    this->count_build(body);
  }

  HashGrid<S> grid_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(hash_grid) {
  using namespace kbvh;
  return {make_entry<HashGridStrategy>({
      .id = "hash_grid",
      .title = "hash grid",
      .family = "sweep",
      .citation = "Teschner et al. 2003",
      .tightness = Tightness::none,
      .topology = {.own = true},
      .parameters = {{"cell",
                      "2",
                      {},
                      "size of the smallest cells over the mean of the boxes' longest sides",
                      0.25,
                      64}},
  })};
}
