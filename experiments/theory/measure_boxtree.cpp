#include "experiments/theory/measure_boxtree.hpp"

#include <algorithm>
#include <stdexcept>

#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/stepped_strategy.hpp"

namespace kbvh::theory {

namespace {

/// Returns the realisers of all bounds that a body's tree stores, [6 * node + side]; `no_bound` elsewhere.
std::vector<std::uint32_t> stored_bounds(const EventSource<float>& source, std::uint32_t body) {
  static_assert(no_vertex == no_bound);
  std::vector<std::uint32_t> bounds;
  for (std::uint32_t node = 0; node < source.tree(body).size(); ++node)
    for (std::uint32_t side = 0; side < 6; ++side) bounds.push_back(source.realiser(body, node, side));
  return bounds;
}

/// Counts upper bounds of the certificates of every vertex: per leaf it is a candidate of one certificate per
/// side; for each bound that it realises it is the winner of one, and a candidate of the one above.
void count_vertex_certificates(const Topology& topology, const Primitives& primitives,
                               const std::vector<std::uint32_t>& bounds, std::uint32_t vertices,
                               BoxTreeRun& run) {
  std::vector<std::uint64_t> certificates(vertices, 0), leaves(vertices, 0);
  for (const TopologyNode n : topology.nodes) {
    if (!n.is_leaf()) continue;
    for (std::uint32_t i = n.first(); i < n.first() + n.count(); ++i)
      for (const std::uint32_t v : primitives[topology.primitives[i]]) ++leaves[v], certificates[v] += 6;
  }
  for (const std::uint32_t v : bounds)
    if (v != no_bound) certificates[v] += 2;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    run.max_leaves_of_vertex = std::max(run.max_leaves_of_vertex, leaves[v]);
    run.max_vertex_certificates = std::max(run.max_vertex_certificates, certificates[v]);
  }
}

/// Returns the largest number of scheduled events of the two planes of an inner node: a node's planes are the
/// own sides of its children.
std::uint64_t most_events_of_planes(const EventSource<float>& source,
                                    const std::vector<ScheduledEvent<float>>& events, std::uint32_t bodies) {
  std::uint64_t most = 0;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    const Topology& topology = source.tree(body);
    std::vector<std::uint64_t> scheduled(topology.size(), 0);
    for (const ScheduledEvent<float>& event : events)
      if (event.body == body && event.node != 0)
        most = std::max(most, ++scheduled[topology.parents[event.node]]);
  }
  return most;
}

std::vector<BoundChange> changes_of(const std::vector<BoundNotice<float>>& log, const ExactMotion& motion,
                                    std::uint32_t body) {
  std::vector<BoundChange> result;
  for (const BoundNotice<float>& notice : log)
    if (notice.body == body)
      result.push_back(
          {notice.node, notice.side, notice.old_vertex, notice.new_vertex, when_of(notice.crossing, motion)});
  return result;
}

}  // namespace

BoxTreeRun measure_boxtree(const Scene<float>& scene, const CountRun& counts, Proof proof) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  const Topologies topologies = build_topologies(view, playback, paper_builder);
  BoxTreeRun run{.scene = scene.name, .triangles = scene.primitive_count()};
  run.aabb_events = counts.events, run.aabb_values = counts.values, run.aabb_bytes = counts.bytes;
  run.depth = counts.depth;
  SteppedStrategy paper(
      "kinetic_boxtree",
      {{"queue", "avl"}, {"planes", "start"}, {"candidates", "searched"}, {"leaf_boxes", "inherited"}}, view,
      playback, topologies, keyframes.front());
  const EventSource<float>& source = paper.source();
  run.bytes = paper.strategy().bytes();
  std::vector<std::vector<std::uint32_t>> start;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const Topology& topology = source.tree(body);
    run.nodes += topology.size();
    for (const TopologyNode n : topology.nodes) run.inner_nodes += !n.is_leaf();
    start.push_back(stored_bounds(source, body));
    run.certificates += std::uint64_t(start[body].size()) -
                        std::uint64_t(std::count(start[body].begin(), start[body].end(), no_bound));
    ++run.trees;
  }
  std::vector<ScheduledEvent<float>> scheduled;
  source.scheduled_events(scheduled);
  run.queue_peak = scheduled.size();
  std::vector<BoundNotice<float>> log;
  for (const double t : keyframes) {
    playback.seek(t);
    while (paper.step(t)) {
      run.values += paper.touched().size();
      run.silent_events += paper.touched().empty();
      ++run.events;
      if (proof != Proof::none) log.insert(log.end(), paper.touched().begin(), paper.touched().end());
    }
    paper.strategy().advance(t);
    source.scheduled_events(scheduled);
    run.most_of_planes =
        std::max(run.most_of_planes, most_events_of_planes(source, scheduled, view.body_count()));
  }
  run.queue_peak = std::max(run.queue_peak, paper.counted(Counter::queue_peak));
  run.searches = paper.counted("certificate_searches");
  run.searched = paper.counted("nodes_searched");
  run.most_searched = paper.counted("most_nodes_searched");
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const std::vector<std::uint32_t> end = stored_bounds(source, body);
    count_vertex_certificates(topologies[body], view.primitives(body), end, view.vertex_count(body), run);
    if (proof == Proof::none) continue;
    try {
      const ExactMotion motion(stored_plans(scene.bodies[body].plans), keyframes.front(), keyframes.back());
      const EnvelopeReport report =
          check_envelopes(motion, vertices_below(topologies[body], view.primitives(body)), start[body],
                          changes_of(log, motion, body), end);
      run.proved += report.bounds;
      if (run.violation.empty()) run.violation = report.violation;
    } catch (const std::logic_error& error) {
      run.violation = error.what();  // an event whose pieces do not meet, or not in the clip
    }
  }
  return run;
}

}  // namespace kbvh::theory
