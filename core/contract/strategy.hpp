#pragma once
#include <cmath>
#include <limits>
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
#include "core/motion/admissible.hpp"
#include "core/scene/geometry_change.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/pair_difference.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

struct MovingPoints;

/// Whether a strategy keeps every box as small as possible (tight) or only large enough (conservative).
enum class Tightness : std::uint8_t { tight, conservative, none };

/// The promise that `pairs_at` makes.
enum class Guarantee : std::uint8_t {
  exact,               ///< candidates contain the oracle's pairs, and confirming them yields exactly those
  candidate_superset,  ///< candidates of a peer library contain the oracle's pairs, and equal them after
                       ///< kbvh's own test
  approximate,         ///< no promise; missed and extra pairs are counted and shown
};

/// Who evaluates positions.
enum class PositionUse : std::uint8_t {
  all,      ///< the driver evaluates every vertex before `advance`; its time is motion time
  fetched,  ///< the strategy fetches the positions that it reads; that time is part of its own phases
  varying,  ///< one of the two; `wants_all_positions` decides before each frame
};

/// Properties that a strategy declares because they cannot be derived from its class.
struct Declared {
  bool event_driven = false;  ///< works at events instead of frames (implied by EventSource)
  bool continuous = false;    ///< bounds are valid between frames, too
  bool restructures = false;  ///< changes its topology at run time
  bool time_budget = false;   ///< honours a query budget
  bool curves = false;        ///< foresees vertices on curves, not on lines alone
};

/// The optional abilities of a strategy. The registration fills them in from the class
/// (core/contract/queries.hpp, event_source.hpp) and from the declared properties. Calls of a missing ability
/// throw std::logic_error.
struct Capabilities {
  bool event_driven = false, continuous = false, restructures = false, time_budget = false;  ///< Declared
  bool events = false;            ///< EventSource: single events can be stepped
  bool plan_changes = false;      ///< TakesPlanChanges: flight_plans_changed
  bool geometry_changes = false;  ///< TakesGeometryChanges: geometry_changed
  bool spans = false;             ///< AnswersSpans: answers intervals without sampling frames
  bool self_pairs =
      false;  ///< AnswersSelfPairs: pairs within a body; without it, scenes that ask for them are refused
  bool contacts = false;  ///< AnswersSweeps: the broad phase of continuous collision detection
  bool changes = false;   ///< AnswersChanges: changes of answers without a comparison of full answers
  bool rays = false;      ///< AnswersRays: probe_at with rays
  bool probes = false;    ///< AnswersProbes: probe_at with any probes
  /// Plays scenes whose vertices move on curves (FlightPlans::curved): declared, or implied by a foresight of
  /// positions and displacement bounds alone.
  bool curves = false;
};

/// The topologies that a strategy accepts. A strategy that builds its own hierarchy (a peer library) accepts
/// none.
struct TopologyNeeds {
  bool own = false;  ///< builds its own; the fields below do not apply
  std::vector<std::uint32_t> widths{2, 4, 8};
  std::uint32_t min_leaf_size = 1, max_leaf_size = 16;
  BuilderConfig preferred{};  ///< the strategy's own best; used where a plan does not override it
};

