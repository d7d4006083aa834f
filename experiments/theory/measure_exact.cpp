#include "experiments/theory/measure_exact.hpp"

#include <algorithm>

#include "experiments/scenes/shapes.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"

namespace kbvh::theory {

namespace {

/// Returns whether `vertex` is further out than `realiser`.
template <class Where>
bool ahead(const ExactMotion& motion, const Where& where, std::uint32_t side, std::uint32_t vertex,
           std::uint32_t realiser) {
  if (vertex == realiser) return false;
  const int sign = motion.compare(where, int(side / 2), vertex, realiser);
  return (side % 2 == 1 ? sign : -sign) > 0;
}

/// Counts candidates of a bound that are further out than its realiser, or returns 1 if the realiser is not a
/// candidate itself. If the count is zero at every node, every realiser is an extremum of all vertices below,
/// by induction from the leaves.
template <class Where>
std::uint64_t exceeded(const EventSource<float>& source, const LeafVertices& leaves,
                       const ExactMotion& motion, const Where& where, std::uint32_t body, std::uint32_t node,
                       std::uint32_t side, std::uint64_t& compared) {
  const std::uint32_t realiser = source.realiser(body, node, side);
  std::uint64_t faults = 0;
  bool known = false;
  const auto check = [&](std::uint32_t candidate) {
    known = known || candidate == realiser;
    faults += ahead(motion, where, side, candidate, realiser);
  };
  const TopologyNode n = source.tree(body).nodes[node];
  if (n.is_leaf())
    for (const std::uint32_t v : leaves[node]) check(v);
  else
    for (std::uint32_t child = n.first(); child < n.first() + n.count(); ++child)
      check(source.realiser(body, child, side));
  ++compared;
  return faults + !known;
}

/// Audits while a clip is recorded: all bounds at each stop, the touched path after each event.
class Auditor {
 public:
  Auditor(const Scene<float>& scene, ExactRun& run) : scene_(&scene), run_(&run) {
    const std::vector<double> keyframes = overlaid_keyframes(scene);
    for (const Body<float>& body : scene.bodies)
      motions_.emplace_back(stored_plans(body.plans), keyframes.front(), keyframes.back());
  }

  void event(const EventSource<float>& source, const EventDescription<float>& done) {
    find_leaves(source);
    const ScheduledEvent<float>& event = done.event;
    const ExactMotion& motion = motions_[event.body];
    const When when = when_of(event.crossing, motion);
    std::uint32_t node = event.node;
    for (;;) {
      const bool passed = source.realiser(event.body, node, event.side) == event.loser;
      run_->path_faults += exceeded(source, leaves_[event.body], motion, when, event.body, node, event.side,
                                    run_->path_bounds);
      if (node == 0 || !passed) break;
      node = source.tree(event.body).parents[node];
    }
  }

  void stop(const EventSource<float>& source, double t) {
    find_leaves(source);
    ++run_->audited_instants;
    for (std::uint32_t body = 0; body < motions_.size(); ++body) {
      const When when = motions_[body].locate(exact(std::min(t, last_time(body))));
      for (std::uint32_t node = 0; node < source.tree(body).size(); ++node)
        for (std::uint32_t side = 0; side < 6; ++side)
          run_->faults +=
              exceeded(source, leaves_[body], motions_[body], when, body, node, side, run_->audited);
    }
  }

