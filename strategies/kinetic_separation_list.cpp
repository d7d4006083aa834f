// Kinetic incremental collision detection (Z&W 2006, s.7): one kinetic AABB tree per body, and the separation
// list of the pairs of their boxes, all updated at events. A query reads the overlapping leaves and traverses
// no tree. Vertices may move on curves of degree 2 or 3: the trees' certificates then compare polynomials,
// and the list compares boxes that are linear between keyframes and contain the curves.

#include <algorithm>
#include <memory>
#include <optional>
#include <variant>

#include "core/contract/registry.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_rows.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/families/separation/kinetic_collision.hpp"
#include "core/families/wide/swept_hierarchies.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/leaf_pairs.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {
namespace {

template <class S>
class KineticSeparationList final : public CountedStrategy<S>,
                                    public AnswersChanges<S>,
                                    public AnswersSelfPairs,
                                    public AnswersSpans<S>,
                                    public AnswersSweeps<S>,
                                    public AnswersProbes<S>,
                                    public EventSource<S>,
                                    public TakesPlanChanges<S>,
                                    public TakesGeometryChanges<S> {
  template <class Clock>
  using Collision = KineticCollision<S, AnyEventQueue, Clock>;
  using List = SeparationList<S, AnyEventQueue>;

 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  KineticSeparationList(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                        const Params& params)
      : CountedStrategy<S>(scene, motion),
        by_rows_(std::any_of(topologies.begin(), topologies.end(),
                             [](const Topology& topology) { return topology.leaf_size > 1; })),
        on_curves_(any_on_curves(scene, motion)),
        motion_(motion),
        notes_changes_(!by_rows_ && !has_self_pairs(scene.pairs())),
        rows_(scene, motion) {
    if (on_curves_)
      make_collision<AlgebraicClock<S>>(scene, std::move(topologies), params);
    else
      make_collision<EventClock<S>>(scene, std::move(topologies), params);
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      vertices_ += motion.plans(body).vertex_count();
    if (by_rows_) on_forest([&](auto& forest) { rows_.assign(forest, scene); });
  }

  void reset_to(double t) override {
    many_candidates_ = false;
    on_collision([&](auto& collision) { collision.reset(t); });
    rows_.start_over();
    rows_.new_frame(motion_);
  }

  void advance_to(double t) override {
    play_to(t);
    rows_.new_frame(motion_);
  }

  /// Returns whether the last frame had many candidates. These then use most of all vertices, so evaluating
  /// all positions is cheaper than fetching them one by one.
  bool wants_all_positions() const override { return many_candidates_; }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    const std::size_t before = out.size();
    std::uint64_t tests = 0, reads = 0;
    for_body_pairs([&](std::uint32_t i, const BodyPair& pair) {
      if (by_rows_) {
        const auto for_leaves = [&](const auto& add) {
          for (const auto& leaf : list().leaf_pairs(i)) add(leaf.a, leaf.b);
          for_leaves_with_themselves(pair, [&](std::uint32_t leaf) { add(leaf, leaf); });
        };
        on_forest([&](auto& forest) {
          rows_.find_in_leaves(forest, pair, for_leaves, this->sampled_, out, tests, reads);
        });
        return;
      }
      const auto primitives = list().primitive_pairs(i);
      out.insert(out.end(), primitives.begin(), primitives.end());
      if (!primitives.empty()) return;
      LeafPairs<S> leaves(this->scene_, this->sampled_, pair.first, tree(pair.first), pair.second,
                          tree(pair.second), tests, out);
      for (const auto& leaf : list().leaf_pairs(i)) leaves(leaf.a, leaf.b);
      for_leaves_with_themselves(pair, [&](std::uint32_t leaf) { leaves(leaf, leaf); });
    });
    this->count_.add(Counter::box_tests, tests);
    this->count_.add(Counter::positions_fetched, reads);
    many_candidates_ = 4 * (out.size() - before) > vertices_;
    return {};
  }

