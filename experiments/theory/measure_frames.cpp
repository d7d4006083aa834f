#include <algorithm>
#include <stdexcept>

#include "core/judge/audit.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"

namespace kbvh::theory {

namespace {

/// Returns the values written by a registered strategy over frames after the first, on the paper's topology.
std::uint64_t values_written(const Scene<float>& scene, const char* id, std::span<const double> frames) {
  Contestant contestant;
  contestant.entry = &find_strategy(id);
  contestant.builder = paper_builder;
  Session<float> session(scene, contestant);
  session.reset(frames.front());
  PhaseTimes times;
  for (const double t : frames.subspan(1)) session.advance(t, times);
  return session.strategy().counters()[Counter::values_written];
}

/// Counts notices per frame, and per bound and frame.
struct FrameCount {
  std::vector<std::vector<std::uint32_t>> of_bound;  ///< [body][6 * node + side], since the frame began
  std::vector<std::pair<std::uint32_t, std::uint32_t>> touched;
  std::uint64_t values = 0;
  std::uint32_t most = 0;

  void add(std::uint32_t body, std::uint32_t node, std::uint32_t side) {
    const std::uint32_t bound = 6 * node + side;
    touched.emplace_back(body, bound);
    most = std::max(most, ++of_bound[body][bound]);
    ++values;
  }
  void new_frame() {
    for (const auto& [body, bound] : touched) of_bound[body][bound] = 0;
    touched.clear();
    values = 0;
    most = 0;
  }
};
/// Compares frame by frame with bottom-up, which writes every bound of every moving body in every frame.
void compare_frames(const Scene<float>& scene, std::span<const double> frames, FrameRun& run) {
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  playback.seek(frames.front());
  const Topologies topologies = build_topologies(view, playback, paper_builder);
  FrameCount count;
  std::uint64_t bottom_up = 0;
  for (const Topology& topology : topologies) {
    count.of_bound.emplace_back(std::size_t(6) * topology.size(), 0);
    bottom_up += std::uint64_t(6) * topology.size();
  }
  const StrategyEntry& entry = find_strategy("kinetic_aabb");
  const auto strategy =
      create(entry, view, playback, topologies, Params(entry.info.id, entry.info.parameters, {}));
  strategy->reset(frames.front());
  std::vector<BoundNotice<float>> told;
  strategy->events()->watch_bounds(&told);
  for (const double t : frames.subspan(1)) {
    count.new_frame();
    told.clear();
    playback.seek(t);
    strategy->advance(t);
    for (const BoundNotice<float>& notice : told) count.add(notice.body, notice.node, notice.side);
    const bool worse = count.values > bottom_up, repeated = count.most > 1;
    run.worse_frames += worse;
    run.repeated_frames += repeated;
    run.worse_without_repeat += worse && !repeated;
    run.most_of_bound = std::max<std::uint64_t>(run.most_of_bound, count.most);
    run.worst_share = std::max(run.worst_share, double(count.values) / double(bottom_up));
  }
}

/// Classifies whether winner and loser coincided at the start of the segment of their event.
struct Classify {
  TranslationRun* run;
  const Scene<float>* scene;
  void event(const EventSource<float>&, const EventDescription<float>& done) {
    const ScheduledEvent<float>& event = done.event;
    const FlightPlans<float>& plans = scene->bodies[event.body].plans;
    const float* stored = plans.keyframe(plans.segment_at(event.crossing.winner.t0));
    const auto axis = std::size_t(event.side / 2);
    run->separated_ties +=
        stored[3 * std::size_t(event.winner) + axis] == stored[3 * std::size_t(event.loser) + axis];
  }
  void stop(const EventSource<float>&, double) {}
};

}  // namespace

std::vector<FrameRun> measure_frames(const Scene<float>& scene, std::span<const std::uint32_t> ls) {
  std::vector<FrameRun> runs;
  std::vector<Notice<float>> first_log;
  for (const std::uint32_t l : ls) {
    const std::vector<double> frames = frame_times(scene, l);
    FrameRun run{.scene = scene.name, .triangles = scene.primitive_count()};
    run.l = l;
    run.frames = frames.size() - 1;
    const auto recording =
        record_strategy<float>(find_strategy("kinetic_aabb"), scene, {}, Play{paper_builder, l});
    run.events = recording.events;
    run.values = recording.values_written;
    auto log = recording.log();
    if (runs.empty()) first_log = std::move(log);
    run.same_log = runs.empty() || log == first_log;
    run.bottom_up_values = values_written(scene, "bottom_up", frames);
    compare_frames(scene, frames, run);
    runs.push_back(run);
  }
  return runs;
}

TranslationRun measure_translation(const Scene<float>& scene, std::uint64_t rounded) {
  TranslationRun run;
  run.scene = scene.name;
  run.exact = rounded == 0;
  run.rounded = rounded;
  run.triangles = scene.primitive_count();
  run.vertices = scene.vertex_count();
  run.keyframes = overlaid_keyframes(scene).size();
  run.events = record_strategy<float>(find_strategy("kinetic_aabb"), scene, {}, Play{paper_builder, 1},
                                      Classify{&run, &scene})
                   .events;
  return run;
}

namespace {

/// A box per node over all keyframes, and boxes at keyframes as flight plans: the lower corner of node i is
/// vertex 2 i, the upper corner 2 i + 1. Straight lines between them contain the node's vertices at all times
/// in between, because a maximum of lines lies below the chord of its ends.
struct LooseBoxes {
  std::vector<Box<double>> swept;
  FlightPlans<float> linear;
};

LooseBoxes loose_boxes(const Body<float>& body, const Topology& topology) {
  LooseBoxes boxes;
  boxes.swept.resize(topology.size());
  const auto times = body.plans.keyframe_times();
  std::vector<float> corners;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const auto tight = tight_boxes(topology, body.primitives, body.plans.keyframe(k));
    for (std::uint32_t node = 0; node < topology.size(); ++node) {
      boxes.swept[node].extend(tight[node]);
      // Exact: sides of tight boxes are coordinates of vertices.
      for (const double x : tight[node].lower) corners.push_back(float(x));
      for (const double x : tight[node].upper) corners.push_back(float(x));
    }
  }
  boxes.linear = FlightPlans<float>(2 * topology.size(), {times.begin(), times.end()}, std::move(corners));
  return boxes;
}

}  // namespace