/// Describes a strategy as data; tests, benchmarks, plots, documentation and plans loop over it.
struct Info {
  std::string id;     ///< unique, snake_case
  std::string title;  ///< for tables and legends
  std::string
      family;  ///< decides colour and marker: refit, kinetic, rebuild, oracle, fcl, bullet, embree, ...
  std::string citation;  ///< the publication that the strategy implements
  /// Marks a baseline. Ratios are against the best refit of a table: the verified baseline with the smallest
  /// time of the whole clip. Every strategy of family refit without foresight is a baseline (tested).
  bool baseline = false;
  Tightness tightness = Tightness::tight;
  Guarantee guarantee = Guarantee::exact;
  /// The promise that `probe_at` makes for rays: exact, or approximate for a peer's own test of rays and
  /// triangles.
  Guarantee rays_guarantee = Guarantee::exact;
  PositionUse positions = PositionUse::all;
  Declared declares{};
  TopologyNeeds topology{};
  std::vector<Parameter> parameters{};
  /// The accepted kinds of primitives; scenes with others are refused.
  std::vector<PrimitiveKind> primitives{PrimitiveKind::polygons, PrimitiveKind::points,
                                        PrimitiveKind::control_nets};
  /// The scalar in which bounds are kept, if it is not the scene's: "float" or "double".
  std::string own_scalar{};
  /// The largest scene on which the strategy runs, in primitive pairs of one body pair (quadratic
  /// contestants); 0: any.
  std::uint64_t max_primitive_pairs = 0;
  /// The largest magnitude of a coordinate with which the contestant works: of positions during the whole
  /// motion, and of rays. Larger ones are refused. Infinite: everything admissible
  /// (core/motion/admissible.hpp).
  double max_coordinate = std::numeric_limits<double>::infinity();
  /// Calls a peer library's own, uncertified test of two moving features (core/continuous/impact.hpp) and
  /// returns whether it reports contact. `kbvh ccd` compares it with the exact test. Null: there is none.
  bool (*own_impact)(Contact::Kind kind, const MovingPoints& points) = nullptr;
  /// The version of a peer library, as the library states it; empty for strategies of kbvh.
  std::string version{};
  /// The instruction set of a peer library's code ("sse2", "avx512"); empty for strategies that run kbvh's
  /// kernels, whose set is chosen at run time (core/kernels/kernel_set.hpp).
  std::string instructions{};
  /// A sentence that tables print with the times of this contestant; empty for most.
  std::string remark{};
  // Filled in by the registration from the class:
  Capabilities can{};
  Foresight foresight = Foresight::none;
  bool has_float = false, has_double = false;
};

/// One body's hierarchy after a query, as seen by audits: bounds in double (exact for float), per node.
struct AuditView {
  Topology topology;               ///< a copy of the strategy's current topology
  std::vector<Box<double>> boxes;  ///< one per node; those around `volumes`, if set
  std::vector<std::uint8_t>
      stale;  ///< nodes whose bound was not updated because no query read it; may be empty
  std::shared_ptr<const AuditVolumes> volumes{};  ///< one per node, for bounds that are not boxes; else null
};

/// A contestant: keeps bounds valid while a whole scene moves, and answers which primitives intersect. One
/// instance serves one scene, one scalar, one thread. The driver calls
///   reset(t0); then for each frame, t never decreasing: advance(t); candidates_at(t); confirm(t).
/// The motion view stands at t before each call. No call except construction and `reset` allocates memory
/// once warm.
///
/// The public functions check times and reset counters, then call the protected ones; a strategy overrides
/// the protected ones and may rely on these checks. It derives from an interface of queries.hpp or
/// event_source.hpp for each optional ability. Strategies derive from CountedStrategy, which counts.
///
/// Bodies over one vertex set are two bodies like any others to a strategy: the public functions remove pairs
/// of their primitives that have a common vertex.
template <class S>
class Strategy {
 public:
  Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : scene_(scene), sampled_(motion), may_find_incident_(has_pairs_of_sets(scene)) {}
  virtual ~Strategy();
  Strategy(const Strategy&) = delete;
  Strategy& operator=(const Strategy&) = delete;

  /// Restarts at time t (first frame, loops, lessons): afterwards all bounds are valid at t. Clears counters.
  /// Throws std::invalid_argument if t is not finite.
  void reset(double t) {
    if (!std::isfinite(t)) throw std::invalid_argument("cannot start at t = " + number_text(t));
    triangle_stats_ = {};
    previous_time_ = time_ = t;
    between_frames_ = false;
    for (AnswerHistory& history : histories_) history.clear();
    reset_to(t);
    start_counting();
  }

  /// Brings the hierarchies to time t; phase "update". Throws std::invalid_argument if t is not finite or
  /// before the last time.
  void advance(double t) {
    move_to(t);
    advance_to(t);
  }

