// Inflated boxes, updated lazily (Mezger, Kimmerle & Etzmuss 2003): leaf boxes exceed their vertices by a
// margin, and stay unchanged until a vertex may have moved through it. If the motion of a body is bounded, no
// vertex is read and no position evaluated before the margin can have been used up: most frames cost one
// addition. Without a bound every frame reads every vertex to find the boxes that vertices have left.
//
// A body has one margin, the sum of some steps and four roundings of its largest coordinate. It therefore
// takes more than 20 times the box tests of `bottom_up` where the boxes of bodies are less than two margins
// apart: sheets that lie over each other without a contact, and bodies far from the origin or with one vertex
// far away.

#include <algorithm>
#include <cmath>

#include "core/base/cost_constants.hpp"
#include "core/contract/registry.hpp"
#include "core/families/drift/drift_body.hpp"
#include "core/families/wide/kernels/wide_inflate.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

enum class MarginKind : std::uint8_t { tuned, absolute, relative };

/// Returns the next larger number, so that sums of bounds stay bounds.
double above(double value) {
  return std::nextafter(value, std::numeric_limits<double>::infinity());
}

/// The state of one body since its vertices were last read.
template <class S>
struct InflatedBody {
  S margin = 0;          // of the boxes computed last
  double leaf_size = 0;  // median side of a leaf's box at the reset, before inflation
  double size = 0;       // the same for the root's box
  double room =
      0;  // minimum distance of every vertex from the sides of all boxes above it, at the last check
  double moved = 0;     // no vertex has moved further since then
  double rounding = 0;  // a stored position differs from the plan by at most this
  double step = 0;      // motion from one frame to the next: the bound, or as observed
  std::uint64_t leaves = 0;
  std::uint64_t tests = 0;  // box tests of the last query that involved this body
  bool checked = false;     // the margins were checked at this frame
  bool query_takes_all =
      false;             // the last query after a frame without a check evaluated all positions itself
  bool changed = false;  // vertices have their own plans: the body no longer counts as resting
  std::vector<std::uint8_t> remade;
};

