// A uniform grid with hashed cells, without a hierarchy, made anew for each two bodies and frame by a
// counting sort. A box is entered once, into the cell of its lower corner, so that no pair is found twice;
// boxes much larger than most have coarser grids of their own. Only boxes that meet the box of the other body
// take part.
//
// When it wins: not decided. Where bodies mix or fly apart it is a rival of `lbvh` and `sweep` and far ahead
// of a refit; plan `ageing` compares them. A refit wins by far where neighbours stay neighbours, as on cloth.
#include "core/families/grid/hash_grid.hpp"

#include "core/contract/registry.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class HashGridStrategy final : public CountedStrategy<S, Count>,
                               public AnswersSelfPairs,
                               public TakesPlanChanges<S>,
                               public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  HashGridStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion,
                   const Topologies& /*topologies*/, const Params& params)
      : CountedStrategy<S, Count>(scene, motion),
        bodies_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()),
        grid_(params.number("cell"), kernels_) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      lists_.emplace_back(scene.primitives(body));
  }

  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) update(body);
  }
  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) update(body);
  }
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) { return bodies_[body].box(); };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
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
  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + grid_.bytes() + bodies_.capacity() * sizeof(bodies_[0]) +
                        lists_.capacity() * sizeof(lists_[0]);
    for (const auto& body : bodies_) total += body.bytes();
    for (const PrimitiveList& list : lists_) total += list.bytes();
    return total;
  }

 private:
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    plans_changed_ = true;  // new vertices have their own plans
    for (const BodyChange& body_change : body_changes(this->scene_, change)) {
      lists_[body_change.body] = PrimitiveList(this->scene_.primitives(body_change.body));
      update(body_change.body);
    }
  }
  void update(std::uint32_t body) {
    bodies_[body].update(this->scene_.primitives(body), lists_[body], this->sampled_.positions(body),
                         kernels_);
    this->count_.add(Counter::values_written, std::uint64_t(6) * lists_[body].count);
    this->count_.add(Counter::vertex_reads, this->scene_.primitives(body).vertices.size());
  }

  const KernelSet kernels_ = active_kernel_set();
  std::vector<GridBody<S>> bodies_;
  std::vector<PrimitiveList> lists_;
  NearBodies near_bodies_;
  HashGrid<S> grid_;
  bool plans_changed_ = false;
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
