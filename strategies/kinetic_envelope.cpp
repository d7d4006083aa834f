// The exact tight AABB tree without a queue, for keyframed motion: at the begin of each segment one pass
// finds the sides whose realiser will change in it, and the upper envelopes of these few give a list of
// stores, sorted by time, that frames carry out (core/kinetic/segment_envelope.hpp).

#include "core/kinetic/realiser_strategy.hpp"
#include "core/kinetic/segment_envelope.hpp"
#include "core/registry.hpp"

namespace kbvh {
namespace {

/// How the realisers of one body are known.
enum class Known : std::uint8_t {
  nothing,   ///< not yet
  at_rest,   ///< they stay what they are until the segment ends
  envelope,  ///< as the envelope of the segment says
  refitted,  ///< vertices have plans of their own: boxes are refitted at every frame instead
};

template <class S, class Count>
class KineticEnvelope final : public RealiserStrategy<S, Count> {
  using Base = RealiserStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  KineticEnvelope(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                  const Params& /*params*/)
      : Base(scene, motion, std::move(topologies)), states_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      states_[body].envelope.assign(this->bodies_[body].hierarchy);
  }

  void reset(double t) override {
    this->start_at(t);
    for (std::uint32_t body = 0; body < states_.size(); ++body) {
      states_[body].known = Known::nothing;
      begin_segment(body);
    }
    this->count_.table = {};
    for (State& state : states_) state.envelope.clear_counts();
    first_fetch_ = this->sampled_.fetched();
  }

  void advance(double t) override {
    this->move_to(t);
    for (std::uint32_t body = 0; body < states_.size(); ++body) {
      State& state = states_[body];
      if (state.known == Known::refitted) {
        refit(body);
      } else if (!(t < state.end)) {
        begin_segment(body);
      } else if (state.known == Known::envelope) {
        state.envelope.advance(t, this->bodies_[body].realisers);
        this->new_frame(body);
      }
    }
  }

  void flight_plans_changed(double t, std::span<const PlanChange<S>> changes) override {
    this->stand_at(t);
    for (const PlanChange<S>& change : changes) {
      if (states_[change.body].known == Known::refitted) continue;
      states_[change.body].known = Known::refitted;
      this->bodies_[change.body].line_ends[0] = nullptr;
      refit(change.body);
    }
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const State& state : states_)
      total += state.envelope.bytes() + (state.room[0].capacity() + state.room[1].capacity()) * sizeof(S);
    return total;
  }

 protected:
  Counters counted() const override {
    Counters table = this->count_.table;
    if constexpr (Count::enabled) {
      table[Counter::positions_fetched] += this->sampled_.fetched() - first_fetch_;
      for (const State& state : states_) {
        const EnvelopeCounts& counts = state.envelope.counts();
        table[Counter::certificates_made] += counts.crossings;
        table[Counter::certificates_failed] += counts.stores;
        table[Counter::values_written] += counts.stores;
      }
    }
    return table;
  }

 private:
  struct State {
    SegmentEnvelope<S> envelope;
    Known known = Known::nothing;
    double end = 0;          ///< of the segment
    std::vector<S> room[2];  ///< for positions at its ends that are not stored as they are
  };

  void refit(std::uint32_t body) {
    Base::refit(body);
    const auto& hierarchy = this->bodies_[body].hierarchy;
    this->count_.add(Counter::nodes_visited, hierarchy.topology().size());
    this->count_.add(Counter::values_written, std::uint64_t(6) * hierarchy.topology().size());
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }

  /// The present time is in a segment that was not looked at before.
  void begin_segment(std::uint32_t index) {
    State& state = states_[index];
    auto& body = this->bodies_[index];
    const auto& motion = this->motion_;
    const double t = this->time();
    this->new_frame(index);
    if (body.hierarchy.empty()) {
      state.end = std::numeric_limits<double>::infinity();
      return;
    }
    const bool rests = motion.at_rest(index);
    const double begin = rests ? t : motion.lines_begin(index);
    const S* first = motion.positions_on_lines(index, begin, state.room[0]);
    // Who realises a side at the end of one segment does so at the begin of the next.
    const bool goes_on =
        state.known != Known::nothing && (rests ? motion.lines_begin(index) : begin) == state.end;
    if (!goes_on)
      find_realisers(body.hierarchy, first, body.realisers);
    else if (state.known == Known::envelope)
      state.envelope.advance(state.end, body.realisers);
    if (!goes_on) count_pass(index);
    state.end = motion.lines_end(index);
    if (rests) {
      state.known = Known::at_rest;
      body.line_ends[0] = nullptr;
      return;
    }
    const S* last = motion.positions_on_lines(index, state.end, state.room[1]);
    state.known = Known::envelope;
    state.envelope.make(body.hierarchy, body.realisers, first, last, begin, state.end);
    count_pass(index);
    state.envelope.advance(t, body.realisers);
    body.line_ends[0] = first;
    body.line_ends[1] = last;
    body.line_times[0] = begin;
    body.line_times[1] = state.end;
  }
  void count_pass(std::uint32_t index) {
    const auto& hierarchy = this->bodies_[index].hierarchy;
    this->count_.add(Counter::nodes_visited, hierarchy.topology().size());
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }

  std::vector<State> states_;
  std::uint64_t first_fetch_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_envelope) {
  using namespace kbvh;
  return {make_entry<KineticEnvelope>({
      .id = "kinetic_envelope",
      .title = "kinetic AABB tree, envelopes",
      .family = "kinetic",
      .citation = "kbvh; upper envelopes of lines instead of the event queue of Zachmann & Weller 2006, s.4",
      .positions = PositionUse::fetched,
      .can = {.event_driven = true, .continuous = true, .plan_changes = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4}},
  })};
}
