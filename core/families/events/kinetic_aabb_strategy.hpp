#pragma once
#include <memory>
#include <variant>

#include "core/contract/strategy.hpp"
#include "core/families/events/event_log.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/kinetic_rows.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/topology/leaf_pairs.hpp"

namespace kbvh {

/// The traversal of a query of kinetic AABB trees.
enum class KineticQuery : std::uint8_t {
  wide_rows,   ///< on the kernels of stored boxes (KineticRows)
  node_pairs,  ///< node by node, as in 2006
};

/// A strategy of kinetic AABB trees (Z&W s.4) and nothing else. Queries compute boxes on demand from the
/// realisers. `Queues` are the event queues to choose from; the clock of a queue defines its events.
template <class S, class Count, class... Queues>
class KineticAabbStrategy : public CountedStrategy<S, Count> {
  template <class Queue>
  using Forest = KineticForest<S, Queue, Count, BoundObserver<S>>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  /// Uses the queue with the index `queue` in Queues.
  KineticAabbStrategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                      std::size_t queue, KineticQuery query)
      : CountedStrategy<S, Count>(scene, motion),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        by_rows_(query == KineticQuery::wide_rows) {
    if (!by_rows_)
      for (const Topology& topology : topologies) caches_.emplace_back(topology.size());
    std::size_t index = 0;
    (void)((index++ == queue &&
            (forest_ = std::make_unique<Forest<Queues>>(scene, motion, std::move(topologies), this->count_,
                                                        BoundObserver<S>{&watch_}),
             true)) ||
           ...);
    if (!by_rows_) return;
    rows_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < rows_.size(); ++body) lay_out(body);
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return rows_[body].hierarchy(); });
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    on_forest([&](auto& forest) { forest.reset(t); });
    for (auto& rows : rows_) rows.rows().start_over();
    new_frame();
  }

  void advance_to(double t) override {
    on_forest([&](auto& forest) { forest.advance(t); });
    new_frame();
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    return on_forest([&](auto& forest) {
      return by_rows_ ? query_rows(forest, out, budget) : query_nodes(forest, out, budget);
    });
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return on_forest([&](auto& forest) {
      const auto& tree = forest.tree(body);
      std::vector<std::uint32_t> order;
      AuditView view{tree.compacted_topology(order), {}, {}};
      for (const std::uint32_t node : order) {
        // Reports the box that a query has read, if there is one.
        Box<S> room;
        const Box<S>* read = by_rows_                      ? rows_[body].read_box(node, room)
                             : caches_[body].current(node) ? &caches_[body].box(node)
                                                           : nullptr;
        view.boxes.push_back(to_double(
            read != nullptr ? *read : box_of_realisers(tree.realisers(node), this->sampled_, body)));
      }
      return view;
    });
  }

  std::size_t bytes() const override {
    std::size_t total = on_forest([](auto& forest) { return forest.bytes(); });
    for (const auto& cache : caches_) total += cache.bytes();
    for (const auto& rows : rows_) total += rows.bytes();
    return total + near_bodies_.bytes() + query_.bytes() + stack_.capacity() * sizeof(NodePair);
  }

 protected:
  /// Implements `follow_plans` for derived classes that take changes of plans.
  void change_plans(double t, std::span<const PlanChange<S>> changes) {
    on_forest([&](auto& forest) { forest.plans_changed(t, changes); });
    for (const PlanChange<S>& change : changes)
      if (by_rows_) rows_[change.body].rows().plans_changed();
    new_frame();  // realisers may differ now
  }

  /// Implements `follow_geometry` for derived classes that take changes of geometry.
  void change_geometry(double t, const GeometryChange<S>& change) {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_forest([&](auto& forest) {
      forest.geometry_changed(t, this->scene_, this->sampled_, changes);
      for (const BodyChange& changed : changes)
        if (!by_rows_) caches_[changed.body].resize(forest.tree(changed.body).topology().size());
    });
    for (const BodyChange& changed : changes)
      if (by_rows_) lay_out(changed.body);
    new_frame();
  }

  void counts_cleared() override {
    first_step_ = on_forest([](auto& forest) { return forest.queue().steps(); });
  }
  void add_counts(Counters& table) const override {
    table[Counter::queue_steps] =
        on_forest([](auto& forest) { return forest.queue().steps(); }) - first_step_;
  }

  template <class Work>
  decltype(auto) on_forest(Work&& work) const {
    return std::visit([&](const auto& forest) -> decltype(auto) { return work(*forest); }, forest_);
  }
  BoundWatch<S> watch_;

 private:
  void new_frame() {
    for (auto& cache : caches_) cache.new_frame();
    for (std::uint32_t body = 0; body < rows_.size(); ++body) rows_[body].rows().new_frame(motion_, body);
  }
  void lay_out(std::uint32_t body) {
    on_forest([&](auto& forest) { rows_[body].follow(forest.tree(body), this->scene_.primitives(body)); });
    rows_[body].rows().plans_changed();
  }

  template <class Forest>
  QueryStatus query_rows(const Forest& forest, PairBuffer& out, const Budget& budget) {
    std::uint64_t tests = 0, reads = 0;
    for (std::uint32_t body = 0; body < rows_.size(); ++body)
      reads += rows_[body].make_visited(forest.tree(body), this->sampled_, body);
    const auto side_of = [&](std::uint32_t body) -> typename WideQuery<S>::LazySide {
      return {&rows_[body].rows().hierarchy(), body, rows_[body].rows().stale()};
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) {
      reads += rows_[body].make_wanted(node, forest.tree(body), this->sampled_, body);
    };
    const QueryStatus status =
        query_lazily(query_, near_bodies_, this->scene_, this->sampled_, budget, side_of, make, out, tests);
    this->count_.add(Counter::box_tests, tests);
    this->count_.add(Counter::positions_fetched, reads);
    return status;
  }

  template <class Forest>
  QueryStatus query_nodes(const Forest& forest, PairBuffer& out, const Budget& budget) {
    QueryStatus status;
    BoxTests tests;
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
    this->count_.add(Counter::box_tests, tests.made);
    return status;
  }

  std::variant<std::unique_ptr<Forest<Queues>>...> forest_;
  ClipMotion<S> motion_;
  NearBodies near_bodies_;
  bool by_rows_;
  std::vector<KineticRows<S>> rows_;  ///< [body]; for queries by rows
  WideQuery<S> query_;
  std::vector<BoxCache<S>> caches_;  ///< [body]; for queries by node pairs
  std::vector<NodePair> stack_;
  std::uint64_t first_step_ = 0;
};

