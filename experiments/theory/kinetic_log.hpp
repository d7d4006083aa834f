#pragma once
#include <algorithm>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/judge/session.hpp"
#include "experiments/theory/envelope.hpp"

namespace kbvh::theory {

/// A change of a bound as reported by an event source.
template <class S>
struct Notice : BoundNotice<S> {
  std::uint64_t event = 0;  ///< number of earlier events; not part of comparisons

  bool operator==(const Notice& other) const {
    return static_cast<const BoundNotice<S>&>(*this) == static_cast<const BoundNotice<S>&>(other);
  }
};

/// The record between two changes of plans (or the ends of the clip): the valid plans, the notices of the
/// change at its start, and the log of events.
template <class S>
struct Epoch {
  double begin = 0, until = 0;
  std::vector<StoredPlans> plans;                              // [body]
  std::vector<std::vector<std::uint32_t>> before, start, end;  // [body][6 * node + side]
  std::vector<Notice<S>> at_change, events;
};

template <class S>
struct Recording {
  std::vector<Topology> topologies;
  std::vector<Epoch<S>> epochs;
  std::uint64_t events = 0, values_written = 0;

  std::vector<Notice<S>> log() const {
    std::vector<Notice<S>> all;
    for (const auto& epoch : epochs) {
      all.insert(all.end(), epoch.at_change.begin(), epoch.at_change.end());
      all.insert(all.end(), epoch.events.begin(), epoch.events.end());
    }
    return all;
  }
};

template <class S>
StoredPlans stored_plans(const FlightPlans<S>& plans) {
  StoredPlans stored;
  stored.vertex_count = plans.vertex_count();
  stored.times.assign(plans.keyframe_times().begin(), plans.keyframe_times().end());
  for (std::size_t k = 0; k < stored.times.size(); ++k)
    stored.positions.insert(stored.positions.end(), plans.keyframe(k),
                            plans.keyframe(k) + std::size_t(3) * stored.vertex_count);
  return stored;
}

/// The played part of a clip, and its stops.
struct Play {
  BuilderConfig builder;
  std::uint32_t frames_per_keyframe = 1;
  double start_after = 0;          ///< skipped fraction of the clip
  std::vector<double> instants{};  ///< further times to stop at
  std::vector<double> frames{};    ///< ascending; empty: from frames_per_keyframe
};

/// Observes a strategy while it is recorded: `event` after each event, with its description, and `stop` at
/// each time that the strategy was brought to (frames, instants).
struct NoWatcher {
  template <class S>
  void event(const EventSource<S>&, const EventDescription<S>&) {}
  template <class S>
  void stop(const EventSource<S>&, double) {}
};

/// Plays a scene, with plan changes if given, through a strategy that is an event source, event by event, and
/// records every change of a bound. `make(view, playback, topologies)` makes the strategy. Throws
/// std::bad_alloc if the log does not fit: at least 100 bytes per change.
template <class S, class Make, class Watcher>
Recording<S> record_events(const Scene<S>& scene, const PlanScript<S>& script, const Play& play, Make&& make,
                           Watcher&& watcher) {
  const SceneView<S> view(scene);
  std::vector<double> frames =
      play.frames.empty() ? frame_times(scene, play.frames_per_keyframe) : play.frames;
  frames.insert(frames.end(), play.instants.begin(), play.instants.end());
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  const double first = frames.front() + play.start_after * (frames.back() - frames.front());
  std::erase_if(frames, [&](double t) { return t <= first; });

  Playback<S> playback(scene);
  playback.seek(first);
  Recording<S> recording;
  recording.topologies = build_topologies(view, playback, play.builder);
  const std::unique_ptr<Strategy<S>> strategy = make(view, playback, recording.topologies);
  EventSource<S>* const source = strategy->events();
  if (source == nullptr)
    throw std::logic_error("a strategy without events cannot be recorded event by event");
  strategy->reset(first);
  std::vector<BoundNotice<S>> told;
  source->watch_bounds(&told);
  std::vector<Notice<S>> log;
  std::uint64_t handled = 0;
  const auto keep = [&] {
    for (const BoundNotice<S>& notice : told) log.push_back({notice, handled});
    told.clear();
  };
  EventDescription<S> done;
  const auto advance = [&](double t) {
    while (strategy->step_event(t, done)) {
      keep();
      ++handled;
      watcher.event(*source, done);
    }
    strategy->advance(t);
    watcher.stop(*source, t);
  };

  const std::uint32_t bodies = view.body_count();
  const auto realisers = [&] {
    std::vector<std::vector<std::uint32_t>> all(bodies);
    for (std::uint32_t body = 0; body < bodies; ++body)
      for (std::uint32_t node = 0; node < source->tree(body).size(); ++node)
        for (std::uint32_t side = 0; side < 6; ++side)
          all[body].push_back(source->realiser(body, node, side));
    return all;
  };
  Epoch<S> epoch;
  epoch.begin = first;
  for (std::uint32_t body = 0; body < bodies; ++body)
    epoch.plans.push_back(stored_plans(scene.bodies[body].plans));
  epoch.before = epoch.start = realisers();
  const auto close = [&](double t) {
    epoch.until = t;
    epoch.events = std::move(log);
    log.clear();
    epoch.end = realisers();
    recording.epochs.push_back(epoch);
  };

  auto step = script.steps.begin();
  while (step != script.steps.end() && step->time < first) ++step;
  frames.insert(frames.begin(), first);
  double last = first;
  for (double t : frames) {
    playback.seek(t);
    advance(t);
    last = t;
    if (step == script.steps.end() || step->time != t) continue;
    close(t);
    for (const PlanChange<S>& change : step->changes) {
      OwnKnots knots;
      const S* position = playback.position(change.body, change.vertex);
      knots.times = {t};
      knots.positions.assign(position, position + 3);
      knots.times.insert(knots.times.end(), change.times.begin(), change.times.end());
      knots.positions.insert(knots.positions.end(), change.positions.begin(), change.positions.end());
      std::copy(change.velocity, change.velocity + 3, knots.velocity);
      epoch.plans[change.body].own[change.vertex] = knots;
    }
    playback.change_plans(t, step->changes);
    strategy->flight_plans_changed(t, step->changes);
    keep();
    ++step;
    epoch.begin = t;
    epoch.before = epoch.end;
    epoch.at_change = std::move(log);
    log.clear();
    epoch.start = realisers();
  }
  // Past the last keyframe bodies rest; vertices' own plans continue.
  last += script.steps.empty() ? 1.0 : 3.0;
  playback.seek(last);
  advance(last);
  close(last);
  const Counters counters = strategy->counters();
  recording.events = counters[Counter::certificates_failed];
  recording.values_written = counters[Counter::values_written];
  return recording;
}

/// Records a registered strategy that is an event source.
template <class S, class Watcher = NoWatcher>
Recording<S> record_strategy(const StrategyEntry& entry, const Scene<S>& scene, const PlanScript<S>& script,
                             const Play& play, Watcher&& watcher = {},
                             const std::map<std::string, std::string>& params = {}) {
  return record_events(
      scene, script, play,
      [&](const SceneView<S>& view, Playback<S>& playback, const Topologies& topologies) {
        return create(entry, view, playback, topologies,
                      Params(entry.info.id, entry.info.parameters, params));
      },
      watcher);
}

inline VerticesBelow vertices_below(const Topology& topology, const Primitives& primitives) {
  VerticesBelow below(topology.size());
  for (std::uint32_t node = topology.size(); node-- > 0;) {
    const TopologyNode n = topology.nodes[node];
    auto& own = below[node];
    for (std::uint32_t i = n.first(); i < n.first() + n.count(); ++i) {
      const auto add = [&own](const auto& part) { own.insert(own.end(), part.begin(), part.end()); };
      if (n.is_leaf())
        add(primitives[topology.primitives[i]]);
      else
        add(below[i]);
    }
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
  }
  return below;
}

template <class S>
ExactLine exact_line(const Piece<S>& piece) {
  const Rational t0 = exact(piece.t0), x0 = exact(double(piece.x0)), x1 = exact(double(piece.x1));
  if (piece.kind == PieceKind::ray) return {t0, x0, x1};
  return {t0, x0, (x1 - x0) / (exact(piece.t1) - t0)};
}

/// Locates the crossing of an event's pieces.
template <class S>
When when_of(const Crossing<S>& crossing, const ExactMotion& motion) {
  const Piece<S>&w = crossing.winner, &l = crossing.loser;
  if (w.kind == PieceKind::chord && l.kind == PieceKind::chord && w.t0 == l.t0 && w.t1 == l.t1) {
    const auto& times = motion.times();
    const auto at = std::lower_bound(times.begin(), times.end(), w.t0);
    if (at + 1 < times.end() && *at == w.t0 && at[1] == w.t1) {
      // The same root in units of the row, without the detour over seconds.
      When when{std::size_t(at - times.begin()), meeting_fraction(w.x0, w.x1, l.x0, l.x1), 0};
      when.hint = static_cast<double>(when.u);
      if (when.u == 1) return {when.row + 1, 0, 0};
      return when;
    }
  }
  return motion.locate(meeting_time(exact_line(w), exact_line(l)));
}

/// The input of the check of one body in one epoch; seeded faults alter a copy of `log`.
struct Case {
  ExactMotion motion;
  VerticesBelow below;
  std::vector<std::uint32_t> start, end;
  std::vector<BoundChange> log;
  std::vector<std::uint64_t> events;  ///< of each entry: the number of its event