  /// Appends the primitive pairs that may intersect at t, canonical, each once; phase "traversal". Every
  /// bound that the query reads is valid at t; lazy strategies refresh bounds here. Like all functions below
  /// that take a time, throws std::invalid_argument if the strategy does not stand at t.
  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& budget) {
    stand_at(t);
    return find_pairs_apart(t, out, budget);
  }

  /// Keeps the candidates that intersect; phase "triangle tests". The default is kbvh's exact test.
  void confirm(double t, PairBuffer& pairs) {
    stand_at(t);
    confirm_candidates(t, pairs);
  }

  /// Returns the pairs at t that the guarantee promises: `candidates_at`, then `confirm`.
  QueryStatus pairs_at(double t, PairBuffer& out, const Budget& budget = {}) {
    out.clear();
    const QueryStatus status = candidates_at(t, out, budget);
    confirm(t, out);
    return status;
  }

  /// Replaces `begun` and `ended` by the difference between an answer at t and the last one that a call with
  /// the same `answer` described since `reset`; the first call begins all pairs. All changes added up equal
  /// `candidates_at` or `pairs_at`, which may be called in between. Every strategy answers: if it does not
  /// derive from AnswersChanges, two full answers are compared, in linear time.
  void changes_at(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) {
    stand_at(t);
    if (&begun == &ended) throw std::invalid_argument("changes need two buffers, not one twice");
    begun.clear();
    ended.clear();
    if (AnswersChanges<S>* query = abilities().changes) {
      query->find_changes(t, answer, begun, ended);
      for (PairBuffer* pairs : {&begun, &ended}) remove_incident_pairs(*pairs, 0);
    } else {
      compare_answers(t, answer, begun, ended);
    }
  }

  /// Appends the pairs over [t0, t1] with closed spans that enclose every contact of the exact plan and of
  /// every frame; a pair may have several spans. The strategy stands at t0 before the call and at t1 after
  /// it, as after `advance`. Spans are of candidates: at a frame, `confirm` keeps the pairs that intersect at
  /// that time.
  void spans(double t0, double t1, SpanBuffer& out) {
    AnswersSpans<S>& query = able(abilities().spans, "spans");
    stand_at(t0);
    move_to(t1);
    const std::size_t before = out.size();
    query.find_spans(t0, t1, out);
    if (may_find_incident_)
      remove_incident(scene_, out, before,
                      [](const PairSpan& span) -> const PrimitivePair& { return span.pair; });
  }

  /// Announces `swept_pairs` for the motion that begins at t, the current time of the strategy and of the
  /// motion view.
  void start_sweep(double t) {
    AnswersSweeps<S>& query = able(abilities().sweeps, "contacts");
    stand_at(t);
    query.prepare_sweep(t);
  }
  /// Appends the primitive pairs that may touch while every vertex moves on a straight line from its position
  /// at t0 to its position at t1, canonical, each once. Pairs within one body, or of bodies over one vertex
  /// set, include primitives that share a vertex, because their other features may touch. `start_sweep` must
  /// precede the call. The motion view
  /// stands at t1, with all positions; `before` holds the positions at t0 ([body], then [vertex][3]). No knot
  /// of any plan lies strictly between t0 and t1. Afterwards the next sweep may be announced from t1, or
  /// `reset` starts over; frames in between are not answered.
  void swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) {
    AnswersSweeps<S>& query = able(abilities().sweeps, "contacts");
    if (before.size() != scene_.body_count())
      throw std::invalid_argument("a sweep takes the positions of " + std::to_string(scene_.body_count()) +
                                  " bodies, not of " + std::to_string(before.size()));
    stand_at(t0);
    move_to(t1);
    query.find_swept_pairs(t0, t1, before, out);
  }

  /// Answers probes at t: rays, or another kind (core/scene/probes.hpp). They meet all primitives of the
  /// scene, also those of bodies in no pair. Positions are fetched as needed. Throws like `check_probes`.
  void probe_at(double t, const Probes<S>& probes) {
    const RayProbes<S>* const rays = std::get_if<RayProbes<S>>(&probes);
    AnswersRays<S>* const for_rays = rays != nullptr ? &able(abilities().rays, "rays") : nullptr;
    AnswersProbes<S>* const for_any = rays == nullptr ? &able(abilities().probes, "probes") : nullptr;
    check_probes(probes);
    stand_at(t);
    if (rays != nullptr)
      for_rays->find_hits(t, *rays);
    else
      for_any->answer_probes(t, probes);
  }

  /// Reports that the plans of some vertices changed at t; the motion view shows the new plans. Each new plan
  /// starts from the stored position at t. The strategy must have been advanced to t before.
  void flight_plans_changed(double t, std::span<const PlanChange<S>> changes) {
    TakesPlanChanges<S>& taker = able(abilities().plan_changes, "flight-plan changes");
    stand_at(t);
    taker.follow_plans(t, changes);
  }

  /// Reports that vertices and primitives were inserted or deleted at t. Ids are stable, and the scene and
  /// motion views show the new geometry (`body_changes` lists the effects per body). The strategy must have
  /// been advanced to t before; afterwards all bounds are valid at t. A later `reset` keeps the current
  /// geometry.
  void geometry_changed(double t, const GeometryChange<S>& change) {
    TakesGeometryChanges<S>& taker = able(abilities().geometry_changes, "geometry changes");
    stand_at(t);
    taker.follow_geometry(t, change);
  }

  /// Performs the first event if it is due by time `until`, and describes it in `out`, whose lists are
  /// replaced; returns false if none is due. Afterwards the strategy stands between frames: the next call
  /// must be `step_event`, `advance` to `until` or later, or `reset`. Performing every event due by t and
  /// then advancing to t equals advancing to t directly. Throws std::invalid_argument if `until` is not
  /// finite or before the last time.
  bool step_event(double until, EventDescription<S>& out) {
    EventSource<S>& source = able(abilities().events, "events");
    check_not_before(until);
    if (!source.step(until, out)) return false;
    between_frames_ = true;
    earliest_ = until;
    return true;
  }
  /// Returns the event queue of an event-driven strategy; null for all others.
  EventSource<S>* events() { return abilities().events; }

  /// Returns the hierarchy of one body, for audits; nothing if it is not visible (a closed library).
  virtual std::optional<AuditView> audit_view(std::uint32_t /*body*/) const { return {}; }

  /// Returns the memory of the strategy's own structures, in bytes.
  virtual std::size_t bytes() const = 0;

  /// Returns, for PositionUse::varying, whether all positions must be evaluated before the next `advance`.
  virtual bool wants_all_positions() const { return true; }

  /// Describes in words the choices made since `reset` by a strategy that chooses; empty for all others.
  virtual std::string choice() const { return {}; }

  /// Makes this a timed instance. It leaves out counts that cost extra work: those within a peer's library,
  /// and those of bodies that rays did not enter. To be called before the first `reset`.
  virtual void be_timed() { timed_ = true; }

  /// Returns everything counted since `reset`. Not counted, because they are not running costs: the reset
  /// itself and, for a strategy that chooses, a change of its choice. A timed instance leaves some counts out
  /// (be_timed).
  Counters counters() const {
    Counters table = counted();
    table[Counter::triangle_tests] += triangle_stats_.tests;
    table[Counter::triangle_tests_exact] += triangle_stats_.exact;
    table[Counter::ray_decisions_exact] += triangle_stats_.ray_decisions;
    table[Counter::bytes] = bytes() + histories_[0].bytes() + histories_[1].bytes();
    return table;
  }

 protected:
  /// Implements `reset`; `time()` is already t.
  virtual void reset_to(double t) = 0;
  /// Implements `advance`; `time()` is already t, and `previous_time()` is the time before.
  virtual void advance_to(double t) = 0;
  /// Implements `candidates_at`.
  virtual QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) = 0;
  /// Implements `confirm`.
  virtual void confirm_candidates(double /*t*/, PairBuffer& pairs) {
    confirm_pairs(scene_, sampled_, pairs, triangle_stats_);
  }
  /// Finds the full answer at t, and appends its difference from the last one that this function found since
  /// `reset`.
  void compare_answers(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) {
    AnswerHistory& history = histories_[std::size_t(answer)];
    PairBuffer& found = history.next();
    find_pairs_apart(t, found, Budget{});
    if (answer == Answer::pairs) confirm_candidates(t, found);
    history.take_next(begun, ended);
  }
  /// Sets all counts to zero; called after `reset_to`.
  virtual void start_counting() {}
  /// Returns the counts since `start_counting`, without triangle tests and bytes.
  virtual Counters counted() const { return {}; }

  /// Returns whether this instance is timed (be_timed).
  bool is_timed() const { return timed_; }
  /// Returns the time of the last `reset` or `advance`, or the end of the last span or sweep.
  double time() const { return time_; }
  /// Returns the time before `time()`; equal to it after `reset`.
  double previous_time() const { return previous_time_; }

  SceneView<S> scene_;
  SampledMotion<S> sampled_;
  TriangleTestStats triangle_stats_;

 private:
  /// The interfaces from which the class derives; null for the others.
  struct Abilities {
    AnswersSpans<S>* spans;
    AnswersSweeps<S>* sweeps;
    AnswersRays<S>* rays;
    AnswersProbes<S>* probes;
    TakesPlanChanges<S>* plan_changes;
    TakesGeometryChanges<S>* geometry_changes;
    EventSource<S>* events;
    AnswersChanges<S>* changes;
  };
  /// Determined at the first call, because the object is not complete during construction.
  const Abilities& abilities() {
    if (!abilities_)
      abilities_ = {dynamic_cast<AnswersSpans<S>*>(this),     dynamic_cast<AnswersSweeps<S>*>(this),
                    dynamic_cast<AnswersRays<S>*>(this),      dynamic_cast<AnswersProbes<S>*>(this),
                    dynamic_cast<TakesPlanChanges<S>*>(this), dynamic_cast<TakesGeometryChanges<S>*>(this),
                    dynamic_cast<EventSource<S>*>(this),      dynamic_cast<AnswersChanges<S>*>(this)};
    return *abilities_;
  }
  template <class Interface>
  static Interface& able(Interface* interface, const char* what) {
    if (interface == nullptr) throw std::logic_error(std::string("this strategy does not declare ") + what);
    return *interface;
  }
  /// Finds candidates, without those that are no pair because their bodies have one vertex set.
  QueryStatus find_pairs_apart(double t, PairBuffer& out, const Budget& budget) {
    const std::size_t before = out.size();
    const QueryStatus status = find_candidates(t, out, budget);
    remove_incident_pairs(out, before);
    return status;
  }
  void remove_incident_pairs(PairBuffer& pairs, std::size_t from) const {
    if (!may_find_incident_) return;
    remove_incident(scene_, pairs, from,
                    [](const PrimitivePair& pair) -> const PrimitivePair& { return pair; });
  }
  void check_not_before(double t) const {
    const double earliest = between_frames_ ? earliest_ : time_;
    if (!(t >= earliest) || !std::isfinite(t))
      throw std::invalid_argument("cannot advance from t = " + number_text(earliest) + " back to " +
                                  number_text(t));
  }
  void move_to(double t) {
    check_not_before(t);
    previous_time_ = time_;
    time_ = t;
    between_frames_ = false;
  }
  void stand_at(double t) const {
    if (between_frames_)
      throw std::invalid_argument("asked for t = " + number_text(t) +
                                  ", but the strategy stands between frames, after an event");
    if (t != time_)
      throw std::invalid_argument("asked for t = " + number_text(t) + ", but the strategy stands at " +
                                  number_text(time_));
  }

  double time_ = 0, previous_time_ = 0;
  double earliest_ = 0;  ///< earliest time of the next `advance`, between frames
  bool between_frames_ = false;
  bool timed_ = false;
  bool may_find_incident_;      ///< the scene asks for pairs of two bodies over one vertex set
  AnswerHistory histories_[2];  ///< [Answer] of `compare_answers`
  std::optional<Abilities> abilities_;
};