  /// Candidates that are the list's leaves begin and end at its events. All other candidates, and pairs of
  /// triangles, are tested at every frame; compared with these tests, a comparison costs little.
  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    if (!notes_changes_ || answer != Answer::candidates)
      return this->compare_answers(t, answer, begun, ended);
    LeafOverlaps& overlaps = list().overlaps();
    if (overlaps.is_noting()) return overlaps.take_changes(begun, ended);
    find_candidates(t, begun, {});
    overlaps.start_noting();
  }

  /// Follows rays node by node, in boxes that are computed from their realisers.
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    while (ray_boxes_.size() < this->scene_.body_count()) ray_boxes_.emplace_back(0);
    for (std::uint32_t body = 0; body < ray_boxes_.size(); ++body) {
      ray_boxes_[body].resize(tree(body).size());
      ray_boxes_[body].new_frame();
    }
    const auto boxes_of = [&](std::uint32_t body) {
      return RealiserBoxes<S>(realisers(body, 0), this->sampled_, body, ray_boxes_[body]);
    };
    const auto box_of = [&](std::uint32_t body) {
      if (tree(body).empty()) return Box<S>{};
      auto boxes = boxes_of(body);
      boxes.ensure(0);
      return Box<S>(boxes(0));
    };
    const std::uint64_t all = answer_by_body(
        this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
        [&](std::uint32_t body, auto& search, std::uint64_t& tests) {
          const Topology& topology = tree(body);
          auto boxes = boxes_of(body);
          const TopologyTree followed{topology, [&](std::uint32_t node) {
                                        boxes.ensure(node);
                                        return boxes(node);
                                      }};
          return follow_probe(followed, search, body, this->scene_.primitives(body),
                              this->sampled_.positions(body), probe_stack_, tests, this->triangle_stats_);
        });
    this->count_.add(Counter::box_tests, all);
  }

  void find_spans(double t0, double t1, SpanBuffer& out) override {
    List& list = this->list();
    list.start_spans(t0);
    play_to(t1);
    for (const auto& ended : list.stop_spans())
      append_spans(ended.bodies, ended.leaf, t0, std::min(ended.until, t1), out);
    for_body_pairs([&](std::uint32_t i, const BodyPair& pair) {
      using Leaf = std::remove_cvref_t<decltype(list.leaf_pairs(i)[0])>;
      for (const auto& leaf : list.leaf_pairs(i)) append_spans(i, leaf, t0, t1, out);
      for_leaves_with_themselves(pair, [&](std::uint32_t leaf) {
        append_spans(i, Leaf{leaf, leaf, 0, t0}, t0, t1, out);
      });
    });
  }

  /// Appends the primitive pairs of all leaves that overlap at some time in [t0, t1]. Leaves that overlap
  /// twice are reported once.
  void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) override {
    if (on_curves_) return find_swept_from_frames(t1, before, out);
    List& list = this->list();
    list.start_spans(t0);
    play_to(t1);
    swept_leaves_.clear();
    for (const auto& ended : list.stop_spans())
      swept_leaves_.push_back({ended.bodies, ended.leaf.a, ended.leaf.b});
    for_body_pairs([&](std::uint32_t i, const BodyPair& pair) {
      for (const auto& leaf : list.leaf_pairs(i)) swept_leaves_.push_back({i, leaf.a, leaf.b});
      for_leaves_with_themselves(pair, [&](std::uint32_t leaf) { swept_leaves_.push_back({i, leaf, leaf}); });
    });
    std::sort(swept_leaves_.begin(), swept_leaves_.end());
    swept_leaves_.erase(std::unique(swept_leaves_.begin(), swept_leaves_.end()), swept_leaves_.end());
    for (const SweptLeaves& swept : swept_leaves_)
      append_leaves(list.body_pair(swept.bodies), swept.a, swept.b, out);
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    on_collision([&](auto& collision) { collision.plans_changed(t, changes); });
    if (!by_rows_) return;
    for (const PlanChange<S>& change : changes) rows_.plans_changed(change.body);
    rows_.new_frame(motion_);  // realisers may differ now
  }

  void follow_geometry(double t, const GeometryChange<S>& change) override {
    const std::vector<BodyChange> changes = body_changes(this->scene_, change);
    on_collision(
        [&](auto& collision) { collision.geometry_changed(t, this->scene_, this->sampled_, changes); });
    swept_.reset();
    if (!by_rows_) return;
    for (const BodyChange& changed : changes)
      on_forest([&](auto& forest) { rows_.follow(forest, this->scene_, changed.body); });
    rows_.new_frame(motion_);
  }

  std::optional<ScheduledEvent<S>> next_event() const override {
    return on_collision([](auto& collision) { return collision.next_event(); });
  }
  void scheduled_events(std::vector<ScheduledEvent<S>>& out) const override {
    on_collision([&](auto& collision) { collision.scheduled_events(out); });
  }
  const Topology& tree(std::uint32_t body) const override {
    return on_forest([&](auto& forest) -> const Topology& { return forest.tree(body).topology(); });
  }
  std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const override {
    return on_forest([&](auto& forest) { return forest.tree(body).realiser(node, side); });
  }
  void watch_bounds(std::vector<BoundNotice<S>>* log) override {
    on_collision([&](auto& collision) { collision.watch().log = log; });
  }
  void watched_pairs(std::vector<WatchedPair>& out) const override {
    out.clear();
    const List& list = this->list();
    for (const BoxPair& pair : list.pairs()) {
      if (!pair.used) continue;
      const BodyPair& bodies = list.body_pair(pair.bodies);
      out.push_back({.body = bodies.first,
                     .node = pair.a,
                     .other_body = bodies.second,
                     .other_node = pair.b,
                     .overlapping = pair.overlapping,
                     .listed = pair.children == BoxPair::none});
    }
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    std::vector<std::uint32_t> order;
    AuditView view{
        on_forest([&](auto& forest) { return forest.tree(body).compacted_topology(order); }), {}, {}};
    for (const std::uint32_t node : order) {
      // Reports the box that a query has read, if there is one.
      Box<S> room;
      const Box<S>* read = by_rows_ ? rows_.read_box(body, node, room) : nullptr;
      view.boxes.push_back(
          to_double(read != nullptr ? *read : box_of_realisers(realisers(body, node), this->sampled_, body)));
    }
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = rows_.bytes() + open_.capacity() * sizeof(std::uint32_t) + probe_order_.bytes() +
                        probe_stack_.capacity() * sizeof(ProbeNode<std::uint32_t>);
    for (const auto& boxes : ray_boxes_) total += boxes.bytes();
    if (swept_) total += swept_->bytes();
    return total + query_.bytes() + on_collision([](auto& collision) { return collision.bytes(); });
  }

 protected:
  bool step(double until, EventDescription<S>& out) override {
    return on_collision([&](auto& collision) { return collision.step(until, out); });
  }
  void counts_cleared() override {
    first_step_ = queue_steps();
    this->count_.peak(Counter::list_peak, list().size());
  }
  void add_counts(Counters& table) const override {
    table[Counter::queue_steps] = queue_steps() - first_step_;
  }

 private:
  /// Two leaves, and the number of their body pair in the list.
  struct SweptLeaves {
    std::uint32_t bodies, a, b;
    auto operator<=>(const SweptLeaves&) const = default;
  };

  template <class Clock>
  void make_collision(const SceneView<S>& scene, Topologies topologies, const Params& params) {
    collision_ =
        std::make_unique<Collision<Clock>>(scene, motion_, std::move(topologies), this->count_,
                                           std::stoi(params.word("look_ahead")), params.word("queue"));
  }
  template <class Work>
  decltype(auto) on_collision(Work&& work) const {
    return std::visit([&](const auto& collision) -> decltype(auto) { return work(*collision); }, collision_);
  }
  template <class Work>
  decltype(auto) on_forest(Work&& work) const {
    return on_collision([&](auto& collision) -> decltype(auto) { return work(collision.forest()); });
  }
  List& list() const {
    return on_collision([](auto& collision) -> List& { return collision.list(); });
  }
  const std::uint32_t* realisers(std::uint32_t body, std::uint32_t node) const {
    return on_forest([&](auto& forest) { return forest.tree(body).realisers(node); });
  }
  std::uint64_t queue_steps() const {
    return on_collision([](auto& collision) { return collision.queue_steps(); });
  }
  void play_to(double t) {
    on_collision([&](auto& collision) { collision.advance(t); });
  }

  /// Finds the pairs of a sweep from boxes around the positions at both of its ends. The straight lines of a
  /// sweep may leave the boxes of the list, which contain curves.
  void find_swept_from_frames(double t1, std::span<const S* const> before, PairBuffer& out) {
    play_to(t1);
    if (!swept_) {
      std::vector<KineticRows<S>> rows(this->scene_.body_count());
      for (std::uint32_t body = 0; body < rows.size(); ++body)
        on_forest([&](auto& forest) { rows[body].follow(forest.tree(body), this->scene_.primitives(body)); });
      swept_.emplace(this->scene_,
                     [&](std::uint32_t body) -> const WideHierarchy<S>& { return rows[body].hierarchy(); });
    }
    std::uint64_t tests = 0;
    swept_->refit(before, this->sampled_);
    swept_->pairs(query_, out, tests);
    this->count_.add(Counter::box_tests, tests);
  }

  /// Calls work(number, pair) for each body pair of the list.
  template <class Work>
  void for_body_pairs(const Work& work) const {
    const List& list = this->list();
    for (std::uint32_t i = 0; i < list.body_pair_count(); ++i)
      if (list.is_entered(i)) work(i, list.body_pair(i));
  }
  /// Visits each leaf paired with itself, because within one body the list does not contain such pairs.
  template <class Work>
  void for_leaves_with_themselves(const BodyPair& pair, const Work& work) const {
    if (pair.first != pair.second) return;
    const Topology& topology = tree(pair.first);
    if (topology.empty() || topology.leaf_size == 1) return;
    open_.assign(1, 0);  // traverses from the root, because changes of geometry leave gaps
    while (!open_.empty()) {
      const std::uint32_t node = open_.back();
      open_.pop_back();
      const TopologyNode own = topology.nodes[node];
      if (own.is_leaf()) work(node);
      for (std::uint32_t child = own.first(); !own.is_leaf() && child < own.first() + own.count(); ++child)
        open_.push_back(child);
    }
  }

  /// Appends every primitive pair of two leaves, including pairs that share a vertex.
  void append_leaves(const BodyPair& pair, std::uint32_t leaf_a, std::uint32_t leaf_b,
                     PairBuffer& out) const {
    const Topology &a = tree(pair.first), &b = tree(pair.second);
    const TopologyNode na = a.nodes[leaf_a], nb = b.nodes[leaf_b];
    const std::size_t before = out.size();
    for (std::uint32_t i = na.first(); i < na.first() + na.count(); ++i)
      for (std::uint32_t j = nb.first(); j < nb.first() + nb.count(); ++j)
        out.push_back({pair.first, a.primitives[i], pair.second, b.primitives[j]});
    if (pair.first != pair.second) return;
    const LeavesOf leaves = leaf_a == leaf_b ? LeavesOf::one : LeavesOf::two;
    out.resize(before + keep_self_pairs(nullptr, leaves, out.data() + before, out.size() - before));
  }

  /// Appends every primitive pair of two leaves with the time span in which the leaves overlap.
  template <class LeafPair>
  void append_spans(std::uint32_t body_pair, const LeafPair& leaf, double t0, double end,
                    SpanBuffer& out) const {
    const BodyPair& pair = list().body_pair(body_pair);
    const Topology &a = tree(pair.first), &b = tree(pair.second);
    const TopologyNode na = a.nodes[leaf.a], nb = b.nodes[leaf.b];
    for (std::uint32_t i = na.first(); i < na.first() + na.count(); ++i)
      for (std::uint32_t j = nb.first(); j < nb.first() + nb.count(); ++j) {
        PrimitivePair found{pair.first, a.primitives[i], pair.second, b.primitives[j]};
        const LeavesOf leaves = leaf.a == leaf.b ? LeavesOf::one : LeavesOf::two;
        if (pair.first == pair.second &&
            keep_self_pairs(&this->scene_.primitives(pair.first), leaves, &found, 1) == 0)
          continue;
        out.push_back({found, std::max(leaf.since, t0), end});
      }
  }

  std::vector<SweptLeaves> swept_leaves_;
  mutable std::vector<std::uint32_t> open_;  ///< nodes of a traversal
  bool by_rows_;                             ///< leaves have several primitives
  bool on_curves_;                           ///< vertices of some body
  std::variant<std::unique_ptr<Collision<EventClock<S>>>, std::unique_ptr<Collision<AlgebraicClock<S>>>>
      collision_;
  ClipMotion<S> motion_;
  bool notes_changes_;                  ///< the list's leaves are the candidates
  KineticRowsQuery<S> rows_;            ///< empty unless by_rows_
  std::vector<BoxCache<S>> ray_boxes_;  ///< [body], made at the first request for rays
  std::vector<ProbeNode<std::uint32_t>> probe_stack_;
  BodyOrder probe_order_;
  std::optional<SweptHierarchies<S>> swept_;  ///< made at the first sweep of a scene with curves
  WideQuery<S> query_{this->scene_, this->sampled_};
  std::uint64_t first_step_ = 0;
  std::size_t vertices_ = 0;      ///< of the initial scene
  bool many_candidates_ = false;  ///< in the last frame
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_separation_list) {
  using namespace kbvh;
  return {make_entry<KineticSeparationList>({
      .id = "kinetic_separation_list",
      .title = "kinetic separation list",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.7",
      .positions = PositionUse::varying,
      .declares = {.continuous = true, .curves = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 16}},
      .parameters = {queue_parameter(),
                     {"look_ahead",
                      "32",
                      {"1", "32", "1000000"},
                      "linear pieces up to which the next event of a pair is looked for at once"}},
  })};
}
