#include "experiments/theory/measure_curves.hpp"

#include <algorithm>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/families/events/algebraic_clock.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/event_log.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "experiments/theory/kinetic_log.hpp"

namespace kbvh::theory {

namespace {

using Forest = KineticForest<float, AnyEventQueue<AlgebraicClock<float>>, BoundObserver<float>>;

/// The changes of one bound in the segment that it is in.
struct Bound {
  double segment = 0;
  std::uint64_t changes = 0;
};

}  // namespace

std::uint64_t degree_of(const Scene<float>& scene) {
  std::uint64_t degree = 1;
  for (const Body<float>& body : scene.bodies)
    for (std::size_t k = 0; k + 1 < body.plans.keyframe_count(); ++k)
      if (body.plans.curved_in(k))
        degree = std::max<std::uint64_t>(degree, body.plans.twists(k) != nullptr ? 3 : 2);
  return degree;
}

double most_pieces(std::uint64_t order, std::uint64_t n) {
  if (order <= 1) return double(n);
  if (order == 2) return 2 * double(n) - 1;
  double sum = 1;
  for (std::uint64_t i = 1; i < n; ++i) sum += 2 / double(i);
  return double(n) * sum;
}

CurveRun measure_curves(const Scene<float>& scene) {
  CurveRun run{.scene = scene.name, .order = degree_of(scene)};
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  Counters count;
  BoundWatch<float> watch;
  std::vector<BoundNotice<float>> log;
  watch.log = &log;
  Forest forest(view, ClipMotion<float>(playback),
                build_topologies(view, playback, {.method = BuildMethod::median, .width = 2, .leaf_size = 1}),
                count, BoundObserver<float>{&watch});
  std::vector<VerticesBelow> below;
  std::vector<std::vector<Bound>> bounds;
  for (std::uint32_t body = 0; body < forest.size(); ++body) {
    const Body<float>& one = scene.bodies[body];
    run.triangles += one.primitives.count();
    run.vertices += one.plans.vertex_count();
    run.segments = std::max<std::uint64_t>(run.segments, one.plans.keyframe_count() - 1);
    below.push_back(vertices_below(forest.tree(body).topology(), one.primitives));
    bounds.emplace_back(std::size_t(6) * below.back().size());
    run.bounds += bounds.back().size();
    run.pieces += bounds.back().size() * (one.plans.keyframe_count() - 1);
  }
  const auto finish = [&](std::uint32_t body, std::size_t at) {
    const std::size_t n = below[body][at / 6].size();
    const double most = most_pieces(run.order, n) - 1;
    const auto changes = bounds[body][at].changes;
    run.most_changes = std::max(run.most_changes, changes);
    run.over_lambda += double(changes) > most ? 1 : 0;
    if (n >= 8) run.fullest = std::max(run.fullest, double(changes) / most);
  };
  const double first = overlaid_keyframes(scene).front(), last = overlaid_keyframes(scene).back();
  playback.seek(first);
  forest.reset(first);
  log.clear();
  while (forest.due(last)) {
    forest.handle_next();
    ++run.events;
    run.changes += log.size();
    for (const BoundNotice<float>& notice : log) {
      const std::size_t at = std::size_t(6) * notice.node + notice.side;
      Bound& bound = bounds[notice.body][at];
      if (notice.begin != bound.segment) {  // of a curved body: the start of the event's segment
        finish(notice.body, at);
        bound = {notice.begin, 0};
      }
      ++bound.changes;
    }
    log.clear();
  }
  for (std::uint32_t body = 0; body < forest.size(); ++body)
    for (std::size_t at = 0; at < bounds[body].size(); ++at) finish(body, at);
  return run;
}

}  // namespace kbvh::theory
