// The exact tight AABB tree without a queue, for keyframed motion. At the start of each segment one pass
// finds the sides whose realiser will change in it. The upper envelopes of these few sides give a list of
// stores, sorted by time, that frames apply (core/families/envelope/segment_envelope.hpp). If the whole clip
// is known, the frames of a segment can share the pass for the next segment.
//
// Vertices may move on curves of degree 2 or 3. The envelopes of such a segment are those of curves
// (core/families/envelope/curve_envelope.hpp), and one pass makes them at its start.

#include "core/base/pacer.hpp"
#include "core/contract/registry.hpp"
#include "core/families/envelope/curve_envelope.hpp"
#include "core/families/envelope/realiser_strategy.hpp"
#include "core/families/envelope/segment_envelope.hpp"
#include "core/families/wide/count_boxes.hpp"

namespace kbvh {
namespace {

/// The source of the realisers of one body.
enum class Known : std::uint8_t {
  nothing,   ///< not yet
  at_rest,   ///< unchanged until the segment ends
  envelope,  ///< the envelope of the segment
  curves,    ///< the envelope of the segment, in which vertices move on curves
  refitted,  ///< vertices have their own plans: boxes are refitted at every frame instead
};

/// The state of the segment after the current one.
enum class Next : std::uint8_t {
  nothing,     ///< computed when the segment begins
  translated,  ///< no vertex overtakes another
  envelope,    ///< the envelope is being computed
};

template <class S, Foresight F>
class Envelopes final : public RealiserStrategy<S>, public TakesPlanChanges<S> {
  using Base = RealiserStrategy<S>;
  static constexpr bool ahead = F == Foresight::whole_clip;
  static constexpr std::uint32_t slices = 64;  ///< per segment, for small bodies

 public:
  static constexpr Foresight foresight = F;

  Envelopes(const SceneView<S>& scene, const MotionView<F, S>& motion, Topologies topologies,
            const Params& /*params*/)
      : Base(scene, motion, std::move(topologies)), view_(motion), states_(scene.body_count()) {
    for (std::uint32_t index = 0; index < scene.body_count(); ++index) {
      const auto& hierarchy = this->hierarchy(index);
      states_[index].envelope.assign(hierarchy, ahead ? slices : 1);
      if (motion.has_curves(index)) states_[index].curves.assign(hierarchy);
      if (ahead)
        states_[index].at_end.assign(hierarchy.node_count() * lane_scalars(hierarchy.topology().width), 0);
    }
  }

  void reset_to(double /*t*/) override {
    this->near_bodies_.start_over();
    for (std::uint32_t body = 0; body < states_.size(); ++body) {
      states_[body].known = Known::nothing;
      this->bodies_[body].rows.start_over();
      begin_segment(body);
    }
  }

  void advance_to(double t) override {
    const double step = t - this->previous_time();
    for (std::uint32_t body = 0; body < states_.size(); ++body) {
      State& state = states_[body];
      if (state.known == Known::refitted) {
        refit(body);
      } else if (!(t < state.end)) {
        // A frame that built a full envelope does no look-ahead work.
        if (begin_segment(body)) work_ahead(body, step);
      } else if (state.known == Known::envelope) {
        state.envelope.advance(t, this->bodies_[body].realisers);
        this->new_frame(body);
        work_ahead(body, step);
      } else if (state.known == Known::curves) {
        state.curves.advance(t, this->bodies_[body].realisers);
        this->new_frame(body);
      }
    }
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes) {
      if (states_[change.body].known == Known::refitted) continue;
      states_[change.body].known = Known::refitted;
      states_[change.body].next = Next::nothing;
      this->bodies_[change.body].rows.plans_changed();
      refit(change.body);
    }
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const State& state : states_)
      total += state.envelope.bytes() + state.curves.bytes() + state.at_end.size() * sizeof(std::uint32_t) +
               (state.room[0].capacity() + state.room[1].capacity()) * sizeof(S);
    return total;
  }

 protected:
  void counts_cleared() override {
    for (State& state : states_) {
      state.envelope.clear_counts();
      state.curves.clear_counts();
    }
  }
  void add_counts(Counters& table) const override {
    for (const State& state : states_)
      for (const EnvelopeCounts& counts : {state.envelope.counts(), state.curves.counts()}) {
        table[Counter::certificates_made] += counts.crossings;
        table[Counter::certificates_failed] += counts.stores;
        table[Counter::values_written] += counts.stores;
      }
  }

 private:
  struct State {
    SegmentEnvelope<S> envelope;
    CurveEnvelope<S> curves;
    Known known = Known::nothing;
    double end = 0;          ///< of the segment
    std::vector<S> room[2];  ///< for positions at the segment's ends that are not stored
    Next next = Next::nothing;
    Pacer pacer;           ///< for the next segment's envelope
    WideRealisers at_end;  ///< at the segment's end; complete as far as the next envelope
  };

  /// Tests for equal steps to the last bit: then no vertex overtakes another.
  static bool translates(const SegmentMotion<S>& motion, std::uint32_t body) {
    const std::optional<Translation<S>> step = motion.translation(body);
    return step && step->exact;
  }

  void refit(std::uint32_t body) {
    Base::refit(body);
    const auto& hierarchy = this->hierarchy(body);
    count_boxes(this->count_, hierarchy.topology().size(), hierarchy.leaf_vertex_count());
  }