/// A KineticAabbStrategy on exact clocks (EventClock): plans and geometry may change, and events can be
/// stepped.
template <class S, class Count, class... Queues>
class ExactKineticAabbStrategy : public KineticAabbStrategy<S, Count, Queues...>,
                                 public EventSource<S>,
                                 public TakesPlanChanges<S>,
                                 public TakesGeometryChanges<S> {
 public:
  using KineticAabbStrategy<S, Count, Queues...>::KineticAabbStrategy;

  std::optional<ScheduledEvent<S>> next_event() const override {
    return this->on_forest([](auto& forest) {
      return forest.queue().empty() ? std::optional<ScheduledEvent<S>>()
                                    : described(forest, forest.queue().top());
    });
  }
  void scheduled_events(std::vector<ScheduledEvent<S>>& out) const override {
    this->on_forest([&](auto& forest) { list_events(forest, out); });
  }
  const Topology& tree(std::uint32_t body) const override {
    return this->on_forest([&](auto& forest) -> const Topology& { return forest.tree(body).topology(); });
  }
  std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const override {
    return this->on_forest([&](auto& forest) { return forest.tree(body).realiser(node, side); });
  }
  void watch_bounds(std::vector<BoundNotice<S>>* log) override { this->watch_.log = log; }

 protected:
  bool step(double until, EventDescription<S>& out) override {
    return this->on_forest([&](auto& forest) { return step_forest(forest, this->watch_, until, out); });
  }
  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    this->change_plans(t, changes);
  }
  void follow_geometry(double t, const GeometryChange<S>& change) override {
    this->change_geometry(t, change);
  }
};

}  // namespace kbvh
