#pragma once
#include <algorithm>
#include <limits>
#include <vector>

#include "core/families/events/algebraic_clock.hpp"
#include "core/families/separation/separation_list.hpp"
#include "core/families/wide/near_bodies.hpp"

namespace kbvh {

/// Kinetic incremental collision detection (Z&W s.7): the kinetic AABB trees of a scene, and the separation
/// lists of its body pairs on top. Trees and lists advance together, in the exact order of their events.
/// `Queue` is a queue over a clock (event_queue.hpp). The trees share one queue and the lists share another;
/// the first events of both queues are compared exactly. `Clock` decides about the trees' events: an
/// AlgebraicClock if bodies move on curves. The list compares boxes that are linear between keyframes
/// (CurveHulls).
///
/// In scenes with many body pairs the list holds only the pairs that may meet within a time window. Each body
/// has an upper bound on the displacement of its vertices; two bodies whose distance exceeds both
/// displacements do not meet. The end of a window is an event that opens the next window. A window is halved
/// while it holds many more pairs than bodies plus pairs that meet at its begin. The next window is twice as
/// long if the current one holds few pairs.
template <class S, template <class> class Queue, class Clock = EventClock<S>>
class KineticCollision {
  using ExactTime = typename InstantOf<Clock, S>::type::Exact;

 public:
  using Forest = KineticForest<S, Queue<Clock>, WatchedBoxes<S>>;
  using List = SeparationList<S, Queue>;

  /// `queue` names the kind of both queues, where `Queue` offers a choice.
  KineticCollision(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                   Counters& count, int look_ahead = OverlapClock<S>::usual_look_ahead,
                   std::string_view queue = {})
      : motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        body_pairs_(scene.pairs()),
        count_(&count),
        forest_(scene, motion, std::move(topologies), count,
                WatchedBoxes<S>{{&changed_, &nodes_}, {&watch_}}),
        list_(scene, forest_, count, look_ahead,
              near_bodies_.searches() ? List::BodyPairs::none : List::BodyPairs::all, queue),
        number_of_(near_bodies_.searches() ? body_pairs_.size() : 0, List::none) {
    forest_.choose_queue(queue);
    if constexpr (requires { forest_.queue().serve(*this); }) forest_.queue().serve(*this);
  }
  KineticCollision(const KineticCollision&) = delete;  // the trees point to `changed_` and `nodes_`
  KineticCollision& operator=(const KineticCollision&) = delete;

  void reset(double t) {
    forest_.reset(t);
    changed_.clear();
    if (!near_bodies_.searches()) {
      list_.reset(t);
      return;
    }
    near_bodies_.start_over();
    list_.leave_all(t);
    for (const std::uint32_t i : entered_) number_of_[i] = List::none;
    entered_.clear();
    window_ = 0;
    open_window(t);
  }
  /// Handles every event up to and including t.
  void advance(double t) {
    for (Part part = first_part(); is_due(part, t); part = first_part()) handle(part);
  }
  bool due(double t) const {
    return forest_.due(t) || list_.due(t) || list_.segment_end() <= t || window_end_ < t;
  }
  /// Returns whether the earliest event belongs to a tree. At one instant tree events come first, so that the
  /// list is decided with the new realisers.
  bool tree_is_first() const { return first_part() == Part::trees; }

