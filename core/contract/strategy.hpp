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

/// What else a strategy can do; calls that it does not declare throw std::logic_error.
struct Capabilities {
  bool event_driven = false;      ///< does work at events rather than at frames
  bool continuous = false;        ///< bounds are valid between frames, too
  bool restructures = false;      ///< changes its topology while it runs
  bool plan_changes = false;      ///< flight_plans_changed
  bool geometry_changes = false;  ///< geometry_changed
  bool spans = false;             ///< answers intervals without looking at frames
  bool self_pairs = false;        ///< pairs within a body; scenes that ask for them are refused else
  bool time_budget = false;       ///< honours a query budget
  bool contacts = false;          ///< swept_pairs: the broad phase of continuous collision detection
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
  Tightness tightness = Tightness::tight;
  Guarantee guarantee = Guarantee::exact;
  PositionUse positions = PositionUse::all;
  Capabilities can{};
  TopologyNeeds topology{};
  std::vector<Parameter> parameters{};
  /// The scalar in which bounds are kept, if it is not the scene's: "float" or "double".
  std::string own_scalar{};
  /// Largest scene it is offered, in primitive pairs of one body pair (quadratic contestants); 0: any.
  std::uint64_t max_primitive_pairs = 0;
  /// A peer library's own, uncertified test of two features in motion (core/continuous/impact.hpp): does it
  /// say that they touch? `kbvh ccd` shows it beside the exact one. Null: it has none.
  bool (*own_impact)(Contact::Kind kind, const MovingPoints& points) = nullptr;
  // Filled in by the registration from the class itself:
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
template <class S>
class Strategy {
 public:
  Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), sampled_(motion) {}
  virtual ~Strategy() = default;
  Strategy(const Strategy&) = delete;
  Strategy& operator=(const Strategy&) = delete;

  /// Starts over at time t (first frame, loops, lessons): everything is valid at t afterwards. Clears
  /// counters.
  virtual void reset(double t) = 0;

  /// Brings the hierarchies to time t; phase "update". Throws std::invalid_argument if t is before the last
  /// time.
  virtual void advance(double t) = 0;

  /// Appends the primitive pairs that may intersect at t, each once, canonical; phase "traversal".
  /// Bounds that are read are valid at t; lazy strategies refresh them here.
  virtual QueryStatus candidates_at(double t, PairBuffer& out, const Budget& budget) = 0;

  /// Keeps the candidates that intersect; phase "triangle tests". By default kbvh's exact test.
  virtual void confirm(double /*t*/, PairBuffer& pairs) {
    confirm_pairs(scene_, sampled_, pairs, triangle_stats_);
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
  virtual void spans(double /*t0*/, double /*t1*/, SpanBuffer& /*out*/) { unsupported("spans"); }

  /// Announces `swept_pairs` for the motion that begins at t, where the strategy and the motion view stand.
  virtual void start_sweep(double t) { stand_at(t); }
  /// Appends the primitive pairs that may touch while every vertex moves on a straight line from its position
  /// at t0 to that at t1, each once, canonical; within one body those that share a vertex, too, for their
  /// other features may touch. `start_sweep` came before; the motion view stands at t1, with all positions,
  /// and `before` are those at t0 ([body], then [vertex][3]). No knot of any plan lies strictly between.
  /// Afterwards the next sweep may be announced from t1, or all begins again with `reset`; frames are not
  /// answered between.
  virtual void swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> /*before*/,
                           PairBuffer& /*out*/) {
    unsupported("contacts");
  }

  /// The plans of some vertices have changed at t; the motion view shows the new ones. Each starts from the
  /// stored position at t. The strategy has been advanced to t before.
  virtual void flight_plans_changed(double /*t*/, std::span<const PlanChange<S>> /*changes*/) {
    unsupported("flight-plan changes");
  }

  /// Vertices and primitives were inserted or deleted at t; ids are stable, and the scene and motion views
  /// show the new geometry (`body_changes` says what that means for each body). The strategy has been
  /// advanced to t before; afterwards everything is valid at t. A later `reset` keeps the present geometry.
  virtual void geometry_changed(double /*t*/, const GeometryChange<S>& /*change*/) {
    unsupported("geometry changes");
  }

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
  virtual Counters counted() const { return {}; }
  /// To be called first by every `reset`. Throws std::invalid_argument if t is not finite.
  void start_at(double t) {
    if (!std::isfinite(t)) throw std::invalid_argument("cannot start at t = " + std::to_string(t));
    triangle_stats_ = {};
    time_ = t;
  }
  /// To be called first by every `advance`. Throws std::invalid_argument if t is before the last time, or not
  /// finite.
  void move_to(double t) {
    if (!(t >= time_) || !std::isfinite(t))
      throw std::invalid_argument("cannot advance from t = " + std::to_string(time_) + " back to " +
                                  std::to_string(t));
    time_ = t;
  }
  /// For calls that need the strategy to stand at t. Throws std::invalid_argument if it does not.
  void stand_at(double t) const {
    if (t != time_)
      throw std::invalid_argument("asked for t = " + std::to_string(t) + ", but the strategy stands at " +
                                  std::to_string(time_));
  }
  /// Of the last `start_at` or `move_to`.
  double time() const { return time_; }
  [[noreturn]] static void unsupported(const char* what) {
    throw std::logic_error(std::string("this strategy does not declare ") + what);
  }

  SceneView<S> scene_;
  SampledMotion<S> sampled_;
  TriangleTestStats triangle_stats_;

 private:
  double time_ = 0;
};

/// One topology per body; empty for strategies that build their own.
using Topologies = std::vector<Topology>;

}  // namespace kbvh
