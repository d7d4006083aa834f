#include "experiments/theory/measure_separation.hpp"

#include <algorithm>
#include <set>

#include "core/families/separation/overlap_clock.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/stepped_strategy.hpp"

namespace kbvh::theory {

namespace {

/// The paper's separation list on its own queue.
struct PaperList : SteppedStrategy {
  PaperList(const SceneView<float>& view, Playback<float>& playback, const Topologies& topologies, double t)
      : SteppedStrategy("kinetic_separation_list", {{"queue", "avl"}}, view, playback, topologies, t) {}
};

/// Computes a side of a box at t, widened as in the list: at the knots of its piece.
Rational side_at(const FlightPlans<float>& plans, std::uint32_t vertex, int axis, Widening widening,
                 double t) {
  Piece<float> piece = plans.piece_after(vertex, axis, t);
  const auto widened = [&](float x) { return widening == Widening::up ? widened_up(x) : -widened_up(-x); };
  if (widening != Widening::none) {
    piece.x0 = widened(piece.x0);
    if (piece.kind == PieceKind::chord || piece.x1 != 0) piece.x1 = widened(piece.x1);
  }
  const ExactLine line = exact_line(piece);
  return line.x0 + line.slope * (exact(t) - line.t0);
}

/// Compares the list with the result of a simultaneous traversal at one time.
class ListAudit {
 public:
  /// The strategy must stand at t.
  ListAudit(PaperList& paper, const Scene<float>& scene, double t)
      : strategy_(&paper.strategy()), source_(&paper.source()), scene_(&scene), t_(t) {}

  /// Counts entries that are in only one of the two, and overlapping leaves that only one of list and query
  /// has. Adds the number of entries of the list to `entries`.
  std::uint64_t differences(std::uint64_t& entries) {
    fresh_.clear();
    for (const BodyPair& bodies : scene_->pairs) descend({bodies.first, 0, bodies.second, 0});
    std::vector<WatchedPair> watched;
    source_->watched_pairs(watched);
    std::set<WatchedPair> kept;
    for (const WatchedPair& pair : watched)
      if (pair.listed) kept.insert(pair);
    entries += kept.size();
    std::vector<WatchedPair> off;
    std::set_symmetric_difference(fresh_.begin(), fresh_.end(), kept.begin(), kept.end(),
                                  std::back_inserter(off));
    return off.size() + differences_of_query(kept);
  }

 private:
  /// Counts pairs of primitives that only one of query and overlapping leaves of the list has. Each leaf has
  /// one primitive.
  std::uint64_t differences_of_query(const std::set<WatchedPair>& kept) const {
    PairBuffer expected, found, off;
    for (const WatchedPair& pair : kept)
      if (pair.overlapping) expected.push_back(primitives_of(pair));
    strategy_->candidates_at(t_, found, {});
    std::sort(expected.begin(), expected.end());
    std::sort(found.begin(), found.end());
    std::set_symmetric_difference(expected.begin(), expected.end(), found.begin(), found.end(),
                                  std::back_inserter(off));
    return off.size();
  }
  PrimitivePair primitives_of(const WatchedPair& pair) const {
    const auto primitive = [&](std::uint32_t body, std::uint32_t node) {
      const Topology& topology = source_->tree(body);
      const TopologyNode n = topology.nodes[node];
      return n.is_leaf() ? topology.primitives[n.first()] : no_vertex;  // no primitive: a fault of the list
    };
    return {pair.body, primitive(pair.body, pair.node), pair.other_body,
            primitive(pair.other_body, pair.other_node)};
  }

  void descend(WatchedPair pair) {
    const TopologyNode a = source_->tree(pair.body).nodes[pair.node],
                       b = source_->tree(pair.other_body).nodes[pair.other_node];
    pair.overlapping = overlap(pair);
    if (!pair.overlapping || (a.is_leaf() && b.is_leaf())) {
      pair.listed = true;
      fresh_.insert(pair);
      return;
    }
    const std::uint32_t first_a = a.is_leaf() ? pair.node : a.first(),
                        end_a = a.is_leaf() ? first_a + 1 : first_a + a.count();
    const std::uint32_t first_b = b.is_leaf() ? pair.other_node : b.first(),
                        end_b = b.is_leaf() ? first_b + 1 : first_b + b.count();
    for (std::uint32_t i = first_a; i < end_a; ++i)
      for (std::uint32_t j = first_b; j < end_b; ++j) descend({pair.body, i, pair.other_body, j});
  }
  bool overlap(const WatchedPair& pair) const {
    const auto side_of_a = [&](std::uint32_t side, Widening widening) {
      return side_at(plans(pair.body), source_->realiser(pair.body, pair.node, side), int(side / 2), widening,
                     t_);
    };
    const auto side_of_b = [&](std::uint32_t side) {
      return side_at(plans(pair.other_body), source_->realiser(pair.other_body, pair.other_node, side),
                     int(side / 2), Widening::none, t_);
    };
    for (std::uint32_t lower = 0; lower < 6; lower += 2) {
      const std::uint32_t upper = lower + 1;
      if (side_of_a(upper, Widening::up) < side_of_b(lower) ||
          side_of_b(upper) < side_of_a(lower, Widening::down))
        return false;
    }
    return true;
  }
  const FlightPlans<float>& plans(std::uint32_t body) const { return scene_->bodies[body].plans; }