  /// Enters a new segment at the current time. Returns false if its whole envelope had to be computed now.
  bool begin_segment(std::uint32_t index) {
    State& state = states_[index];
    auto& body = this->bodies_[index];
    const auto& motion = this->motion_;
    const double t = this->time();
    this->new_frame(index);
    const Next foreseen = state.next;
    state.next = Next::nothing;
    if (this->hierarchy(index).empty()) {
      state.end = std::numeric_limits<double>::infinity();
      return true;
    }
    const bool rests = motion.at_rest(index);
    const double begin = rests ? t : motion.lines_begin(index);
    const S* first = motion.positions_on_lines(index, begin, state.room[0]);
    // The realiser of a side at the end of one segment also realises it at the start of the next.
    const bool continues =
        state.known != Known::nothing && (rests ? motion.lines_begin(index) : begin) == state.end;
    if (continues && foreseen == Next::envelope) make_next(index, 1);
    if (!continues)
      find_realisers(this->hierarchy(index), first, body.realisers);
    else if (state.known == Known::envelope)
      state.envelope.advance(state.end, body.realisers);
    else if (state.known == Known::curves)
      state.curves.advance(state.end, body.realisers);
    if (!continues) count_pass(index);
    state.end = motion.lines_end(index);
    if (rests) {
      state.known = Known::at_rest;
      return continues;
    }
    if (motion.on_curves(index)) {
      state.known = Known::curves;
      state.curves.make(this->hierarchy(index), body.realisers, CurvedMotion<S>(motion).curves(index));
      count_pass(index);
      state.curves.advance(t, body.realisers);
      return false;
    }
    const S* last = motion.positions_on_lines(index, state.end, state.room[1]);
    state.known = Known::envelope;
    bool made = true;
    if (continues && foreseen == Next::envelope) {
      state.envelope.take_next();
    } else if ((continues && foreseen == Next::translated) || translates(motion, index)) {
      // The same vector is added exactly to all positions, and rounding is monotone.
      state.envelope.make_empty(begin, state.end);
      this->count_.add(Counter::bodies_translated);
    } else {
      state.envelope.make(this->hierarchy(index), body.realisers, first, last, begin, state.end);
      count_pass(index);
      made = false;
    }
    state.envelope.advance(t, body.realisers);
    if constexpr (ahead) foresee(index);
    return made && continues;
  }

  /// Starts the envelope of the next segment if it will need work.
  void foresee(std::uint32_t index) {
    State& state = states_[index];
    if (!(state.end < std::numeric_limits<double>::infinity()) || !view_.as_in_the_scene(index)) return;
    const SegmentMotion<S> later = view_.from(state.end);
    if (later.at_rest(index) || later.on_curves(index)) return;
    if (translates(later, index)) {
      state.next = Next::translated;
      return;
    }
    state.next = Next::envelope;
    state.pacer = {this->time(), state.end};
    const double next_end = later.lines_end(index);
    // The ends are keyframes, so they need no extra memory.
    state.envelope.start_next(this->hierarchy(index),
                              later.positions_on_lines(index, state.end, state.room[0]),
                              later.positions_on_lines(index, next_end, state.room[1]), next_end);
  }
  /// Works on the next segment so that all frames before it get an equal share, if frames come at equal
  /// steps.
  void work_ahead(std::uint32_t index, double step) {
    const State& state = states_[index];
    if (state.next == Next::envelope) make_next(index, state.pacer.share_due(this->time(), step));
  }
  void make_next(std::uint32_t index, double share) {
    State& state = states_[index];
    auto& body = this->bodies_[index];
    const std::uint32_t before = state.envelope.nodes_left();
    state.envelope.step(this->hierarchy(index), body.realisers, state.at_end, share);
    count_part(index, before, state.envelope.nodes_left());
  }

  void count_pass(std::uint32_t index) { count_part(index, this->hierarchy(index).node_count(), 0); }
  /// Counts a part of a pass, in which the remaining wide nodes fall from `before` to `after`; parts add up
  /// to a pass.
  void count_part(std::uint32_t index, std::uint32_t before, std::uint32_t after) {
    const auto& hierarchy = this->hierarchy(index);
    const auto part = [&](std::uint64_t all) {
      return all * before / hierarchy.node_count() - all * after / hierarchy.node_count();
    };
    this->count_.add(Counter::nodes_visited, part(hierarchy.topology().size()));
    this->count_.add(Counter::vertex_reads, part(hierarchy.leaf_vertex_count()));
  }

  MotionView<F, S> view_;
  std::vector<State> states_;
};

template <class S>
using KineticEnvelope = Envelopes<S, Foresight::next_keyframe>;
template <class S>
using KineticEnvelopeAhead = Envelopes<S, Foresight::whole_clip>;

Info info_of(std::string id, std::string title) {
  return {
      .id = std::move(id),
      .title = std::move(title),
      .family = "kinetic",
      .citation =
          "kbvh; upper envelopes of lines and curves instead of the event queue of Zachmann & Weller 2006, "
          "s.4",
      .positions = PositionUse::fetched,
      .declares = {.event_driven = true, .continuous = true, .time_budget = true, .curves = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 8}},
  };
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_envelope) {
  using namespace kbvh;
  return {
      make_entry<KineticEnvelope>(info_of("kinetic_envelope", "kinetic AABB tree, envelopes")),
      make_entry<KineticEnvelopeAhead>(
          info_of("kinetic_envelope_ahead", "kinetic AABB tree, envelopes computed ahead")),
  };
}
