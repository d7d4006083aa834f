// The kinetic BoxTree (Z&W 2006, s.6), with the errata of the reproduction. An inner node has at most two
// planes; all other sides are inherited. The tree is valid at every time and updated only at events.
// Degenerated parts can be rebuilt. Queries compute boxes on demand, many at once (BoxTreeRows).
//
// As in the paper, the search for a certificate may read all nodes. It does so where no node owns a side, as
// in a tree of equal boxes: inserting n of them takes quadratically many steps.

#include <numeric>

#include "core/contract/registry.hpp"
#include "core/families/boxtree/boxtree_degradation.hpp"
#include "core/families/boxtree/boxtree_rows.hpp"
#include "core/families/boxtree/kinetic_boxtree.hpp"
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
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  KineticBox(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
             const Params& params)
      : CountedStrategy<S>(scene, motion),
        forest_(scene, motion, std::move(topologies), this->count_, BoundObserver<S>{&watch_}),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        leaf_boxes_(params.word("leaf_boxes") == "tight" ? LeafBoxes::tight : LeafBoxes::inherited),
        rows_(scene.body_count()),
        rebuilds_(params.word("rebuild") != "never"),
        threshold_(params.number("degradation")),
        frames_per_check_(std::uint64_t(params.number("check_every"))) {
    if (rebuilds_) {
      method_ = build_method(params.word("rebuild"));
      for (std::uint32_t body = 0; body < forest_.size(); ++body)
        caches_.emplace_back(forest_.tree(body).topology().size());
      degradations_.resize(forest_.size());
    }
    const BoxTreeConstruction made = construction(params, leaf_boxes_, BoxTreeRows<S>::width);
    forest_.choose_queue(params.word("queue"));
    for (std::uint32_t body = 0; body < forest_.size(); ++body) forest_.tree(body).construct_as(made);
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    forest_.reset(t);
    for (std::uint32_t body = 0; body < rows_.size(); ++body) {
      follow_tree(body);
      rows_[body].start_over();
      changed_now(body);
    }
    plans_changed_ = false;
    frames_ = 0;
    for (std::uint32_t body = 0; body < degradations_.size(); ++body) {
      const auto& tree = forest_.tree(body);
      const auto boxes = all_boxes(tree, body);
      degradations_[body].start(tree.topology(), order_, boxes);
    }
  }

  void advance_to(double t) override {
    forest_.advance(t);
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
    forest_.plans_changed(t, changes);
    plans_changed_ = true;
    for (const PlanChange<S>& change : changes) rows_[change.body].plans_changed();
    for (std::uint32_t body = 0; body < rows_.size(); ++body) changed_now(body);  // realisers may differ now
  }

  void follow_geometry(double t, const GeometryChange<S>& change) override {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    forest_.geometry_changed(t, this->scene_, this->sampled_, changes);
    plans_changed_ = true;  // bodies that were at rest may move
    for (const BodyChange& own : changes) {
      follow_tree(own.body);
      changed_now(own.body);
    }
    if (!rebuilds_) return;
    for (const BodyChange& own : changes) {
      const auto& tree = forest_.tree(own.body);
      caches_[own.body].resize(tree.topology().size());
      const auto boxes = all_boxes(tree, own.body);
      degradations_[own.body].edited(tree.topology(), order_, boxes);
    }
  }

  std::optional<ScheduledEvent<S>> next_event() const override {
    return forest_.queue().empty() ? std::optional<ScheduledEvent<S>>()
                                   : described(forest_, forest_.queue().top());
  }
  void scheduled_events(std::vector<ScheduledEvent<S>>& out) const override { list_events(forest_, out); }
  const Topology& tree(std::uint32_t body) const override { return forest_.tree(body).topology(); }
  std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const override {
    return forest_.tree(body).realiser_or_none(node, side);
  }
  void watch_bounds(std::vector<BoundNotice<S>>* log) override { watch_.log = log; }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const auto& tree = forest_.tree(body);
    std::vector<std::uint32_t> order;
    AuditView view{tree.compacted_topology(order), {}, {}};
    BoxCache<S> cache(tree.topology().size());
    InheritedBoxes<S, std::remove_cvref_t<decltype(tree)>> boxes(tree, this->sampled_, body, cache,
                                                                 leaf_boxes_);
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
    std::size_t total = forest_.bytes();
    total += near_bodies_.bytes() + query_.bytes() + probes_.bytes();
    for (const auto& rows : rows_) total += rows.bytes();
    for (const auto& cache : caches_) total += cache.bytes();
    for (const auto& degradation : degradations_) total += degradation.bytes();
    return total;
  }

 protected:
  bool step(double until, EventDescription<S>& out) override {
    return step_forest(forest_, watch_, until, out);
  }
  void counts_cleared() override {
    first_step_ = forest_.queue().steps();
    for (std::uint32_t body = 0; body < forest_.size(); ++body) forest_.tree(body).search_cost().forget();
  }
  void add_counts(Counters& table) const override {
    table[Counter::queue_steps] = forest_.queue().steps() - first_step_;
    SearchCost cost;
    for (std::uint32_t body = 0; body < forest_.size(); ++body) cost.add(forest_.tree(body).search_cost());
    table.add("certificate_searches", cost.searches);
    table.add("nodes_searched", cost.nodes);
    table.add("most_nodes_searched", cost.most_nodes);
  }

 private:
  const BoxTreeBounds& tree_of(std::uint32_t body) const { return forest_.tree(body); }
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
  template <class Tree>
  InheritedBoxes<S, Tree> all_boxes(const Tree& tree, std::uint32_t body) {
    if (tree.edited()) {
      tree.compacted_topology(order_);
    } else {
      order_.resize(tree.topology().size());
      std::iota(order_.begin(), order_.end(), 0u);
    }
    InheritedBoxes<S, Tree> all(tree, this->sampled_, body, caches_[body], leaf_boxes_);
    for (const std::uint32_t node : order_) all.ensure(node);
    return all;
  }

  void rebuild_degenerate(std::uint32_t body) {
    auto& tree = forest_.tree(body);
    auto all = all_boxes(tree, body);
    this->count_.add(Counter::nodes_visited, tree.topology().size());
    const auto& nodes = degradations_[body].beyond(threshold_, tree.topology(), order_, all);
    if (nodes.empty()) return;
    for (const std::uint32_t node : nodes) tree.rebuild_below(node, all(node), this->sampled_, method_);
    follow_tree(body);
    changed_now(body);
    const auto rebuilt = all_boxes(tree, body);
    degradations_[body].rebuilt(tree.topology(), order_, rebuilt);
    this->count_.add(Counter::nodes_visited, tree.topology().size());
  }

  BoundWatch<S> watch_;
  KineticBoxForest<S, AnyQueue<S>, BoundObserver<S>> forest_;
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
                   .time_budget = true},
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