  Strategy<float>* strategy_;
  const EventSource<float>* source_;
  const Scene<float>* scene_;
  double t_;
  std::set<WatchedPair> fresh_;
};

std::uint64_t most_pairs_of_a_box(const EventSource<float>& source, std::uint32_t bodies) {
  std::vector<std::vector<std::uint64_t>> pairs;
  for (std::uint32_t body = 0; body < bodies; ++body) pairs.emplace_back(source.tree(body).size(), 0);
  std::vector<WatchedPair> watched;
  source.watched_pairs(watched);
  std::uint64_t most = 0;
  for (const WatchedPair& pair : watched)
    most = std::max({most, ++pairs[pair.body][pair.node], ++pairs[pair.other_body][pair.other_node]});
  return most;
}

}  // namespace

SeparationRun measure_separation(const Scene<float>& scene, std::uint32_t instants) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  PaperList paper(view, playback, build_topologies(view, playback, paper_builder), keyframes.front());
  SeparationRun run{.scene = scene.name, .polygons = scene.primitive_count()};

  std::vector<double> stops = keyframes;
  const scenes::SeededNoise noise(13);
  std::vector<double> audits;
  for (std::uint32_t i = 0; i < instants; ++i)
    audits.push_back(keyframes.front() +
                     (0.5 + 0.5 * noise.signed_unit(i)) * (keyframes.back() - keyframes.front()));
  std::sort(audits.begin(), audits.end());
  stops.insert(stops.end(), audits.begin(), audits.end());
  std::sort(stops.begin(), stops.end());
  for (const double t : stops) {
    playback.seek(t);
    for (;;) {
      const Counters before = paper.strategy().counters();
      if (!paper.step(t)) break;
      const Counters after = paper.strategy().counters();
      const auto added = [&](Counter c) { return after[c] - before[c]; };
      SeparationRun::Kind& kind = added(Counter::overlap_events) > 0         ? run.overlap
                                  : added(Counter::parents_apart_events) > 0 ? run.parents
                                  : added(Counter::leaves_apart_events) > 0  ? run.leaves
                                                                             : run.changes;
      ++kind.events;
      kind.pairs += added(Counter::nodes_visited);
      kind.most_pairs = std::max(kind.most_pairs, added(Counter::nodes_visited));
      const std::uint64_t steps = added(Counter::queue_steps), operations = added(Counter::queue_operations);
      kind.steps += steps;
      kind.operations += operations;
      if (operations > 0)
        kind.most_steps_per_operation =
            std::max(kind.most_steps_per_operation, double(steps) / double(operations));
    }
    paper.strategy().advance(t);
    if (!std::binary_search(audits.begin(), audits.end(), t)) {
      run.most_of_box = std::max(run.most_of_box, most_pairs_of_a_box(paper.source(), view.body_count()));
      continue;
    }
    run.differences += ListAudit(paper, scene, t).differences(run.entries);
    ++run.audits;
  }
  run.list_peak = paper.counted(Counter::list_peak);
  run.queue_peak = paper.counted(Counter::queue_peak);
  run.bytes = paper.strategy().bytes();
  return run;
}

ListSizeRun measure_list_size(const Scene<float>& scene) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  PaperList paper(view, playback, build_topologies(view, playback, paper_builder), keyframes.front());
  ListSizeRun run{.scene = scene.name, .polygons = scene.primitive_count()};
  std::vector<WatchedPair> watched;
  for (const std::size_t k : {std::size_t(0), keyframes.size() / 2, keyframes.size() - 1}) {
    playback.seek(keyframes[k]);
    paper.strategy().reset(keyframes[k]);
    paper.source().watched_pairs(watched);
    std::uint64_t list = 0, overlapping = 0;
    for (const WatchedPair& pair : watched) {
      list += pair.listed;
      overlapping += pair.listed && pair.overlapping;
    }
    run.list = std::max(run.list, list);
    run.overlapping = std::max(run.overlapping, overlapping);
  }
  return run;
}

}  // namespace kbvh::theory