  EnvelopeReport check() const { return check_envelopes(motion, below, start, log, end); }
};

template <class S>
Case make_case(const Scene<S>& scene, const Recording<S>& recording, const Epoch<S>& epoch,
               std::uint32_t body) {
  Case result{ExactMotion(epoch.plans[body], epoch.begin, epoch.until),
              vertices_below(recording.topologies[body], scene.bodies[body].primitives),
              epoch.start[body],
              epoch.end[body],
              {},
              {}};
  const Notice<S>* before = nullptr;
  for (const Notice<S>& notice : epoch.events) {
    if (notice.body != body) continue;
    BoundChange change{notice.node, notice.side, notice.old_vertex, notice.new_vertex, {}};
    // One event climbs through several nodes.
    const bool same = before != nullptr && before->side == notice.side && before->begin == notice.begin &&
                      before->old_vertex == notice.old_vertex && before->new_vertex == notice.new_vertex;
    change.when = same ? result.log.back().when : when_of(notice.crossing, result.motion);
    before = &notice;
    result.log.push_back(std::move(change));
    result.events.push_back(notice.event);
  }
  return result;
}

/// Checks the notices at a change of plans: from the state before to the state after, each an immediate gain
/// in value.
template <class S>
std::string check_change(const Epoch<S>& epoch, std::uint32_t body, const Case& now) {
  std::vector<std::uint32_t> state = epoch.before[body];
  for (const Notice<S>& notice : epoch.at_change) {
    if (notice.body != body) continue;
    const std::string name = "change at " + std::to_string(epoch.begin) + ", node " +
                             std::to_string(notice.node) + " side " + std::to_string(notice.side);
    std::uint32_t& realiser = state[6 * std::size_t(notice.node) + notice.side];
    if (notice.at_event || notice.begin != epoch.begin) return name + ": not at the change's own time";
    if (realiser != notice.old_vertex) return name + ": passes on a bound that it does not have";
    const int order = now.motion.compare(std::size_t(0), int(notice.side / 2), notice.new_vertex, realiser);
    if ((notice.side % 2 == 1 ? order : -order) <= 0) return name + ": gains nothing";
    realiser = notice.new_vertex;
  }
  return state == epoch.start[body] ? "" : "realisers changed without a notice at a change of plans";
}

template <class S>
EnvelopeReport check(const Scene<S>& scene, const Recording<S>& recording) {
  EnvelopeReport total;
  for (const Epoch<S>& epoch : recording.epochs) {
    for (const Notice<S>& notice : epoch.events)
      if (!notice.at_event) total.violation = "an event without an exact time";
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
      EnvelopeReport report;
      try {
        const Case one = make_case(scene, recording, epoch, body);
        report = one.check();
        if (report.holds()) report.violation = check_change(epoch, body, one);
      } catch (const std::logic_error& error) {
        // An event whose pieces do not meet, or not within the clip.
        report.violation = error.what();
      }
      if (!report.violation.empty())
        report.violation =
            "from " + std::to_string(epoch.begin) + " body " + std::to_string(body) + ": " + report.violation;
      total.add(report);
    }
  }
  return total;
}

}  // namespace kbvh::theory
