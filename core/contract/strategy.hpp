#pragma once
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/counters.hpp"
#include "core/base/params.hpp"
#include "core/contract/audit_volumes.hpp"
#include "core/contract/event_source.hpp"
#include "core/contract/queries.hpp"
#include "core/scene/geometry_change.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/pairs.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

struct MovingPoints;

/// Does a strategy keep every box as small as it can be, or only large enough?
enum class Tightness : std::uint8_t { tight, conservative, none };

/// What `pairs_at` promises.
enum class Guarantee : std::uint8_t {
  exact,               ///< candidates contain the oracle's pairs, and confirming them yields exactly those
  candidate_superset,  ///< the same for candidates of a peer library: contained, and equal after kbvh's own
                       ///< test
  approximate,         ///< anything; missed and extra pairs are counted and shown
};

/// Who evaluates positions.
enum class PositionUse : std::uint8_t {
  all,      ///< the driver evaluates every vertex before `advance`; its time is motion time
  fetched,  ///< the strategy fetches what it reads; that time is its own
  varying,  ///< one or the other, as `wants_all_positions` says before each frame
};

/// What a strategy says of itself and its class does not show.
struct Declared {
  bool event_driven = false;  ///< does work at events rather than at frames (implied by EventSource)
  bool continuous = false;    ///< bounds are valid between frames, too
  bool restructures = false;  ///< changes its topology while it runs
  bool time_budget = false;   ///< honours a query budget
};

/// What else a strategy can do. The registration fills it in from the class (core/contract/queries.hpp,
/// event_source.hpp) and from what is declared; calls of what a strategy cannot do throw std::logic_error.
struct Capabilities {
  bool event_driven = false, continuous = false, restructures = false, time_budget = false;  ///< Declared
  bool events = false;            ///< EventSource: events can be stepped one by one
  bool plan_changes = false;      ///< TakesPlanChanges: flight_plans_changed
  bool geometry_changes = false;  ///< TakesGeometryChanges: geometry_changed
  bool spans = false;             ///< AnswersSpans: answers intervals without looking at frames
  bool self_pairs = false;  ///< AnswersSelfPairs: pairs within a body; scenes that ask for them are refused
                            ///< else
  bool contacts = false;    ///< AnswersSweeps: the broad phase of continuous collision detection
};

/// Which topologies a strategy can be given. One that builds its own hierarchy (a peer library) accepts none.
struct TopologyNeeds {
  bool own = false;  ///< builds its own; the fields below do not apply
  std::vector<std::uint32_t> widths{2, 4, 8};
  std::uint32_t min_leaf_size = 1, max_leaf_size = 16;
  BuilderConfig preferred{};  ///< used where a plan does not say otherwise: its own best
};

/// A strategy described as data; tests, benchmarks, plots, documentation and plans loop over it.
struct Info {
  std::string id;     ///< unique, snake_case
  std::string title;  ///< for tables and legends
  std::string
      family;  ///< decides colour and marker: refit, kinetic, rebuild, oracle, fcl, bullet, embree, ...
  std::string citation;  ///< the work it implements
  /// Ratios are against the fastest verified baseline of a table.
  bool baseline = false;
  Tightness tightness = Tightness::tight;
  Guarantee guarantee = Guarantee::exact;
  PositionUse positions = PositionUse::all;
  Declared declares{};
  TopologyNeeds topology{};
  std::vector<Parameter> parameters{};
  /// Kinds of primitives that it takes; scenes with others are refused.
  std::vector<PrimitiveKind> primitives{PrimitiveKind::polygons, PrimitiveKind::points,
                                        PrimitiveKind::control_nets};
  /// The scalar in which bounds are kept, if it is not the scene's: "float" or "double".
  std::string own_scalar{};
  /// Largest scene it is offered, in primitive pairs of one body pair (quadratic contestants); 0: any.
  std::uint64_t max_primitive_pairs = 0;
  /// A peer library's own, uncertified test of two features in motion (core/continuous/impact.hpp): does it
  /// say that they touch? `kbvh ccd` shows it beside the exact one. Null: it has none.
  bool (*own_impact)(Contact::Kind kind, const MovingPoints& points) = nullptr;
  // Filled in by the registration from the class itself:
  Capabilities can{};
  Foresight foresight = Foresight::none;
  bool has_float = false, has_double = false;
};

