// The kinetic AABB tree (Z&W 2006, s.4), with the errata of the reproduction: tight at every time, updated at
// events only.

#include <variant>

#include "core/hierarchy/realiser_boxes.hpp"
#include "core/kinetic/kinetic_forest.hpp"
#include "core/registry.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class KineticAabb final : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  KineticAabb(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
              const Params& params)
      : Strategy<S>(scene, motion) {
    for (const Topology& topology : topologies) caches_.emplace_back(topology.size());
    if (params.word("queue") == AvlQueue<S>::name)
      forest_ = std::make_unique<KineticForest<S, AvlQueue<S>, Count>>(scene, motion, std::move(topologies),
                                                                       count_);
    else
      forest_ = std::make_unique<KineticForest<S, BinaryHeapQueue<S>, Count>>(scene, motion,
                                                                              std::move(topologies), count_);
  }

  void reset(double t) override {
    this->start_at(t);
    on_forest([&](auto& forest) { forest.reset(t); });
    // What starting costs is not what running costs: counts begin here.
    count_.table = {};
    first_step_ = on_forest([](auto& forest) { return forest.queue().steps(); });
    first_fetch_ = this->sampled_.fetched();
    new_frame();
  }

  void advance(double t) override {
    this->move_to(t);
    on_forest([&](auto& forest) { forest.advance(t); });
    new_frame();
  }

  QueryStatus candidates_at(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    on_forest([&](auto& forest) {
      for (const BodyPair& pair : this->scene_.pairs()) {
        const auto &a = forest.tree(pair.first), &b = forest.tree(pair.second);
        LeafPairs<S, Count> leaves(this->scene_, this->sampled_, pair.first, a.topology(), pair.second,
                                   b.topology(), count_, out);
        RealiserBoxes<S> boxes_a(a.realisers(0), this->sampled_, pair.first, caches_[pair.first]);
        RealiserBoxes<S> boxes_b(b.realisers(0), this->sampled_, pair.second, caches_[pair.second]);
        status.pending +=
            traverse(a.topology(), boxes_a, b.topology(), boxes_b, stack_, count_, budget, leaves).pending;
      }
    });
    return status;
  }

  void flight_plans_changed(double t, std::span<const PlanChange<S>> changes) override {
    this->stand_at(t);
    on_forest([&](auto& forest) { forest.plans_changed(t, changes); });
    new_frame();  // realisers may differ now
  }

  void geometry_changed(double t, const GeometryChange<S>& change) override {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_forest([&](auto& forest) {
      forest.geometry_changed(t, this->scene_, this->sampled_, changes);
      for (const BodyChange& own : changes) caches_[own.body].resize(forest.tree(own.body).topology().size());
    });
    new_frame();
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return on_forest([&](auto& forest) {
      const auto& tree = forest.tree(body);
      std::vector<std::uint32_t> order;
      AuditView view{tree.compacted_topology(order), {}, {}};
      for (const std::uint32_t node : order) {
        const Box<S> box = caches_[body].current(node)
                               ? caches_[body].box(node)
                               : box_of_realisers(tree.realisers(node), this->sampled_, body);
        view.boxes.push_back(to_double(box));
      }
      return view;
    });
  }

  std::size_t bytes() const override {
    std::size_t total = on_forest([](auto& forest) { return forest.bytes(); });
    for (const auto& cache : caches_) total += cache.bytes();
    return total;
  }

 protected:
  Counters counted() const override {
    Counters table = count_.table;
    if constexpr (Count::enabled) {
      table[Counter::queue_steps] =
          on_forest([](auto& forest) { return forest.queue().steps(); }) - first_step_;
      table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    }
    return table;
  }

 private:
  template <class Work>
  decltype(auto) on_forest(Work&& work) const {
    return std::visit([&](const auto& forest) -> decltype(auto) { return work(*forest); }, forest_);
  }
  void new_frame() {
    for (auto& cache : caches_) cache.new_frame();
  }

  Count count_;
  std::variant<std::unique_ptr<KineticForest<S, AvlQueue<S>, Count>>,
               std::unique_ptr<KineticForest<S, BinaryHeapQueue<S>, Count>>>
      forest_;
  std::vector<BoxCache<S>> caches_;
  std::vector<NodePair> stack_;
  std::uint64_t first_step_ = 0, first_fetch_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_aabb) {
  using namespace kbvh;
  return {make_entry<KineticAabb>({
      .id = "kinetic_aabb",
      .title = "kinetic AABB tree",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.4",
      .positions = PositionUse::fetched,
      .can = {.event_driven = true,
              .continuous = true,
              .plan_changes = true,
              .geometry_changes = true,
              .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
      .parameters = {{"queue",
                      "avl",
                      {"avl", "binary_heap"},
                      "event queue: the paper's AVL tree, or an indexed binary heap"}},
  })};
}