  /// Returns the earliest event, or nothing if no event is scheduled.
  std::optional<ScheduledEvent<S>> next_event() const {
    switch (first_part()) {
      case Part::trees:
        return forest_.queue().empty() ? std::optional<ScheduledEvent<S>>()
                                       : described(forest_, forest_.queue().top());
      case Part::list:
        return list_.described(list_.top());
      case Part::segment:
        return without_change(list_.segment_end());
      case Part::window:
        return without_change(window_end_);
    }
    return {};
  }
  /// Replaces `out` by all scheduled events, earliest first.
  void scheduled_events(std::vector<ScheduledEvent<S>>& out) const {
    std::vector<ScheduledEvent<S>> trees, pairs;
    list_events(forest_, trees);
    list_.list_events(pairs);
    out.clear();
    if (list_.segment_end() < never) out.push_back(without_change(list_.segment_end()));
    out.insert(out.end(), trees.begin(), trees.end());
    out.insert(out.end(), pairs.begin(), pairs.end());
    if (window_end_ < never) out.push_back(without_change(window_end_));
    // Each part is sorted already. At one instant the begin of a segment comes first, then tree events, then
    // pair events; a new window opens last.
    std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return comes_before(a, b); });
  }
  /// Handles the earliest event if it is due by `until`, and describes it in `out`. Returns false, and leaves
  /// `out` alone, if no event is due.
  bool step(double until, EventDescription<S>& out) {
    if (!due(until)) return false;
    out.event = *next_event();
    out.rescheduled.clear();
    {
      const WatchedEvent<S> watched(watch_, out.touched);
      handle_next();
    }
    append_rescheduled(forest_, out.touched, out.rescheduled);
    return true;
  }
  /// Returns the watch that receives changes of bounds.
  BoundWatch<S>& watch() { return watch_; }

  /// Returns a double slightly after the earliest event.
  double after_next() const {
    switch (first_part()) {
      case Part::trees: {
        const Event& event = forest_.queue().top();
        return std::nextafter(event.hint + event.error, never);
      }
      case Part::list:
        return list_.top().not_before();
      case Part::segment:
        return std::nextafter(list_.segment_end(), never);
      case Part::window:
        break;
    }
    return std::nextafter(window_end_, never);
  }
  /// Handles the earliest event. Requires that `due` holds for some time.
  void handle_next() { handle(first_part()); }

  /// Prefetches for the queue of the trees: the data that the forest reads at `event`, and the data that the
  /// list reads.
  template <class StoredEvent>
  void fetch_ahead(const StoredEvent& event, std::uint32_t slot, int step) const {
    forest_.fetch_ahead(event, slot, step);
    const auto& tree = forest_.tree(event.body);
    const std::uint32_t node = tree.node_of(slot);
    list_.fetch_ahead(event.body, node, event.loser, step);
    if (step > 0) list_.fetch_ahead(event.body, tree.topology().parents[node], event.loser, step - 1);
  }
  void review(const Event& event, double t) { forest_.review(event, t); }

  /// Applies changes of plans at t, which the motion contains already.
  void plans_changed(double t, std::span<const PlanChange<S>> changes) {
    changed_.clear();
    forest_.plans_changed(t, changes);
    // With other plans, a new realiser may be behind the former one.
    for (auto& box : changed_) box.side = ChangedBoxes::all_sides;
    if (list_.take_over(changed_)) list_.boxes_changed(changed_, Moment<S>::at(t));
    if (near_bodies_.searches()) open_window(t);
  }

  /// Applies a change of geometry at t, which scene and motion contain already. Edits the trees first, one
  /// edit after another, and then the lists once. Returns the work done by the lists, in pairs.
  ListEdit geometry_changed(double t, const SceneView<S>& scene, const SampledMotion<S>& motion,
                            std::span<const BodyChange> changes) {
    changed_.clear();
    nodes_.clear();
    forest_.geometry_changed(t, scene, motion, changes);
    const ListEdit edit = list_.geometry_changed(t, forest_, nodes_, changed_);
    if (near_bodies_.searches()) open_window(t);
    return edit;
  }

  Forest& forest() { return forest_; }
  const Forest& forest() const { return forest_; }
  List& list() { return list_; }
  const List& list() const { return list_; }
  std::uint64_t queue_steps() const { return forest_.queue().steps() + list_.steps(); }
  std::size_t bytes() const {
    return forest_.bytes() + list_.bytes() + near_bodies_.bytes() + boxes_.capacity() * sizeof(boxes_[0]) +
           (number_of_.capacity() + entered_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  /// The part that owns the earliest event; `trees` if there is no event. At the end of a list segment the
  /// next segment begins before all other events of that instant. A new window opens after all events of its
  /// instant.
  enum class Part : std::uint8_t { trees, list, segment, window };
  Part first_part() const {
    const bool no_tree = forest_.queue().empty(), no_pair = list_.empty();
    const double segment_end = list_.segment_end();
    if (segment_end < never && segment_end <= window_end_ && (no_tree || !tree_is_before(segment_end)) &&
        (no_pair || !list_.clock().before(list_.top(), segment_end)))
      return Part::segment;
    if (window_end_ < never && !forest_.due(window_end_) && !list_.due(window_end_)) return Part::window;
    if (no_pair) return Part::trees;
    if (no_tree) return Part::list;
    const Event& tree = forest_.queue().top();
    const OverlapEvent<S>& pair = list_.top();
    const double error = tree.error + pair.error;
    if (tree.hint + error < pair.hint) return Part::trees;
    if (pair.hint + error < tree.hint) return Part::list;
    return compare(forest_.clock().crossing(tree), pair.crossing) <= 0 ? Part::trees : Part::list;
  }
  /// Returns whether the first event of `first`, which owns the earliest event, is due.
  bool is_due(Part first, double t) const {
    switch (first) {
      case Part::trees:
        return forest_.due(t);
      case Part::list:
        return list_.due(t);
      case Part::segment:
        return list_.segment_end() <= t;
      case Part::window:
        return window_end_ < t;
    }
    return false;
  }
  void handle(Part part) {
    switch (part) {
      case Part::trees:
        return handle_tree_event();
      case Part::list:
        return list_.handle_next();
      case Part::segment:
        return list_.open_segment();
      case Part::window:
        return open_window(window_end_);
    }
  }
  bool tree_is_before(double t) const {
    const Event& event = forest_.queue().top();
    if (event.hint + event.error < t) return true;
    if (event.hint - event.error > t) return false;
    return compare(forest_.clock().crossing(event), t) < 0;
  }
  /// Return the sign of an exact time of a tree event minus the time of a pair event, or a double.
  static int compare(const Crossing<S>& tree, const Crossing<S>& pair) {
    return compare_crossings(tree, pair);
  }
  static int compare(const Crossing<S>& tree, double t) { return compare_crossing_to(tree, t); }
  template <class Other>
  static int compare(const AlgebraicInstant<S>& tree, const Other& other) {
    return tree.curved ? compare_moment_to(tree.moment, other) : compare(tree.crossing, other);
  }
  /// Returns the instant at which the list decides pairs again, after an event of a tree. On curves this is a
  /// double before the event, in its segment: a pair that changes between that double and the event has its
  /// own event at once.
  static Moment<S> moment_of(const Event& event, const Crossing<S>& exact) {
    return {{event.begin, event.end, &exact}, event.hint, event.error};
  }
  static Moment<S> moment_of(const Event& event, const AlgebraicInstant<S>& exact) {
    if (!exact.curved) return moment_of(event, exact.crossing);
    const double before = std::max(event.begin, std::nextafter(event.hint - event.error, -never));
    return {{before, std::nextafter(event.hint + event.error, never), nullptr}, before, 0};
  }
  void handle_tree_event() {
    const Event event = forest_.queue().top();
    // For a body with per-vertex plans the clock drops an event's crossing when the event is handled.
    const bool own = forest_.clock().plans(event.body).has_own_plans();
    ExactTime exact;
    if (own) exact = forest_.clock().crossing(event);
    changed_.clear();
    forest_.handle_next();
    if (!list_.take_over(changed_)) return;
    if (!own) exact = forest_.clock().crossing(event);
    list_.boxes_changed(changed_, moment_of(event, exact));
  }

  static ScheduledEvent<S> without_change(double t) {
    ScheduledEvent<S> event;
    event.kind = EventKind::window;
    event.time = {t, 0};
    return event;
  }
  static bool comes_before(const ScheduledEvent<S>& a, const ScheduledEvent<S>& b) {
    const double error = a.time.error + b.time.error;
    if (a.time.time + error < b.time.time) return true;
    if (b.time.time + error < a.time.time) return false;
    if (a.has_crossing && b.has_crossing) return compare_crossings(a.crossing, b.crossing) < 0;
    if (a.has_crossing) return compare_crossing_to(a.crossing, b.time.time) < 0;
    if (b.has_crossing) return compare_crossing_to(b.crossing, a.time.time) > 0;
    return a.time.time < b.time.time;
  }
  static constexpr double never = std::numeric_limits<double>::infinity();
  static constexpr int most_halvings = 40;

  /// Returns the box of a body at t, from the realisers of its root. The box is inflated by more than all
  /// rounding errors of this function plus the list's comparison margin.
  Box<double> root_box(std::uint32_t body, double t) const {
    Box<double> box;
    const auto& tree = forest_.tree(body);
    if (tree.topology().empty()) return box;
    for (int axis = 0; axis < 3; ++axis)
      for (const bool upper : {false, true}) {
        const Side side = Side(2 * axis + (upper ? 1 : 0));
        const FlightPlans<S>& plans = forest_.clock().plans(body);
        const Piece<S> piece = plans.curved()
                                   ? list_.box(body, 0).walk(side, Widening::none, Instant<S>::at(t)).piece()
                                   : plans.piece_after(tree.realiser(0, side), axis, t);
        const double x0 = double(piece.x0), x1 = double(piece.x1);
        const double way = piece.kind == PieceKind::ray
                               ? x1 * (t - piece.t0)
                               : (x1 - x0) * ((t - piece.t0) / (piece.t1 - piece.t0));
        const double margin =
            margin_of(std::max({std::abs(x0), std::abs(x1), std::abs(x0 + way), std::abs(way)}));
        (upper ? box.upper : box.lower)[axis] = x0 + way + (upper ? margin : -margin);
      }
    return box;
  }
  static double margin_of(double largest) {
    return 32 * double(std::numeric_limits<S>::epsilon()) * largest +
           32 * double(std::numeric_limits<S>::min());
  }
  /// Returns a box that encloses the body, inflated by the list's margin, from t until `end`. `box` is the
  /// body's box at t.
  Box<double> swept(std::uint32_t body, Box<double> box, double t, double end) const {
    if (box.empty()) return box;
    const double way = motion_.displacement_bound(body, t, end);
    for (int axis = 0; axis < 3; ++axis) {
      const double farther = way + margin_of(way);
      box.lower[axis] -= farther;
      box.upper[axis] += farther;
    }
    return box;
  }

  /// Opens the window that begins at t. Requires that every event up to t has been handled. Enters the body
  /// pairs that may meet until the window's end, and removes the others from the list.
  void open_window(double t) {
    boxes_.resize(forest_.size());
    for (std::uint32_t body = 0; body < boxes_.size(); ++body) boxes_[body] = root_box(body, t);
    std::uint64_t tests = 0;
    const std::size_t meeting =
        near_bodies_.find([&](std::uint32_t body) { return boxes_[body]; }, tests).size();
    const std::size_t many = 4 * (meeting + boxes_.size());
    if (window_ == 0) window_ = first_window(t);
    for (int halvings = 0;; ++halvings) {
      window_end_ = window_ < never ? t + window_ : never;
      if (!(window_end_ > t)) window_end_ = std::nextafter(t, never);
      near_bodies_.find([&](std::uint32_t body) { return swept(body, boxes_[body], t, window_end_); }, tests);
      if (near_bodies_.last().size() <= many || halvings == most_halvings) break;
      window_ = window_ < never ? window_ / 2 : first_window(t);
    }
    const auto near = near_bodies_.last();
    if (2 * near.size() < many) window_ *= 2;
    count_->add(Counter::box_tests, tests);
    std::size_t next = 0;
    still_.clear();
    for (const std::uint32_t i : entered_) {
      while (next < near.size() && near[next] < i) ++next;
      if ((next < near.size() && near[next] == i) || list_.is_recording() || !list_.leave(number_of_[i]))
        still_.push_back(i);
      else
        number_of_[i] = List::none;
    }
    for (const std::uint32_t i : near) {
      if (number_of_[i] != List::none) continue;
      number_of_[i] = list_.enter(body_pairs_[i], t);
      still_.push_back(i);
    }
    std::sort(still_.begin(), still_.end());
    entered_.swap(still_);
  }
  /// Returns the length of the first window in seconds: until the first knot of any plan, or 1 s if there is
  /// none.
  double first_window(double t) const {
    double end = never;
    for (std::uint32_t body = 0; body < boxes_.size(); ++body)
      end = std::min(end, motion_.plans(body).lines_end(t));
    return end < never ? end - t : 1;
  }

  ClipMotion<S> motion_;
  NearBodies near_bodies_;
  std::span<const BodyPair> body_pairs_;  ///< body pairs of the scene
  Counters* count_;
  BoundWatch<S> watch_;
  std::vector<ChangedBoxes::Box> changed_;
  std::vector<ChangedBoxes::Node> nodes_;
  Forest forest_;
  List list_;
  // Used only in scenes with many body pairs:
  double window_ = 0, window_end_ = never;  ///< length of the window, and end of the current window; seconds
  std::vector<Box<double>> boxes_;          ///< boxes of the bodies at the begin of the window
  std::vector<std::uint32_t> number_of_;    ///< [pair of the scene] number in the list, or none
  std::vector<std::uint32_t> entered_;      ///< pairs of the scene that are in the list, ascending
  std::vector<std::uint32_t> still_;
};

}  // namespace kbvh