 private:
  void find_leaves(const EventSource<float>& source) {
    if (!leaves_.empty()) return;
    for (std::uint32_t body = 0; body < motions_.size(); ++body)
      leaves_.push_back(unique_leaf_vertices(source.tree(body), scene_->bodies[body].primitives));
  }
  double last_time(std::uint32_t body) const { return motions_[body].times()[motions_[body].last_row()]; }
  const Scene<float>* scene_;
  ExactRun* run_;
  std::vector<ExactMotion> motions_;
  std::vector<LeafVertices> leaves_;  ///< [body]
};

/// Counts events whose changes all last for no time: the next change of the same bound has the same instant.
std::uint64_t momentary(const Case& one, std::size_t bounds) {
  std::vector<std::size_t> next_of_bound(bounds, one.log.size());
  std::vector<std::uint64_t> lasting;
  std::uint64_t all = 0;
  for (std::size_t i = one.log.size(); i-- > 0;) {
    const BoundChange& change = one.log[i];
    std::size_t& next = next_of_bound[6 * std::size_t(change.node) + change.side];
    if (next == one.log.size() || !(one.log[next].when == change.when)) lasting.push_back(one.events[i]);
    next = i;
    all += i == 0 || one.events[i - 1] != one.events[i];
  }
  std::sort(lasting.begin(), lasting.end());
  lasting.erase(std::unique(lasting.begin(), lasting.end()), lasting.end());
  return all - lasting.size();
}

}  // namespace

ExactRun measure_exact(const Scene<float>& scene, std::uint32_t instants) {
  ExactRun run;
  run.scene = scene.name;
  run.triangles = scene.primitive_count();
  run.vertices = scene.vertex_count();
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  run.keyframes = keyframes.size();
  Play play{paper_builder, 1};
  const scenes::SeededNoise noise(200);
  for (std::uint32_t i = 0; i < instants; ++i)
    play.instants.push_back(keyframes.front() +
                            (0.5 + 0.5 * noise.signed_unit(i)) * (keyframes.back() - keyframes.front()));
  const auto recording =
      record_strategy<float>(find_strategy("kinetic_aabb"), scene, {}, play, Auditor(scene, run));
  run.events = recording.events;

  for (const Epoch<float>& epoch : recording.epochs)
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
      try {
        const Case one = make_case(scene, recording, epoch, body);
        run.add(one.check());
        run.momentary_events += momentary(one, 6 * one.below.size());
      } catch (const std::logic_error& error) {
        run.violation = error.what();  // an event whose pieces do not meet, or not in the clip
      }
    }
  return run;
}

namespace {
std::uint64_t exceeded_anywhere(const ExactMotion& motion, const When& when, const VerticesBelow& below,
                                const std::vector<std::uint32_t>& realisers) {
  std::uint64_t faults = 0;
  for (std::size_t node = 0; node < below.size(); ++node)
    for (std::uint32_t side = 0; side < 6; ++side)
      for (const std::uint32_t v : below[node])
        if (ahead(motion, when, side, v, realisers[6 * node + side])) {
          ++faults;
          break;
        }
  return faults;
}

/// Counts stops at which a tree differs from the built tree.
struct SameNodes {
  const Topologies* built;
  std::uint64_t* changes;
  void event(const EventSource<float>&, const EventDescription<float>&) {}
  void stop(const EventSource<float>& source, double) {
    for (std::uint32_t body = 0; body < built->size(); ++body)
      *changes += !(source.tree(body) == (*built)[body]);
  }
};
}  // namespace

PlanRun measure_plan_changes(const Scene<float>& scene, const PlanScript<float>& script,
                             std::uint32_t frames_per_keyframe) {
  PlanRun run{.scene = scene.name, .triangles = scene.primitive_count()};
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Play play{paper_builder, frames_per_keyframe};
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  const Topologies topologies = build_topologies(view, playback, play.builder);
  const auto recording = record_strategy<float>(find_strategy("kinetic_aabb"), scene, script, play,
                                                SameNodes{&topologies, &run.topology_changes});
  run.violation = check(scene, recording).violation;
  run.updates = script.steps.size();
  for (const auto& step : script.steps) run.changed_plans += step.changes.size();
  for (std::size_t e = 1; e < recording.epochs.size(); ++e) {
    const Epoch<float>&before = recording.epochs[e - 1], &after = recording.epochs[e];
    const bool at_keyframe = std::binary_search(keyframes.begin(), keyframes.end(), after.begin);
    run.updates_at_keyframes += at_keyframe;
    (at_keyframe ? run.moved_at_keyframes : run.moved_between) += after.at_change.size();
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
      const VerticesBelow below = vertices_below(recording.topologies[body], scene.bodies[body].primitives);
      const ExactMotion old_motion(before.plans[body], before.begin, before.until);
      const ExactMotion new_motion(after.plans[body], after.begin, after.until);
      run.invalid_before +=
          exceeded_anywhere(old_motion, {old_motion.last_row(), 0, 0}, below, before.end[body]);
      run.invalid_after += exceeded_anywhere(new_motion, {0, 0, 0}, below, after.start[body]);
    }
  }
  return run;
}

}  // namespace kbvh::theory
