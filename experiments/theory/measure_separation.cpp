#include "experiments/theory/measure_separation.hpp"

#include <algorithm>
#include <set>
#include <tuple>

#include "core/families/separation/kinetic_collision.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"

namespace kbvh::theory {

namespace {

using Collision = KineticCollision<float, AvlEventQueue, Counting>;

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
  ListAudit(const Collision& collision, const SceneView<float>& view, double t)
      : collision_(&collision), view_(view), t_(t) {}

  /// Counts entries that are in only one of the two.
  std::uint64_t differences(std::uint64_t& entries) {
    std::uint64_t wrong = 0;
    for (std::uint32_t i = 0; i < view_.pairs().size(); ++i) {
      fresh_.clear();
      std::set<Entry> kept, leaves;
      descend(view_.pairs()[i], 0, 0);
      for (const auto& pair : collision_->list().pairs())
        if (pair.used && pair.children == Collision::List::none && pair.bodies == i)
          kept.insert({pair.a, pair.b, pair.overlapping});
      for (const auto& leaf : collision_->list().leaf_pairs(i)) leaves.insert({leaf.a, leaf.b, true});
      std::vector<Entry> off;
      std::set_symmetric_difference(fresh_.begin(), fresh_.end(), kept.begin(), kept.end(),
                                    std::back_inserter(off));
      wrong += off.size();
      for (const Entry& entry : kept) wrong += std::get<2>(entry) != leaves.contains(entry);
      entries += kept.size();
    }
    return wrong;
  }

 private:
  using Entry =
      std::tuple<std::uint32_t, std::uint32_t, bool>;  // nodes, and whether they are overlapping leaves

  void descend(const BodyPair& bodies, std::uint32_t a, std::uint32_t b) {
    const TopologyNode na = tree(bodies.first).topology().nodes[a],
                       nb = tree(bodies.second).topology().nodes[b];
    const bool meet = overlap(bodies, a, b);
    if (!meet || (na.is_leaf() && nb.is_leaf())) {
      fresh_.insert({a, b, meet});
      return;
    }
    const std::uint32_t first_a = na.is_leaf() ? a : na.first(),
                        end_a = na.is_leaf() ? a + 1 : first_a + na.count();
    const std::uint32_t first_b = nb.is_leaf() ? b : nb.first(),
                        end_b = nb.is_leaf() ? b + 1 : first_b + nb.count();
    for (std::uint32_t i = first_a; i < end_a; ++i)
      for (std::uint32_t j = first_b; j < end_b; ++j) descend(bodies, i, j);
  }
  bool overlap(const BodyPair& bodies, std::uint32_t a, std::uint32_t b) const {
    const auto &plans_a = plans(bodies.first), &plans_b = plans(bodies.second);
    const std::uint32_t *ra = tree(bodies.first).realisers(a), *rb = tree(bodies.second).realisers(b);
    for (int axis = 0; axis < 3; ++axis)
      if (side_at(plans_a, ra[2 * axis + 1], axis, Widening::up, t_) <
              side_at(plans_b, rb[2 * axis], axis, Widening::none, t_) ||
          side_at(plans_b, rb[2 * axis + 1], axis, Widening::none, t_) <
              side_at(plans_a, ra[2 * axis], axis, Widening::down, t_))
        return false;
    return true;
  }
  const Collision::Forest::Tree& tree(std::uint32_t body) const { return collision_->forest().tree(body); }
  const FlightPlans<float>& plans(std::uint32_t body) const {
    return collision_->forest().clock().plans(body);
  }

  const Collision* collision_;
  SceneView<float> view_;
  double t_;
  std::set<Entry> fresh_;
};

std::uint64_t most_pairs_of_a_box(const Collision& collision, const SceneView<float>& view) {
  std::vector<std::vector<std::uint64_t>> pairs;
  for (std::uint32_t body = 0; body < view.body_count(); ++body)
    pairs.emplace_back(collision.forest().tree(body).topology().size(), 0);
  std::uint64_t most = 0;
  for (const auto& pair : collision.list().pairs()) {
    if (!pair.used) continue;
    const BodyPair& bodies = view.pairs()[pair.bodies];
    most = std::max({most, ++pairs[bodies.first][pair.a], ++pairs[bodies.second][pair.b]});
  }
  return most;
}

}  // namespace

SeparationRun measure_separation(const Scene<float>& scene, std::uint32_t instants) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  Counting count;
  Collision collision(view, ClipMotion<float>(playback), build_topologies(view, playback, paper_builder),
                      count);
  collision.reset(keyframes.front());
  count.table = {};
  SeparationRun run;
  run.scene = scene.name;
  run.polygons = scene.primitive_count();
  run.list_peak = collision.list().size();

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
    while (collision.due(t)) {
      const Counters before = count.table;
      const std::uint64_t steps = collision.queue_steps();
      collision.handle_next();
      const auto added = [&](Counter c) { return count.table[c] - before[c]; };
      SeparationRun::Kind& kind = added(Counter::overlap_events) > 0         ? run.overlap
                                  : added(Counter::fathers_apart_events) > 0 ? run.fathers
                                  : added(Counter::leaves_apart_events) > 0  ? run.leaves
                                                                             : run.changes;
      ++kind.events;
      kind.pairs += added(Counter::nodes_visited);
      kind.most_pairs = std::max(kind.most_pairs, added(Counter::nodes_visited));
      kind.steps += collision.queue_steps() - steps;
      const std::uint64_t operations = added(Counter::queue_operations);
      kind.operations += operations;
      if (operations > 0)
        kind.most_steps_per_operation = std::max(
            kind.most_steps_per_operation, double(collision.queue_steps() - steps) / double(operations));
      run.list_peak = std::max<std::uint64_t>(run.list_peak, collision.list().size());
    }
    if (!std::binary_search(audits.begin(), audits.end(), t)) {
      run.most_of_box = std::max(run.most_of_box, most_pairs_of_a_box(collision, view));
      continue;
    }
    run.differences += ListAudit(collision, view, t).differences(run.entries);
    ++run.audits;
  }
  run.queue_peak = count.table[Counter::queue_peak];
  run.bytes = collision.list().bytes();
  return run;
}

ListSizeRun measure_list_size(const Scene<float>& scene) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  Counting count;
  Collision collision(view, ClipMotion<float>(playback), build_topologies(view, playback, paper_builder),
                      count);
  ListSizeRun run;
  run.scene = scene.name;
  run.polygons = scene.primitive_count();
  for (const std::size_t k : {std::size_t(0), keyframes.size() / 2, keyframes.size() - 1}) {
    playback.seek(keyframes[k]);
    collision.reset(keyframes[k]);
    std::uint64_t overlapping = 0;
    for (std::size_t i = 0; i < view.pairs().size(); ++i)
      overlapping += collision.list().leaf_pairs(i).size();
    run.list = std::max<std::uint64_t>(run.list, collision.list().size());
    run.overlapping = std::max(run.overlapping, overlapping);
  }
  return run;
}

}  // namespace kbvh::theory
