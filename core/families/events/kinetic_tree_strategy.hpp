#pragma once
#include <memory>
#include <type_traits>
#include <utility>
#include <variant>

#include "core/contract/audited_volumes.hpp"
#include "core/contract/strategy.hpp"
#include "core/families/events/event_log.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/kinetic_rows.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/families/events/realiser_dops.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/volumes/aligned_box.hpp"
#include "core/topology/leaf_pairs.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {

/// The traversal of a query of kinetic AABB trees.
enum class KineticQuery : std::uint8_t {
  wide_rows,   ///< on the kernels of stored boxes (KineticRows)
  node_pairs,  ///< node by node, as in 2006
};

/// A strategy of kinetic trees (Z&W s.4) alone: queries compute volumes from the realisers. `Forests` are the
/// selectable kinds of KineticForest, of boxes or of k-DOPs. The clock of a forest's queue decides about
/// events; k-DOPs need an EventClock or an AlgebraicClock. Queries of k-DOPs go node by node.
template <class S, class... Forests>
class KineticTreeStrategy : public CountedStrategy<S>, public AnswersProbes<S> {
  /// A forest, and the volumes of its trees at the current frame.
  template <class ForestType>
  struct Kind {
    static constexpr int sides = ForestType::Tree::sides;
    static constexpr bool boxes = sides == 6;
    using Volumes =
        std::conditional_t<boxes, BoxCache<S>, RealiserDops<S, sides, typename ForestType::Clock>>;
    template <class... Arguments>
    explicit Kind(Arguments&&... arguments) : forest(std::forward<Arguments>(arguments)...) {
      for (std::uint32_t body = 0; body < forest.size(); ++body)
        if constexpr (boxes)
          volumes.emplace_back(0);
        else
          volumes.emplace_back(forest.clock(), body, forest.tree(body).topology().size());
    }
    ForestType forest;
    std::vector<Volumes> volumes;  ///< [body]; boxes: sized for queries by node pairs only
  };
  template <class KindType>
  static constexpr bool of_boxes = std::remove_cvref_t<KindType>::boxes;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  /// Uses the forest with index `kind` among Forests.
  KineticTreeStrategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                      std::size_t kind, KineticQuery query)
      : CountedStrategy<S>(scene, motion),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        by_rows_(query == KineticQuery::wide_rows),
        rows_(scene, motion) {
    std::size_t index = 0;
    (void)((index++ == kind &&
            (kind_ = std::make_unique<Kind<Forests>>(scene, motion, std::move(topologies), this->count_,
                                                     BoundObserver<S>{&watch_}),
             true)) ||
           ...);
    on_kind([&](auto& selected) {
      if constexpr (of_boxes<decltype(selected)>) {
        if (by_rows_) rows_.assign(selected.forest, scene);
        for (std::uint32_t body = 0; !by_rows_ && body < scene.body_count(); ++body)
          selected.volumes[body].resize(selected.forest.tree(body).topology().size());
      }
    });
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    on_kind([&](auto& kind) {
      kind.forest.reset(t);
      if constexpr (!of_boxes<decltype(kind)>)
        for (auto& volumes : kind.volumes) volumes.start_over();
    });
    rows_.start_over();
    new_frame(t);
  }

  void advance_to(double t) override {
    on_forest([&](auto& forest) { forest.advance(t); });
    new_frame(t);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    on_kind([&](auto& kind) {
      if constexpr (of_boxes<decltype(kind)>)
        if (by_rows_) {
          std::uint64_t reads = 0;
          status =
              rows_.find(kind.forest, near_bodies_, this->scene_, this->sampled_, budget, out, tests, reads);
          this->count_.add(Counter::positions_fetched, reads);
          return;
        }
      const auto box_of = [&](std::uint32_t body) -> Box<double> {
        if (kind.forest.tree(body).topology().empty()) return {};
        auto&& volumes = view(kind, body);
        volumes.ensure(0);
        return enclosing_box(volumes(0));
      };
      for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
        const BodyPair& pair = this->scene_.pairs()[i];
        if (tests >= budget.box_tests) {
          ++status.pending;
          continue;
        }
        const auto &a = kind.forest.tree(pair.first), &b = kind.forest.tree(pair.second);
        LeafPairs<S> leaves(this->scene_, this->sampled_, pair.first, a.topology(), pair.second, b.topology(),
                            tests, out);
        const auto compare = [&](auto&& volumes_a, auto&& volumes_b) {
          status.pending += traverse(a.topology(), volumes_a, b.topology(), volumes_b, stack_, tests,
                                     rest_of(budget, tests), leaves)
                                .pending;
        };
        if constexpr (!of_boxes<decltype(kind)>)
          if (answered_by_boxes(pair)) {
            compare(BoxesOfDops(kind.volumes[pair.first]), BoxesOfDops(kind.volumes[pair.second]));
            continue;
          }
        compare(view(kind, pair.first), view(kind, pair.second));
      }
    });
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return on_kind([&](auto& kind) {
      const auto& tree = kind.forest.tree(body);
      const auto& volumes = kind.volumes[body];
      std::vector<std::uint32_t> order;
      AuditView view{tree.compacted_topology(order), {}, {}};
      if constexpr (of_boxes<decltype(kind)>) {
        for (const std::uint32_t node : order) {
          // Reports the box that a query has read, if there is one.
          Box<S> room;
          const Box<S>* read = by_rows_                ? rows_.read_box(body, node, room)
                               : volumes.current(node) ? &volumes.volume(node)
                                                       : nullptr;
          view.boxes.push_back(to_double(
              read != nullptr ? *read : box_of_realisers(tree.realisers(node), this->sampled_, body)));
        }
      } else {
        std::vector<Dop<S, std::remove_cvref_t<decltype(kind)>::sides>> dops;
        for (const std::uint32_t node : order) {
          dops.push_back(volumes.current_or_computed(node));
          view.boxes.push_back(enclosing_box(dops.back()));
        }
        view.volumes = std::make_shared<AuditedVolumes<Dop<S, std::remove_cvref_t<decltype(kind)>::sides>>>(
            std::move(dops));
      }
      return view;
    });
  }

  std::size_t bytes() const override {
    return on_kind([&](auto& kind) {
      std::size_t total = kind.forest.bytes();
      for (const auto& volumes : kind.volumes) total += volumes.bytes();
      return total + near_bodies_.bytes() + rows_.bytes() + stack_.capacity() * sizeof(NodePair) +
             probe_order_.bytes() + probe_stack_.capacity() * sizeof(ProbeNode<std::uint32_t>);
    });
  }

 protected:
  /// Follows rays node by node, in the boxes around volumes.
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    on_kind([&](auto& kind) {
      if constexpr (of_boxes<decltype(kind)>)
        for (std::uint32_t body = 0; by_rows_ && body < kind.volumes.size(); ++body)
          kind.volumes[body].resize(kind.forest.tree(body).topology().size());
      const auto box_of = [&](std::uint32_t body) {
        if (kind.forest.tree(body).topology().empty()) return Box<double>{};
        auto&& volumes = view(kind, body);
        volumes.ensure(0);
        return to_double(enclosing_box(volumes(0)));
      };
      const std::uint64_t all = answer_by_body(
          this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
          [&](std::uint32_t body, auto& search, std::uint64_t& tests) {
            const Topology& topology = kind.forest.tree(body).topology();
            auto&& volumes = view(kind, body);
            const TopologyTree tree{topology, [&](std::uint32_t node) {
                                      volumes.ensure(node);
                                      return enclosing_box(volumes(node));
                                    }};
            return follow_probe(tree, search, body, this->scene_.primitives(body),
                                this->sampled_.positions(body), probe_stack_, tests, this->triangle_stats_);
          });
      this->count_.add(Counter::box_tests, all);
    });
  }

  /// Applies changes of plans; for `follow_plans` of derived classes.
  void change_plans(double t, std::span<const PlanChange<S>> changes) {
    on_kind([&](auto& kind) {
      kind.forest.plans_changed(t, changes);
      if constexpr (!of_boxes<decltype(kind)>)
        for (const PlanChange<S>& change : changes) kind.volumes[change.body].include(change.vertex, t);
      else if (by_rows_)
        for (const PlanChange<S>& change : changes) rows_.plans_changed(change.body);
    });
    new_frame(t);  // realisers may differ now
  }

  /// Applies changes of geometry; for `follow_geometry` of derived classes.
  void change_geometry(double t, const GeometryChange<S>& change) {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_kind([&](auto& kind) {
      kind.forest.geometry_changed(t, this->scene_, this->sampled_, changes);
      for (const BodyChange& body_change : changes) {
        auto& volumes = kind.volumes[body_change.body];
        if (!by_rows_) volumes.resize(kind.forest.tree(body_change.body).topology().size());
        if constexpr (!of_boxes<decltype(kind)>)
          for (std::uint32_t v = body_change.first_vertex; v < this->scene_.vertex_count(body_change.body);
               ++v)
            volumes.include(v, t);
        else if (by_rows_)
          rows_.follow(kind.forest, this->scene_, body_change.body);
      }
    });
    new_frame(t);
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
    return on_kind([&](auto& kind) -> decltype(auto) { return work(kind.forest); });
  }
  BoundWatch<S> watch_;

 private:
  template <class Work>
  decltype(auto) on_kind(Work&& work) const {
    return std::visit([&](const auto& kind) -> decltype(auto) { return work(*kind); }, kind_);
  }
  /// Returns the bounds view of a body.
  template <class KindType>
  decltype(auto) view(KindType& kind, std::uint32_t body) const {
    if constexpr (KindType::boxes)
      return RealiserBoxes<S>(kind.forest.tree(body).realisers(0), this->sampled_, body, kind.volumes[body]);
    else
      return (kind.volumes[body]);
  }
  /// Returns whether boxes of primitives decide a pair; a k-DOP around the vertices need not contain them.
  bool answered_by_boxes(const BodyPair& pair) const {
    return this->scene_.primitives(pair.first).kind != PrimitiveKind::polygons ||
           this->scene_.primitives(pair.second).kind != PrimitiveKind::polygons;
  }
  void new_frame(double t) {
    on_kind([&](auto& kind) {
      for (std::uint32_t body = 0; body < kind.volumes.size(); ++body)
        if constexpr (of_boxes<decltype(kind)>)
          kind.volumes[body].new_frame();
        else
          kind.volumes[body].new_frame(t, kind.forest.tree(body).realisers(0));
    });
    rows_.new_frame(motion_);
  }

  std::variant<std::unique_ptr<Kind<Forests>>...> kind_;
  ClipMotion<S> motion_;
  NearBodies near_bodies_;
  bool by_rows_;
  KineticRowsQuery<S> rows_;  ///< empty for queries node by node
  std::vector<NodePair> stack_;
  std::vector<ProbeNode<std::uint32_t>> probe_stack_;
  BodyOrder probe_order_;
  std::uint64_t first_step_ = 0;
};

/// A KineticTreeStrategy on exact clocks (EventClock, AlgebraicClock): plans and geometry may change, and
/// events can be stepped.
template <class S, class... Forests>
class ExactKineticTreeStrategy : public KineticTreeStrategy<S, Forests...>,
                                 public EventSource<S>,
                                 public TakesPlanChanges<S>,
                                 public TakesGeometryChanges<S> {
 public:
  using KineticTreeStrategy<S, Forests...>::KineticTreeStrategy;

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

/// Kinetic AABB trees on one of several queues.
template <class S, class... Queues>
using KineticAabbStrategy = KineticTreeStrategy<S, KineticForest<S, Queues, BoundObserver<S>>...>;
template <class S, class... Queues>
using ExactKineticAabbStrategy = ExactKineticTreeStrategy<S, KineticForest<S, Queues, BoundObserver<S>>...>;

}  // namespace kbvh
