#pragma once
#include <algorithm>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/families/events/kinetic_forest.hpp"
#include "core/judge/session.hpp"
#include "experiments/theory/envelope.hpp"

namespace kbvh::theory {

/// A change notice as it came, with the numbers of its instant copied.
template <class S>
struct Notice {
  std::uint32_t body, node, side, old_vertex, new_vertex;
  double begin;
  bool at_event;
  Crossing<S> crossing;
  std::uint64_t event;  ///< how many events were handled before this one; not part of what is compared

  bool operator==(const Notice& other) const {
    const auto same = [](const Piece<S>& a, const Piece<S>& b) {
      return a.t0 == b.t0 && a.t1 == b.t1 && a.x0 == b.x0 && a.x1 == b.x1 && a.kind == b.kind;
    };
    return body == other.body && node == other.node && side == other.side && old_vertex == other.old_vertex &&
           new_vertex == other.new_vertex && at_event == other.at_event &&
           (at_event
                ? same(crossing.winner, other.crossing.winner) && same(crossing.loser, other.crossing.loser)
                : begin == other.begin);
  }
};

template <class S>
struct Recorder {
  std::vector<Notice<S>>* log;
  const std::uint64_t* event;

  template <class T>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<T>& now) {
    log->push_back({body, node, side, old_vertex, new_vertex, now.begin, now.exact != nullptr,
                    now.exact != nullptr ? *now.exact : Crossing<S>{}, *event});
  }
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

/// What happened between two changes of plans (or the ends of the clip): the plans that held, the notices of
/// the change that led here, and the log of events.
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

/// Which part of a clip is played, and how.
struct Play {
  BuilderConfig builder;
  std::uint32_t frames_per_keyframe = 1;
  double start_after = 0;          ///< fraction of the clip that is skipped
  std::vector<double> instants{};  ///< further times to stop at
  std::vector<double> frames{};    ///< ascending; empty: as frames_per_keyframe says
};

/// Told what a kinetic forest does while it is recorded: `event` after each one it handled, `stop` at each
/// time that it was brought to (frames, instants), and before and after each change of plans.
struct NoWatcher {
  template <class Forest>
  void event(const Forest&, const Event&) {}
  template <class Forest>
  void stop(const Forest&, double) {}
};

/// Plays a scene, with plan changes if there are any, through a kinetic forest and keeps all that its
/// observer was told. Throws std::bad_alloc where the log does not fit: 100 bytes and more per change.
template <class S, template <class> class Queue, class Watcher = NoWatcher>
Recording<S> record(const Scene<S>& scene, const PlanScript<S>& script, const Play& play,
                    Watcher&& watcher = {}) {
  using Forest = KineticForest<S, Queue<S>, Counting, Recorder<S>>;
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
  std::vector<Notice<S>> log;
  std::uint64_t handled = 0;
  Counting count;
  Forest forest(view, ClipMotion<S>(playback), recording.topologies, count, Recorder<S>{&log, &handled});
  forest.reset(first);
  const auto advance = [&](double t) {
    while (forest.due(t)) {
      const Event event = forest.queue().top();
      forest.handle_next();
      watcher.event(forest, event);
      ++handled;
    }
    watcher.stop(forest, t);
  };

  const std::uint32_t bodies = view.body_count();
  const auto realisers = [&] {
    std::vector<std::vector<std::uint32_t>> all(bodies);
    for (std::uint32_t body = 0; body < bodies; ++body)
      if (const auto& tree = forest.tree(body); !tree.topology().empty())
        all[body].assign(tree.realisers(0), tree.realisers(0) + std::size_t(6) * tree.topology().size());
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
    forest.plans_changed(t, step->changes);
    ++step;
    epoch.begin = t;
    epoch.before = epoch.end;
    epoch.at_change = std::move(log);
    log.clear();
    epoch.start = realisers();
  }
  // Past the last keyframe bodies rest; plans of their own go on.
  last += script.steps.empty() ? 1.0 : 3.0;
  advance(last);
  close(last);
  recording.events = count.table[Counter::certificates_failed];
  recording.values_written = count.table[Counter::values_written];
  return recording;
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

/// Where the crossing of an event's pieces lies.
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

/// Everything the check of one body in one epoch takes; seeded faults spoil a copy of `log`.
struct Case {
  ExactMotion motion;
  VerticesBelow below;
  std::vector<std::uint32_t> start, end;
  std::vector<BoundChange> log;
  std::vector<std::uint64_t> events;  ///< of each entry: which event it belongs to

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

/// The notices at a change of plans: from the state before to the state after, each a gain in value at once.
template <class S>
std::string check_change(const Epoch<S>& epoch, std::uint32_t body, const Case& now) {
  std::vector<std::uint32_t> state = epoch.before[body];
  for (const Notice<S>& notice : epoch.at_change) {
    if (notice.body != body) continue;
    const std::string name = "change at " + std::to_string(epoch.begin) + ", node " +
                             std::to_string(notice.node) + " side " + std::to_string(notice.side);
    std::uint32_t& realiser = state[6 * std::size_t(notice.node) + notice.side];
    if (notice.at_event || notice.begin != epoch.begin) return name + ": not at the change's own time";
    if (realiser != notice.old_vertex) return name + ": passes on what it does not have";
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
        // An event whose pieces do not meet, or not in the clip.
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