template <class S>
class InflatedLazy final : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;
  using Body = InflatedBody<S>;

 public:
  static constexpr Foresight foresight = Foresight::step_bound;
  InflatedLazy(const SceneView<S>& scene, const SteppedMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        stepped_(motion),
        kind_(params.word("margin_is") == "tuned"      ? MarginKind::tuned
              : params.word("margin_is") == "absolute" ? MarginKind::absolute
                                                       : MarginKind::relative),
        margin_(params.number("margin")),
        bounded_(params.word("bound") == "step") {
    bodies_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      bodies_[body].remade.assign(this->hierarchies_[body].node_count(), 0);
  }

  void reset_to(double /*t*/) override {
    this->near_bodies_.start_over();
    this->probes_.start_over();
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      this->hierarchies_[index].positions_changed();
      this->sampled_.fetch_all(index);
      body.step = 0;
      body.tests = 0;
      body.margin = 0;
      body.query_takes_all = false;
      check_margins(index, WhichStay::none);
      measure_leaves(index);
      if (!may_move(index)) continue;  // boxes of bodies at rest stay tight
      body.margin = wanted_margin(index);
      if (body.margin > 0) check_margins(index, WhichStay::none);
    }
  }

  void advance_to(double t) override {
    const double before = this->previous_time();
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      bodies_[index].checked = false;
      if (!may_move(index)) continue;
      this->hierarchies_[index].positions_changed();
      if (bounded_)
        advance_bounded(index, before, t);
      else
        advance_scanning(index);
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    for (Body& body : bodies_) body.tests = 0;
    std::uint64_t all = 0;
    this->for_near_bodies(all, [&](const BodyPair& pair) {
      if (all >= budget.box_tests) {
        ++status.pending;
        return;
      }
      std::uint64_t tests = 0;
      status.pending +=
          this->query_.run(this->side(pair.first), this->side(pair.second), out, tests, rest_of(budget, all))
              .pending;
      bodies_[pair.first].tests += tests;
      bodies_[pair.second].tests += tests;
      all += tests;
    });
    this->count_.add(Counter::box_tests, all);
    for (std::uint32_t index = 0; index < bodies_.size(); ++index)
      if (!bodies_[index].checked) bodies_[index].query_takes_all = this->sampled_.all_current(index);
    return status;
  }

  /// The displacement so far stays bounded; rounding errors start again from the stored position.
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes) bodies_[change.body].changed = true;
    for (Body& body : bodies_)
      if (body.changed) body.moved = above(body.moved + body.rounding);
  }

 private:
  enum class WhichStay : std::uint8_t { none, inside_margin };

  bool may_move(std::uint32_t index) const { return this->scene_.moving(index) || bodies_[index].changed; }
  void update(std::uint32_t /*body*/) override {}  // `advance` is overridden instead

  void advance_bounded(std::uint32_t index, double before, double t) {
    Body& body = bodies_[index];
    const double way = stepped_.displacement_bound(index, before, t);
    if (way == 0) return;  // at rest all the way: no position changed
    body.moved = above(body.moved + way);
    // The plan is at most `rounding` from the checked position, and has moved by at most `moved` since. Boxes
    // are numbers of the scalar, so a plan inside rounds to a position inside.
    const bool inside = above(body.moved + body.rounding) <= body.room;
    body.step = stepped_.speed_bound(index) * (t - before);
    if (inside && !(kind_ == MarginKind::tuned && too_large(index))) return;
    body.margin = wanted_margin(index);
    this->sampled_.fetch_all(index);
    check_margins(index, WhichStay::inside_margin);
  }

  void advance_scanning(std::uint32_t index) {
    if (kind_ == MarginKind::tuned) bodies_[index].margin = wanted_margin(index);
    this->sampled_.fetch_all(index);
    check_margins(index, WhichStay::inside_margin);
  }

  /// Reads all vertices below the leaves; recomputes boxes where the margin is used up.
  void check_margins(std::uint32_t index, WhichStay stay) {
    auto& hierarchy = this->hierarchies_[index];
    if (hierarchy.empty()) return;
    Body& body = bodies_[index];
    constexpr S infinity = std::numeric_limits<S>::infinity();
    MarginCheck<S> state{hierarchy.arrays(),
                         hierarchy.node_count(),
                         this->sampled_.positions(index),
                         body.remade.data(),
                         body.margin,
                         infinity,
                         0,
                         0,
                         0,
                         0,
                         0};
    if (stay == WhichStay::inside_margin) {
      // A body that is checked at every frame recomputes only the boxes that vertices have left: it uses the
      // full margin. A body that can skip frames skips more if all its boxes have nearly their whole margin.
      // Resting parts stay unchanged in either case.
      const S used = bounded_ ? body.margin / 32 : body.margin;
      state.keep_from = body.margin - used;
      state.keep_to = body.margin + used;
    }
    wide_inflate_kernels<S>(hierarchy.kernels()).of(hierarchy.topology().width)(state);
    if (!bounded_) {
      // The largest approach of any vertex to a side in one frame.
      const double room_before = double(state.room_before);
      if (stay == WhichStay::inside_margin) body.step = std::max(0.0, body.room - room_before);
    }
    constexpr double unit = std::numeric_limits<S>::epsilon() / 2;
    body.room = double(state.room) * (1 - 4 * unit);
    body.moved = 0;
    body.checked = true;
    const Box<S> root = hierarchy.box(0);
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis)
      largest = std::max({largest, std::abs(double(root.lower[axis])), std::abs(double(root.upper[axis]))});
    body.rounding = above(largest * unit) + double(std::numeric_limits<S>::denorm_min());
    this->count_.add(Counter::nodes_visited, body.leaves + state.inner_boxes);
    this->count_.add(Counter::values_written, 6 * (state.leaf_boxes + state.inner_boxes));
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }

  /// Measures the median side of the leaves' boxes before inflation.
  void measure_leaves(std::uint32_t index) {
    const auto& hierarchy = this->hierarchies_[index];
    std::vector<double> sides;
    bodies_[index].leaf_size = usual_leaf_side(hierarchy, sides);
    bodies_[index].leaves = sides.size();
    if (sides.empty()) return;
    const Box<S> root = hierarchy.box(0);
    bodies_[index].size = 0;
    for (int axis = 0; axis < 3; ++axis)
      bodies_[index].size += (double(root.upper[axis]) - double(root.lower[axis])) / 3;
  }

  S wanted_margin(std::uint32_t index) const {
    const Body& body = bodies_[index];
    double margin = margin_;
    if (kind_ == MarginKind::relative) margin *= body.leaf_size;
    if (kind_ == MarginKind::tuned) margin = margin_for(body, best_steps(index));
    return S(std::min(margin, double(admissible_magnitude<S>)));
  }
  /// Returns a margin for `steps` steps, roundings and the tolerance of `check_margins`.
  static double margin_for(const Body& body, double steps) {
    return steps == 0 ? 0 : (steps * body.step + 4 * body.rounding) * (1 + 1.0 / 16);
  }

  // The tuned margin weighs the cost of a check against the extra query cost of larger boxes. Both are
  // counts, so the margin does not depend on a machine or its load. A margin of k steps needs one check in k
  // + 1 frames. Where surfaces of leaves with median side a meet, boxes that are larger by m on every side
  // cost about (1 + m / a)^2 as much to query, and 1 + 0.4 m / a as many tests (measured on sheets; the
  // remaining cost is leaves opened in vain). Among many small bodies a margin also adds neighbours, in
  // proportion to the growth of the body's box, so a body without contact at the last query may then have
  // some.

  using Cost = costs::InflatedBoxes;

  /// Returns the cost of a check, in box tests. Positions count only if the query would not evaluate all of
  /// them anyway. A check that is due at every frame costs only its writes.
  double check_cost(std::uint32_t index) const {
    const double each = !bounded_                        ? Cost::writing
                        : bodies_[index].query_takes_all ? Cost::reading
                                                         : Cost::reading + Cost::evaluating;
    return each * this->scene_.vertex_count(index);
  }
  double query_cost(const Body& body, double margin) const {
    const double side = 1 + margin / body.leaf_size;
    double tests = double(body.tests) / (1 + Cost::opened * double(body.margin) / body.leaf_size);
    if (this->near_bodies_.searches() && body.size > 0) {
      const auto neighbours = [&](double m) { return std::pow(1 + 2 * m / body.size, 3); };
      tests = std::max(tests, Cost::meeting) * neighbours(margin) / neighbours(double(body.margin));
    }
    return tests * side * side;
  }
  double best_steps(std::uint32_t index) const {
    const Body& body = bodies_[index];
    if (!(body.leaf_size > 0)) return 0;
    double best = 0, least = std::numeric_limits<double>::infinity();
    for (const double steps : {0., 1., 2., 3., 4., 6., 8., 12., 16., 24., 32., 48., 64.}) {
      const double cost = check_cost(index) / (steps + 1) + query_cost(body, margin_for(body, steps));
      if (!(cost < least)) continue;
      best = steps;
      least = cost;
    }
    return best;
  }
  /// Returns whether, compared with the best margin, the current one cost the last query more than a check.
  bool too_large(std::uint32_t index) const {
    const Body& body = bodies_[index];
    if (!(body.leaf_size > 0)) return false;
    return query_cost(body, double(body.margin)) - query_cost(body, margin_for(body, best_steps(index))) >
           check_cost(index);
  }

  SteppedMotion<S> stepped_;
  MarginKind kind_;
  double margin_;
  bool bounded_;
  std::vector<Body> bodies_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(inflated_lazy) {
  using namespace kbvh;
  return {make_entry<InflatedLazy>({
      .id = "inflated_lazy",
      .title = "inflated boxes, lazy refit",
      .family = "lazy",
      .citation = "Mezger, Kimmerle & Etzmuss 2003",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters =
          {{"margin_is",
            "tuned",
            {"tuned", "absolute", "relative"},
            "unit of `margin`: unused, because the margin follows from the motion and the last query's work; "
            "units of the scene; or a fraction of the median side of the leaves' boxes at the reset"},
           {"margin", "0.1", {}, "inflation of leaf boxes on every side"},
           {"bound",
            "step",
            {"step", "scan"},
            "test whether a margin is used up: by the caller's bound on the motion, which skips frames, or "
            "by reading every vertex"}},
  })};
}