/// A strategy that counts its work in a table.
template <class S>
class CountedStrategy : public Strategy<S> {
 public:
  using Strategy<S>::Strategy;

 protected:
  /// Clears counts that are kept outside `count_`; called when counts are cleared.
  virtual void counts_cleared() {}
  /// Adds counts that are kept outside `count_` to `table`: entries of the enum, or the strategy's own
  /// counters (Counters::add).
  virtual void add_counts(Counters& /*table*/) const {}

  /// Returns where queries of rays count the bodies that they enter or skip; null for timed instances.
  RayBodies* ray_bodies() { return this->is_timed() ? nullptr : &ray_bodies_; }

  Counters count_;

 private:
  void start_counting() final {
    count_ = {};
    ray_bodies_ = {};
    first_fetch_ = this->sampled_.fetched();
    counts_cleared();
  }
  Counters counted() const final {
    Counters table = count_;
    table[Counter::positions_fetched] += this->sampled_.fetched() - first_fetch_;
    add_counts(table);
    if (ray_bodies_.entered + ray_bodies_.hidden + ray_bodies_.unmet > 0) {
      table.add("ray_bodies_entered", ray_bodies_.entered);
      table.add("ray_bodies_hidden", ray_bodies_.hidden);
      table.add("ray_bodies_unmet", ray_bodies_.unmet);
    }
    return table;
  }

  std::uint64_t first_fetch_ = 0;
  RayBodies ray_bodies_;
};

// Compiled once, in strategy.cpp, instead of with every strategy.
extern template class Strategy<float>;
extern template class Strategy<double>;
extern template class CountedStrategy<float>;
extern template class CountedStrategy<double>;

/// One topology per body; empty for strategies that build their own.
using Topologies = std::vector<Topology>;

}  // namespace kbvh
