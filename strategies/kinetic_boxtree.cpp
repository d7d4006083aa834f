// The kinetic BoxTree (Z&W 2006, s.6), with the errata of the reproduction: two planes per inner node, all
// other sides inherited, valid at every time, updated at events only. Degenerated parts can be rebuilt.

#include <numeric>
#include <variant>

#include "core/contract/registry.hpp"
#include "core/families/boxtree/boxtree_degradation.hpp"
#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "core/families/events/event_log.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/topology/leaf_pairs.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class KineticBox final : public CountedStrategy<S, Count>,
                         public EventSource<S>,
                         public TakesPlanChanges<S>,
                         public TakesGeometryChanges<S> {
  template <class Queue>
  using Forest = KineticBoxForest<S, Queue, Count, BoundObserver<S>>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  KineticBox(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
             const Params& params)
      : CountedStrategy<S, Count>(scene, motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        leaf_boxes_(params.word("leaf_boxes") == "tight" ? LeafBoxes::tight : LeafBoxes::inherited),
        rebuilds_(params.word("rebuild") != "never"),
        threshold_(params.number("degradation")),
        frames_per_check_(std::uint64_t(params.number("check_every"))) {
    if (rebuilds_) method_ = build_method(params.word("rebuild"));
    for (const Topology& topology : topologies) caches_.emplace_back(topology.size());
    if (rebuilds_) degradations_.resize(topologies.size());
    const BoundObserver<S> observer{&watch_};
    if (params.word("queue") == SegmentHeapQueue<S>::name)
      forest_ = std::make_unique<Forest<SegmentHeapQueue<S>>>(scene, motion, std::move(topologies),
                                                              this->count_, observer);
    else if (params.word("queue") == AvlQueue<S>::name)
      forest_ =
          std::make_unique<Forest<AvlQueue<S>>>(scene, motion, std::move(topologies), this->count_, observer);
    else
      forest_ = std::make_unique<Forest<BinaryHeapQueue<S>>>(scene, motion, std::move(topologies),
                                                             this->count_, observer);
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    on_forest([&](auto& forest) { forest.reset(t); });
    new_frame();
    plans_changed_ = false;
    frames_ = 0;
    for (std::uint32_t body = 0; body < degradations_.size(); ++body)
      on_forest([&](auto& forest) {
        const auto& tree = forest.tree(body);
        const auto boxes = all_boxes(tree, body);
        degradations_[body].start(tree.topology(), order_, boxes);
      });
  }

  void advance_to(double t) override {
    on_forest([&](auto& forest) { forest.advance(t); });
    new_frame();
    if (rebuilds_ && ++frames_ % frames_per_check_ == 0)
      for (std::uint32_t body = 0; body < degradations_.size(); ++body)
        if (this->scene_.moving(body) || plans_changed_) rebuild_degenerate(body);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    BoxTests tests;
    on_forest([&](auto& forest) {
      const auto box_of = [&](std::uint32_t body) -> Box<double> {
        const auto& tree = forest.tree(body);
        if (tree.topology().empty()) return {};
        auto own = boxes(tree, body);
        own.ensure(0);
        return to_double(own(0));
      };
      for (const std::uint32_t i : near_bodies_.find(box_of, tests.made)) {
        const BodyPair& pair = this->scene_.pairs()[i];
        if (tests.made >= budget.box_tests) {
          ++status.pending;
          continue;
        }
        const auto &a = forest.tree(pair.first), &b = forest.tree(pair.second);
        LeafPairs<S, BoxTests> several(this->scene_, this->sampled_, pair.first, a.topology(), pair.second,
                                       b.topology(), tests, out);
        // Inherited boxes of leaves are not tight, so the boxes of primitives are tested, too.
        const auto leaves = [&](std::uint32_t leaf_a, std::uint32_t leaf_b) {
          const TopologyNode na = a.topology().nodes[leaf_a], nb = b.topology().nodes[leaf_b];
          if (leaf_boxes_ == LeafBoxes::inherited && na.count() == 1 && nb.count() == 1) {
            tests.add(Counter::box_tests);
            if (!tight_box(a, na, pair.first).overlaps(tight_box(b, nb, pair.second))) return;
          }
          several(leaf_a, leaf_b);
        };
        status.pending += traverse(a.topology(), boxes(a, pair.first), b.topology(), boxes(b, pair.second),
                                   stack_, tests, rest_of(budget, tests.made), leaves)
                              .pending;
      }
    });
    this->count_.add(Counter::box_tests, tests.made);
    return status;
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    on_forest([&](auto& forest) { forest.plans_changed(t, changes); });
    plans_changed_ = true;
    new_frame();  // realisers may differ now
  }

  void follow_geometry(double t, const GeometryChange<S>& change) override {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_forest([&](auto& forest) {
      forest.geometry_changed(t, this->scene_, this->sampled_, changes);
      for (const BodyChange& own : changes) caches_[own.body].resize(forest.tree(own.body).topology().size());
    });
    plans_changed_ = true;  // resting bodies may move now
    new_frame();
    if (!rebuilds_) return;
    on_forest([&](auto& forest) {
      for (const BodyChange& own : changes) {
        const auto& tree = forest.tree(own.body);
        const auto boxes = all_boxes(tree, own.body);
        degradations_[own.body].edited(tree.topology(), order_, boxes);
      }
    });
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
  const Topology& tree(std::uint32_t body) const override {
    return on_forest([&](auto& forest) -> const Topology& { return forest.tree(body).topology(); });
  }
  std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const override {
    return on_forest([&](auto& forest) { return forest.tree(body).realiser_or_none(node, side); });
  }
  void watch_bounds(std::vector<BoundNotice<S>>* log) override { watch_.log = log; }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return on_forest([&](auto& forest) {
      const auto& tree = forest.tree(body);
      std::vector<std::uint32_t> order;
      AuditView view{tree.compacted_topology(order), {}, {}};
      BoxCache<S> cache =
          caches_[body];  // counts the boxes that a query read; the others are derived from them
      InheritedBoxes<S, std::remove_cvref_t<decltype(tree)>> boxes(tree, this->sampled_, body, cache,
                                                                   leaf_boxes_);
      for (const std::uint32_t node : order) {
        boxes.ensure(node);
        view.boxes.push_back(to_double(boxes(node)));
      }
      return view;
    });
  }

  std::size_t bytes() const override {
    std::size_t total = on_forest([](auto& forest) { return forest.bytes(); });
    total += near_bodies_.bytes();
    for (const auto& cache : caches_) total += cache.bytes();
    for (const auto& degradation : degradations_) total += degradation.bytes();
    return total;
  }

 protected:
  bool step(double until, EventDescription<S>& out) override {
    return on_forest([&](auto& forest) { return step_forest(forest, watch_, until, out); });
  }
  void counts_cleared() override {
    first_step_ = on_forest([](auto& forest) { return forest.queue().steps(); });
  }
  void add_counts(Counters& table) const override {
    table[Counter::queue_steps] =
        on_forest([](auto& forest) { return forest.queue().steps(); }) - first_step_;
  }

 private:
  template <class Work>
  decltype(auto) on_forest(Work&& work) const {
    return std::visit([&](const auto& forest) -> decltype(auto) { return work(*forest); }, forest_);
  }
  void new_frame() {
    for (auto& cache : caches_) cache.new_frame();
  }
  template <class Tree>
  InheritedBoxes<S, Tree> boxes(const Tree& tree, std::uint32_t body) {
    return {tree, this->sampled_, body, caches_[body], leaf_boxes_};
  }
  /// Returns the boxes of all nodes; afterwards `order_` lists the nodes, parents before children.
  template <class Tree>
  InheritedBoxes<S, Tree> all_boxes(const Tree& tree, std::uint32_t body) {
    if (tree.edited()) {
      tree.compacted_topology(order_);
    } else {
      order_.resize(tree.topology().size());
      std::iota(order_.begin(), order_.end(), 0u);
    }
    auto all = boxes(tree, body);
    for (const std::uint32_t node : order_) all.ensure(node);
    return all;
  }
  /// Returns the box of the only primitive of a leaf.
  template <class Tree>
  LaneBox<S> tight_box(const Tree& tree, TopologyNode leaf, std::uint32_t body) const {
    const auto vertices = this->scene_.primitives(body)[tree.topology().primitives[leaf.first()]];
    this->sampled_.fetch(body, vertices);
    return LaneBox<S>::of(vertices, this->sampled_.positions(body));
  }

  void rebuild_degenerate(std::uint32_t body) {
    on_forest([&](auto& forest) {
      auto& tree = forest.tree(body);
      auto all = all_boxes(tree, body);
      this->count_.add(Counter::nodes_visited, tree.topology().size());
      const auto& nodes = degradations_[body].beyond(threshold_, tree.topology(), order_, all);
      if (nodes.empty()) return;
      for (const std::uint32_t node : nodes) tree.rebuild_below(node, all(node), this->sampled_, method_);
      caches_[body].new_frame();
      const auto rebuilt = all_boxes(tree, body);
      degradations_[body].rebuilt(tree.topology(), order_, rebuilt);
      this->count_.add(Counter::nodes_visited, tree.topology().size());
    });
  }

  BoundWatch<S> watch_;
  std::variant<std::unique_ptr<Forest<SegmentHeapQueue<S>>>, std::unique_ptr<Forest<AvlQueue<S>>>,
               std::unique_ptr<Forest<BinaryHeapQueue<S>>>>
      forest_;
  NearBodies near_bodies_;
  std::vector<BoxCache<S>> caches_;
  std::vector<NodePair> stack_;
  std::vector<std::uint32_t> order_;
  std::uint64_t first_step_ = 0;
  LeafBoxes leaf_boxes_;
  bool rebuilds_;
  bool plans_changed_ = false;
  BuildMethod method_ = BuildMethod::median;
  double threshold_;
  std::uint64_t frames_per_check_, frames_ = 0;
  std::vector<BoxTreeDegradation> degradations_;  ///< [body]; none if nothing is rebuilt
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
      .topology = {.widths = {2}, .preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
      .parameters =
          {{"queue",
            "avl",
            {"segment_heap", "avl", "binary_heap"},
            "event queue: lists by segment and a heap of what comes next, the paper's AVL tree, or "
            "an indexed binary heap"},
           {"leaf_boxes",
            "inherited",
            {"inherited", "tight"},
            "boxes of leaves in queries: inherited like all others, or made of the leaf's vertices"},
           {"rebuild",
            "never",
            {"never", "median", "sah"},
            "rebuilds the inner nodes of subtrees that have degenerated: how; never is the paper's"},
           {"degradation",
            "1.5",
            {},
            "a subtree is rebuilt when its summed box area over its own box's exceeds this many times "
            "what it was when built",
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
