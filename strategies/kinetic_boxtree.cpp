// The kinetic BoxTree (Z&W 2006, s.6), with the errata of the reproduction. An inner node has at most two
// planes; all other sides are inherited. The tree is valid at every time and updated only at events.
// Degenerated parts can be rebuilt. Queries compute boxes on demand, many at once (BoxTreeRows). Vertices may
// move on curves of degree 2 or 3: certificates then compare polynomials.
//
// As in the paper, the search for a certificate may read all nodes. It does so where no node owns a side, as
// in a tree of equal boxes: inserting n of them takes quadratically many steps.

#include <memory>
#include <numeric>
#include <variant>

#include "core/contract/registry.hpp"
#include "core/families/boxtree/boxtree_degradation.hpp"
#include "core/families/boxtree/boxtree_rows.hpp"
#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "core/families/events/algebraic_clock.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/event_log.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_probes.hpp"

namespace kbvh {
namespace {

BoxTreeConstruction construction(const Params& params, LeafBoxes leaf_boxes, std::uint32_t wide) {
  BoxTreeConstruction made;
  made.planes = params.word("planes") == "clip" ? PlaneChoice::clip : PlaneChoice::start;
  made.candidates = params.word("candidates") == "listed" ? Candidates::listed : Candidates::searched;
  // If leaf boxes are computed from vertices, no query reads a side below a wide node of leaves.
  if (made.planes == PlaneChoice::clip && leaf_boxes == LeafBoxes::tight) made.bare_leaves = wide;
  return made;
}

template <class S>
class KineticBox final : public CountedStrategy<S>,
                         public AnswersProbes<S>,
                         public EventSource<S>,
                         public TakesPlanChanges<S>,
                         public TakesGeometryChanges<S> {
  template <class Clock>
  using Forest = KineticBoxForest<S, AnyEventQueue<Clock>, BoundObserver<S>>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  KineticBox(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
             const Params& params)
      : CountedStrategy<S>(scene, motion),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        leaf_boxes_(params.word("leaf_boxes") == "tight" ? LeafBoxes::tight : LeafBoxes::inherited),
        rows_(scene.body_count()),
        rebuilds_(params.word("rebuild") != "never"),
        threshold_(params.number("degradation")),
        frames_per_check_(std::uint64_t(params.number("check_every"))) {
    if (any_on_curves(scene, motion))
      make_forest<AlgebraicClock<S>>(scene, std::move(topologies));
    else
      make_forest<EventClock<S>>(scene, std::move(topologies));
    if (rebuilds_) {
      method_ = build_method(params.word("rebuild"));
      for (std::uint32_t body = 0; body < rows_.size(); ++body)
        caches_.emplace_back(tree_of(body).topology().size());
      degradations_.resize(rows_.size());
    }
    const BoxTreeConstruction made = construction(params, leaf_boxes_, BoxTreeRows<S>::width);
    on_forest([&](auto& forest) {
      forest.choose_queue(params.word("queue"));
      for (std::uint32_t body = 0; body < forest.size(); ++body) forest.tree(body).construct_as(made);
    });
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    on_forest([&](auto& forest) { forest.reset(t); });
    for (std::uint32_t body = 0; body < rows_.size(); ++body) {
      follow_tree(body);
      rows_[body].start_over();
      changed_now(body);
    }
    plans_changed_ = false;
    frames_ = 0;
    for (std::uint32_t body = 0; body < degradations_.size(); ++body) {
      const BoxTreeBounds& tree = tree_of(body);
      const auto boxes = all_boxes(tree, body);
      degradations_[body].start(tree.topology(), order_, boxes);
    }
  }

  void advance_to(double t) override {
    on_forest([&](auto& forest) { forest.advance(t); });
    for (std::uint32_t body = 0; body < rows_.size(); ++body) rows_[body].new_frame(motion_, body);
    for (auto& cache : caches_) cache.new_frame();
    if (rebuilds_ && ++frames_ % frames_per_check_ == 0)
      for (std::uint32_t body = 0; body < degradations_.size(); ++body)
        if (this->scene_.moving(body) || plans_changed_) rebuild_degenerate(body);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    for (std::uint32_t body = 0; body < rows_.size(); ++body)
      this->count_.add(Counter::positions_fetched, rows_[body].make_visited(tree_of(body), motion_, body));
    const auto side_of = [&](std::uint32_t body) -> WideSide<S> {
      return {.hierarchy = &rows_[body].hierarchy(), .body = body, .stale = rows_[body].stale()};
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) { make_wanted(body, node); };
    const QueryStatus status =
        query_lazily(query_, near_bodies_, this->scene_.pairs(), budget, side_of, make, out, tests);
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    for (std::uint32_t body = 0; body < rows_.size(); ++body)
      this->count_.add(Counter::positions_fetched, rows_[body].make_visited(tree_of(body), motion_, body));
    probes_.answer(
        probes,
        [&](std::uint32_t body) -> WideSide<S> {
          return {.hierarchy = &rows_[body].hierarchy(), .body = body, .stale = rows_[body].stale()};
        },
        [&](std::uint32_t body, std::uint32_t node) { make_wanted(body, node); }, this->triangle_stats_,
        tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    on_forest([&](auto& forest) { forest.plans_changed(t, changes); });
    plans_changed_ = true;
    for (const PlanChange<S>& change : changes) rows_[change.body].plans_changed();
    for (std::uint32_t body = 0; body < rows_.size(); ++body) changed_now(body);  // realisers may differ now
  }

  void follow_geometry(double t, const GeometryChange<S>& change) override {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_forest([&](auto& forest) { forest.geometry_changed(t, this->scene_, this->sampled_, changes); });
    plans_changed_ = true;  // bodies that were at rest may move
    for (const BodyChange& own : changes) {
      follow_tree(own.body);
      changed_now(own.body);
    }
    if (!rebuilds_) return;
    for (const BodyChange& own : changes) {
      const BoxTreeBounds& tree = tree_of(own.body);
      caches_[own.body].resize(tree.topology().size());
      const auto boxes = all_boxes(tree, own.body);
      degradations_[own.body].edited(tree.topology(), order_, boxes);
    }
  }

  std::optional<ScheduledEvent<S>> next_event() const override {
    return on_forest([](auto& forest) {
      return forest.queue().empty() ? std::optional<ScheduledEvent<S>>()
                                    : described(forest, forest.queue().top());
    });
  }
  void scheduled_events(std::vector<ScheduledEvent<S>>& out) const override {
    on_forest([&](auto& forest) { list_events(forest, out); });
  }
  const Topology& tree(std::uint32_t body) const override { return tree_of(body).topology(); }
  std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const override {
    return tree_of(body).realiser_or_none(node, side);
  }
  void watch_bounds(std::vector<BoundNotice<S>>* log) override { watch_.log = log; }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const BoxTreeBounds& tree = tree_of(body);
    std::vector<std::uint32_t> order;
    AuditView view{tree.compacted_topology(order), {}, {}};
    BoxCache<S> cache(tree.topology().size());
    InheritedBoxes<S, BoxTreeBounds> boxes(tree, this->sampled_, body, cache, leaf_boxes_);
    for (const std::uint32_t node : order) {
      boxes.ensure(node);
      // Reports the box that a query has read, if there is one.
      Box<S> room;
      const Box<S>* read = rows_[body].read_box(node, room);
      view.boxes.push_back(to_double(read != nullptr ? *read : boxes(node)));
    }
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = on_forest([](auto& forest) { return forest.bytes(); });
    total += near_bodies_.bytes() + query_.bytes() + probes_.bytes();
    for (const auto& rows : rows_) total += rows.bytes();
    for (const auto& cache : caches_) total += cache.bytes();
    for (const auto& degradation : degradations_) total += degradation.bytes();
    return total;
  }

 protected:
  bool step(double until, EventDescription<S>& out) override {
    return on_forest([&](auto& forest) { return step_forest(forest, watch_, until, out); });
  }
  void counts_cleared() override {
    on_forest([&](auto& forest) {
      first_step_ = forest.queue().steps();
      for (std::uint32_t body = 0; body < forest.size(); ++body) forest.tree(body).search_cost().forget();
    });
  }
  void add_counts(Counters& table) const override {
    SearchCost cost;
    on_forest([&](const auto& forest) {
      table[Counter::queue_steps] = forest.queue().steps() - first_step_;
      for (std::uint32_t body = 0; body < forest.size(); ++body) cost.add(forest.tree(body).search_cost());
    });
    table.add("certificate_searches", cost.searches);
    table.add("nodes_searched", cost.nodes);
    table.add("most_nodes_searched", cost.most_nodes);
  }

 private:
  template <class Clock>
  void make_forest(const SceneView<S>& scene, Topologies topologies) {
    forest_ = std::make_unique<Forest<Clock>>(scene, motion_, std::move(topologies), this->count_,
                                              BoundObserver<S>{&watch_});
  }
  template <class Work>
  decltype(auto) on_forest(Work&& work) const {
    return std::visit([&](const auto& forest) -> decltype(auto) { return work(*forest); }, forest_);
  }
  const BoxTreeBounds& tree_of(std::uint32_t body) const {
    return on_forest([&](const auto& forest) -> const BoxTreeBounds& { return forest.tree(body); });
  }
  /// Lays out a body's rows again if its tree has changed.
  void follow_tree(std::uint32_t body) {
    rows_[body].follow(tree_of(body), this->scene_.primitives(body), leaf_boxes_);
    rows_[body].plans_changed();
  }
  /// Marks the boxes of a body as out of date.
  void changed_now(std::uint32_t body) {
    rows_[body].new_frame(motion_, body);
    if (rebuilds_) caches_[body].new_frame();
  }
  void make_wanted(std::uint32_t body, std::uint32_t node) {
    this->count_.add(Counter::positions_fetched, rows_[body].make_wanted(node, tree_of(body), motion_, body));
  }

  /// Computes the boxes of all nodes. Stores the nodes in `order_`, parents before children.
  InheritedBoxes<S, BoxTreeBounds> all_boxes(const BoxTreeBounds& tree, std::uint32_t body) {
    if (tree.edited()) {
      tree.compacted_topology(order_);
    } else {
      order_.resize(tree.topology().size());
      std::iota(order_.begin(), order_.end(), 0u);
    }
    InheritedBoxes<S, BoxTreeBounds> all(tree, this->sampled_, body, caches_[body], leaf_boxes_);
    for (const std::uint32_t node : order_) all.ensure(node);
    return all;
  }

  void rebuild_degenerate(std::uint32_t body) {
    const BoxTreeBounds& tree = tree_of(body);
    auto all = all_boxes(tree, body);
    this->count_.add(Counter::nodes_visited, tree.topology().size());
    const auto& nodes = degradations_[body].beyond(threshold_, tree.topology(), order_, all);
    if (nodes.empty()) return;
    on_forest([&](auto& forest) {
      for (const std::uint32_t node : nodes)
        forest.tree(body).rebuild_below(node, all(node), this->sampled_, method_);
    });
    follow_tree(body);
    changed_now(body);
    const auto rebuilt = all_boxes(tree, body);
    degradations_[body].rebuilt(tree.topology(), order_, rebuilt);
    this->count_.add(Counter::nodes_visited, tree.topology().size());
  }

  BoundWatch<S> watch_;
  std::variant<std::unique_ptr<Forest<EventClock<S>>>, std::unique_ptr<Forest<AlgebraicClock<S>>>> forest_;
  ClipMotion<S> motion_;
  NearBodies near_bodies_;
  LeafBoxes leaf_boxes_;
  std::vector<BoxTreeRows<S>> rows_;  ///< [body]
  WideQuery<S> query_{this->scene_, this->sampled_};
  WideProbes<S> probes_{this->scene_, this->sampled_};
  std::uint64_t first_step_ = 0;
  std::vector<std::uint32_t> order_;
  bool rebuilds_;
  bool plans_changed_ = false;
  BuildMethod method_ = BuildMethod::median;
  double threshold_;
  std::uint64_t frames_per_check_, frames_ = 0;
  // [body]; empty without rebuilds
  std::vector<BoxCache<S>> caches_;
  std::vector<BoxTreeDegradation> degradations_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_boxtree) {
  using namespace kbvh;
  return {make_entry<KineticBox>({
      .id = "kinetic_boxtree",
      .title = "kinetic BoxTree",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.6; Zachmann 1995",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .declares = {.continuous = true,
                   .restructures = true /* with rebuild=median or sah */,
                   .time_budget = true,
                   .curves = true},
      .topology = {.widths = {2}, .preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 16}},
      .parameters =
          {queue_parameter(),
           {"planes",
            "clip",
            {"clip", "start"},
            "sides that nodes own: each the one that is expected to save most overlaps over the clip, or the "
            "paper's, two on one axis for the least area at the start"},
           {"candidates",
            "listed",
            {"listed", "searched"},
            "candidates of a certificate: listed at the start, or searched for each time as in the paper"},
           {"leaf_boxes",
            "tight",
            {"tight", "inherited"},
            "boxes of leaves in queries: made of the leaf's vertices, or inherited like all others"},
           {"rebuild",
            "never",
            {"never", "median", "sah"},
            "how the inner nodes of degenerated subtrees are rebuilt; never: as in the paper"},
           {"degradation",
            "1.5",
            {},
            "a subtree is rebuilt when its summed box area over its own box's exceeds this many times "
            "the same ratio when it was built",
            1},
           {"check_every",
            "10",
            {},
            "frames from one check for degradation to the next",
            1,
            1e15,
            Numbers::whole}},
  })};
}
