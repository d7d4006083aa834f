#pragma once
#include <memory>
#include <variant>

#include "core/contract/strategy.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/topology/leaf_pairs.hpp"

namespace kbvh {

/// A strategy of kinetic AABB trees (Z&W s.4) and nothing else: boxes are read from the realisers when a
/// query asks. `Queues` are the event queues that it can be made with; their clock decides what an event is.
template <class S, class Count, class... Queues>
class KineticAabbStrategy : public Strategy<S> {
  template <class Queue>
  using Forest = KineticForest<S, Queue, Count>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  /// `queue` is the index among Queues of the one to use.
  KineticAabbStrategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                      std::size_t queue)
      : Strategy<S>(scene, motion), near_bodies_(scene.pairs(), scene.body_count()) {
    for (const Topology& topology : topologies) caches_.emplace_back(topology.size());
    std::size_t index = 0;
    (void)((index++ == queue &&
            (forest_ = std::make_unique<Forest<Queues>>(scene, motion, std::move(topologies), count_),
             true)) ||
           ...);
  }

  void reset(double t) override {
    this->start_at(t);
    near_bodies_.start_over();
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
    BoxTests tests;
    on_forest([&](auto& forest) {
      const auto box_of = [&](std::uint32_t body) -> Box<double> {
        const auto& tree = forest.tree(body);
        if (tree.topology().empty()) return {};
        RealiserBoxes<S> boxes(tree.realisers(0), this->sampled_, body, caches_[body]);
        boxes.ensure(0);
        return to_double(boxes(0));
      };
      for (const std::uint32_t i : near_bodies_.find(box_of, tests.made)) {
        const BodyPair& pair = this->scene_.pairs()[i];
        if (tests.made >= budget.box_tests) {
          ++status.pending;
          continue;
        }
        const auto &a = forest.tree(pair.first), &b = forest.tree(pair.second);
        LeafPairs<S, BoxTests> leaves(this->scene_, this->sampled_, pair.first, a.topology(), pair.second,
                                      b.topology(), tests, out);
        RealiserBoxes<S> boxes_a(a.realisers(0), this->sampled_, pair.first, caches_[pair.first]);
        RealiserBoxes<S> boxes_b(b.realisers(0), this->sampled_, pair.second, caches_[pair.second]);
        status.pending += traverse(a.topology(), boxes_a, b.topology(), boxes_b, stack_, tests,
                                   rest_of(budget, tests.made), leaves)
                              .pending;
      }
    });
    count_.add(Counter::box_tests, tests.made);
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
    return total + near_bodies_.bytes();
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
  std::variant<std::unique_ptr<Forest<Queues>>...> forest_;
  NearBodies near_bodies_;
  std::vector<BoxCache<S>> caches_;
  std::vector<NodePair> stack_;
  std::uint64_t first_step_ = 0, first_fetch_ = 0;
};

}  // namespace kbvh