/// What an audit sees of one body's hierarchy after a query: bounds in double (exact for float), per node.
struct AuditView {
  Topology topology;               ///< a copy, at the strategy's present version
  std::vector<Box<double>> boxes;  ///< one per node; empty if `volumes` is set
  std::vector<std::uint8_t>
      stale;  ///< nodes whose bound was not brought up to date because no query read it; may be empty
  std::shared_ptr<const AuditVolumes> volumes{};  ///< one per node, where bounds are not boxes; else null
};

/// A contestant: keeps bounds valid while a whole scene moves, and answers which primitives meet.
/// One instance serves one scene, one scalar, one thread. The driver calls
///   reset(t0); then for each frame, t never decreasing: advance(t); candidates_at(t); confirm(t).
/// The motion view stands at t before each call. All calls but construction and `reset` avoid allocation once
/// warm.
///
/// The public functions check times and reset counters; a strategy overrides the protected ones, which rely
/// on that, and derives from an interface of queries.hpp or event_source.hpp for each further thing that it
/// can do. Strategies derive from CountedStrategy, which counts.
template <class S>
class Strategy {
 public:
  Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), sampled_(motion) {}
  virtual ~Strategy() = default;
  Strategy(const Strategy&) = delete;
  Strategy& operator=(const Strategy&) = delete;

  /// Starts over at time t (first frame, loops, lessons): everything is valid at t afterwards. Clears
  /// counters. Throws std::invalid_argument if t is not finite.
  void reset(double t) {
    if (!std::isfinite(t)) throw std::invalid_argument("cannot start at t = " + std::to_string(t));
    triangle_stats_ = {};
    previous_time_ = time_ = t;
    between_frames_ = false;
    reset_to(t);
    start_counting();
  }

  /// Brings the hierarchies to time t; phase "update". Throws std::invalid_argument if t is before the last
  /// time, or not finite.
  void advance(double t) {
    move_to(t);
    advance_to(t);
  }

  /// Appends the primitive pairs that may intersect at t, each once, canonical; phase "traversal".
  /// Bounds that are read are valid at t; lazy strategies refresh them here. Like all functions below that
  /// take a time, throws std::invalid_argument if the strategy does not stand at t.
  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& budget) {
    stand_at(t);
    return find_candidates(t, out, budget);
  }

  /// Keeps the candidates that intersect; phase "triangle tests". By default kbvh's exact test.
  void confirm(double t, PairBuffer& pairs) {
    stand_at(t);
    confirm_candidates(t, pairs);
  }

  /// The pairs at t as the guarantee promises: candidates, confirmed.
  QueryStatus pairs_at(double t, PairBuffer& out, const Budget& budget = {}) {
    out.clear();
    const QueryStatus status = candidates_at(t, out, budget);
    confirm(t, out);
    return status;
  }

  /// Appends the pairs over [t0, t1] with closed spans that enclose every contact of the exact plan and of
  /// every frame; a pair may have several. Stands at t0 when it is called, and at t1 after, as by `advance`.
  /// Spans are of candidates: at a frame, `confirm` keeps the pairs that intersect then.
  void spans(double t0, double t1, SpanBuffer& out) {
    AnswersSpans<S>& query = able(abilities().spans, "spans");
    stand_at(t0);
    move_to(t1);
    query.find_spans(t0, t1, out);
  }

  /// Announces `swept_pairs` for the motion that begins at t, where the strategy and the motion view stand.
  void start_sweep(double t) {
    AnswersSweeps<S>& query = able(abilities().sweeps, "contacts");
    stand_at(t);
    query.prepare_sweep(t);
  }
  /// Appends the primitive pairs that may touch while every vertex moves on a straight line from its position
  /// at t0 to that at t1, each once, canonical; within one body those that share a vertex, too, for their
  /// other features may touch. `start_sweep` came before; the motion view stands at t1, with all positions,
  /// and `before` are those at t0 ([body], then [vertex][3]). No knot of any plan lies strictly between.
  /// Afterwards the next sweep may be announced from t1, or all begins again with `reset`; frames are not
  /// answered between.
  void swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) {
    AnswersSweeps<S>& query = able(abilities().sweeps, "contacts");
    if (before.size() != scene_.body_count())
      throw std::invalid_argument("a sweep takes the positions of " + std::to_string(scene_.body_count()) +
                                  " bodies, not of " + std::to_string(before.size()));
    stand_at(t0);
    move_to(t1);
    query.find_swept_pairs(t0, t1, before, out);
  }

  /// The plans of some vertices have changed at t; the motion view shows the new ones. Each starts from the
  /// stored position at t. The strategy has been advanced to t before.
  void flight_plans_changed(double t, std::span<const PlanChange<S>> changes) {
    TakesPlanChanges<S>& taker = able(abilities().plan_changes, "flight-plan changes");
    stand_at(t);
    taker.follow_plans(t, changes);
  }

  /// Vertices and primitives were inserted or deleted at t; ids are stable, and the scene and motion views
  /// show the new geometry (`body_changes` says what that means for each body). The strategy has been
  /// advanced to t before; afterwards everything is valid at t. A later `reset` keeps the present geometry.
  void geometry_changed(double t, const GeometryChange<S>& change) {
    TakesGeometryChanges<S>& taker = able(abilities().geometry_changes, "geometry changes");
    stand_at(t);
    taker.follow_geometry(t, change);
  }

  /// Performs the first event if it is due by time `until`, and describes it in `out`, whose lists are
  /// replaced; false if none is due. Afterwards the strategy stands between frames: the next call is another
  /// `step_event`, `advance` to `until` or later, or `reset`. Performing every event due by t and advancing
  /// to t is the same as advancing to t. Throws std::invalid_argument if `until` is not finite, or before the
  /// last time.
  bool step_event(double until, EventDescription<S>& out) {
    EventSource<S>& source = able(abilities().events, "events");
    check_not_before(until);
    if (!source.step(until, out)) return false;
    between_frames_ = true;
    earliest_ = until;
    return true;
  }
  /// The event queue of a strategy that has one; null for all others.
  EventSource<S>* events() { return abilities().events; }

  /// The hierarchy of one body, for audits; nothing if it cannot be seen (a closed library).
  virtual std::optional<AuditView> audit_view(std::uint32_t /*body*/) const { return {}; }

  /// Memory held by the strategy's own structures, in bytes.
  virtual std::size_t bytes() const = 0;

  /// PositionUse::varying: are all positions to be evaluated before the next `advance`?
  virtual bool wants_all_positions() const { return true; }

  /// What a strategy that chooses has chosen since `reset`, in words; empty for all others.
  virtual std::string choice() const { return {}; }

  /// Everything counted since `reset`, which is not counted itself: what starting costs is not what running
  /// costs (nor is, of one that chooses, what changing over costs). All zero but for triangle tests and bytes
  /// in a silent instance.
  Counters counters() const {
    Counters table = counted();
    table[Counter::triangle_tests] += triangle_stats_.tests;
    table[Counter::triangle_tests_exact] += triangle_stats_.exact;
    table[Counter::bytes] = bytes();
    return table;
  }

 protected:
  /// Does what `reset` promises; `time()` is t already.
  virtual void reset_to(double t) = 0;
  /// Does what `advance` promises; `time()` is t already, and `previous_time()` the time before.
  virtual void advance_to(double t) = 0;
  /// Does what `candidates_at` promises.
  virtual QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) = 0;
  /// Does what `confirm` promises.
  virtual void confirm_candidates(double /*t*/, PairBuffer& pairs) {
    confirm_pairs(scene_, sampled_, pairs, triangle_stats_);
  }
  /// Counts are zero from here on: called when `reset_to` has done its work.
  virtual void start_counting() {}
  /// What was counted since then, without triangle tests and bytes.
  virtual Counters counted() const { return {}; }

  /// Of the last `reset` or `advance`, or the end of the last span or sweep.
  double time() const { return time_; }
  /// The time before that; the same after `reset`.
  double previous_time() const { return previous_time_; }

  SceneView<S> scene_;
  SampledMotion<S> sampled_;
  TriangleTestStats triangle_stats_;

 private:
  /// The interfaces that the class derives from; null where it does not.
  struct Abilities {
    AnswersSpans<S>* spans;
    AnswersSweeps<S>* sweeps;
    TakesPlanChanges<S>* plan_changes;
    TakesGeometryChanges<S>* geometry_changes;
    EventSource<S>* events;
  };
  /// Looked up once: the first call comes when the object is whole.
  const Abilities& abilities() {
    if (!abilities_)
      abilities_ = {dynamic_cast<AnswersSpans<S>*>(this), dynamic_cast<AnswersSweeps<S>*>(this),
                    dynamic_cast<TakesPlanChanges<S>*>(this), dynamic_cast<TakesGeometryChanges<S>*>(this),
                    dynamic_cast<EventSource<S>*>(this)};
    return *abilities_;
  }
  template <class Interface>
  static Interface& able(Interface* interface, const char* what) {
    if (interface == nullptr) throw std::logic_error(std::string("this strategy does not declare ") + what);
    return *interface;
  }
  void check_not_before(double t) const {
    const double earliest = between_frames_ ? earliest_ : time_;
    if (!(t >= earliest) || !std::isfinite(t))
      throw std::invalid_argument("cannot advance from t = " + std::to_string(earliest) + " back to " +
                                  std::to_string(t));
  }
  void move_to(double t) {
    check_not_before(t);
    previous_time_ = time_;
    time_ = t;
    between_frames_ = false;
  }
  void stand_at(double t) const {
    if (between_frames_)
      throw std::invalid_argument("asked for t = " + std::to_string(t) +
                                  ", but the strategy stands between frames, after an event");
    if (t != time_)
      throw std::invalid_argument("asked for t = " + std::to_string(t) + ", but the strategy stands at " +
                                  std::to_string(time_));
  }

  double time_ = 0, previous_time_ = 0;
  double earliest_ = 0;  ///< to which the next `advance` may go, between frames
  bool between_frames_ = false;
  std::optional<Abilities> abilities_;
};

/// A strategy that counts by the policy Count (Counting or Silent).
template <class S, class Count>
class CountedStrategy : public Strategy<S> {
 public:
  using Strategy<S>::Strategy;

 protected:
  /// Called when counts have been cleared, for those that are kept elsewhere than in `count_`.
  virtual void counts_cleared() {}
  /// Adds to `table`, which holds what is in `count_`, what is counted elsewhere: entries of the enum, or
  /// counters of the strategy's own (Counters::add). Called for counting instances only.
  virtual void add_counts(Counters& /*table*/) const {}

  Count count_;

 private:
  void start_counting() final {
    count_.table = {};
    first_fetch_ = this->sampled_.fetched();
    counts_cleared();
  }
  Counters counted() const final {
    Counters table = count_.table;
    if constexpr (Count::enabled) {
      table[Counter::positions_fetched] += this->sampled_.fetched() - first_fetch_;
      add_counts(table);
    }
    return table;
  }

  std::uint64_t first_fetch_ = 0;
};

/// One topology per body; empty for strategies that build their own.
using Topologies = std::vector<Topology>;

}  // namespace kbvh