LooseRun measure_loose(const Scene<float>& scene, std::uint32_t l) {
  const SceneView<float> view(scene);
  const std::vector<double> frames = frame_times(scene, l);
  Playback<float> playback(scene);
  playback.seek(frames.front());
  const Topologies topologies = build_topologies(view, playback, paper_builder);
  LooseRun run{.scene = scene.name, .triangles = scene.primitive_count()};
  run.l = l;
  run.frames = frames.size();
  run.segments = overlaid_keyframes(scene).size() - 1;
  Audit swept, linear;
  for (std::uint32_t b = 0; b < view.body_count(); ++b) {
    const Body<float>& body = scene.bodies[b];
    const Topology& topology = topologies[b];
    run.bounds += std::uint64_t(6) * topology.size();
    run.linear_values += std::uint64_t(6) * topology.size() * body.plans.keyframe_count();
    const LooseBoxes boxes = loose_boxes(body, topology);
    AuditView at_frame{topology, boxes.swept, {}};
    std::vector<float> positions(std::size_t(3) * body.plans.vertex_count()),
        corners(std::size_t(6) * topology.size());
    for (const double t : frames) {
      body.plans.evaluate(t, positions.data());
      at_frame.boxes = boxes.swept;
      swept.add(audit(at_frame, body.primitives, positions.data(), &topology));
      boxes.linear.evaluate(t, corners.data());
      for (std::uint32_t node = 0; node < topology.size(); ++node)
        for (std::size_t axis = 0; axis < 3; ++axis) {
          at_frame.boxes[node].lower[axis] = corners[std::size_t(6) * node + axis];
          at_frame.boxes[node].upper[axis] = corners[std::size_t(6) * node + 3 + axis];
        }
      linear.add(audit(at_frame, body.primitives, positions.data(), &topology));
    }
  }
  run.swept_values = run.bounds;
  run.swept_outside = swept.invalid;
  run.linear_outside = linear.invalid;
  run.swept_looseness = swept.looseness();
  run.linear_looseness = linear.looseness();
  const CountRun counted = measure_counts(scene);
  run.kinetic_events = counted.events;
  run.kinetic_values = counted.values;
  run.bottom_up_values = values_written(scene, "bottom_up", frames);
  return run;
}

}  // namespace kbvh::theory
