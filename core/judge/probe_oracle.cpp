#include "core/judge/probe_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "core/judge/polygon_region.hpp"
#include "core/motion/admissible.hpp"
#include "core/scene/distance_comparison.hpp"

namespace kbvh {

namespace {

std::string text(const RayHit& hit) {
  if (!hit) return "a miss";
  return std::to_string(hit.body) + ":" + std::to_string(hit.primitive) + " at " + number_text(hit.parameter);
}

/// Returns the answer to a ray as if there were no other primitive than that of `found`.
template <class S>
RayHit alone(const Scene<S>& scene, const Playback<S>& playback, const Ray<S>& ray, const RayHit& found) {
  if (found.body >= scene.bodies.size()) return {};
  const Primitives& primitives = scene.bodies[found.body].primitives;
  if (primitives.kind != PrimitiveKind::polygons || found.primitive >= primitives.count() ||
      !primitives.alive(found.primitive))
    return {};
  TriangleTestStats stats;
  RaySearch<S> search(ray, RayQuery::any);
  search.offer(found.body, found.primitive, primitives.triangles(found.primitive),
               playback.positions(found.body), stats);
  return search.hit();
}

}  // namespace

template <class S>
void brute_force_hits(const Scene<S>& scene, Playback<S>& playback, RayQuery query,
                      std::span<const Ray<S>> rays, std::span<RayHit> hits) {
  playback.evaluate_all();
  TriangleTestStats stats;
  PolygonRegions<S> regions(scene, playback);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RaySearch<S> search(rays[i], query);
    RayHit wrongly_cut;
    bool over = false;
    for (std::uint32_t body = 0; body < scene.bodies.size() && !over; ++body) {
      const Primitives& primitives = scene.bodies[body].primitives;
      if (primitives.kind != PrimitiveKind::polygons) continue;
      for (std::uint32_t p = 0; p < primitives.count() && !over; ++p) {
        if (!primitives.alive(p)) continue;
        const PolygonRegion* const region = regions.decides(body, p) ? regions.region(body, p) : nullptr;
        if (region != nullptr) {
          RaySearch<S> alone(rays[i], RayQuery::any);
          const bool met = alone.offer(body, p, primitives.triangles(p), playback.positions(body), stats);
          if (met != region->meets(search.line()))
            wrongly_cut = {body, p, std::numeric_limits<double>::quiet_NaN()};
        }
        over = search.offer(body, p, primitives.triangles(p), playback.positions(body), stats);
      }
    }
    hits[i] = wrongly_cut ? wrongly_cut : search.hit();
  }
}

namespace {

/// Returns whether a ball meets a closed triangle, in exact arithmetic where bounded doubles do not decide.
bool ball_meets(const double* centre, double radius, const double (&corners)[3][3]) {
  for (int axis = 0; axis < 3; ++axis) {
    // The rounding of a difference is monotone, so a rounded gap beyond the radius is a gap beyond it.
    const auto [low, high] = std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
    if (low - centre[axis] > radius || centre[axis] - high > radius) return false;
  }
  const auto compare = [&](auto& distance) {
    using Comparison = std::remove_reference_t<decltype(distance)>;
    return distance.point_triangle(Comparison::point(centre), Comparison::point(corners[0]),
                                   Comparison::point(corners[1]), Comparison::point(corners[2]));
  };
  DistanceComparison<BoundedDouble> filtered(radius);
  const bool met = compare(filtered);
  if (!filtered.undecided()) return met;
  DistanceComparison<Dyadic> exact(radius);
  return compare(exact);
}

}  // namespace

template <class S>
BallHits brute_force_within(const Scene<S>& scene, Playback<S>& playback, std::span<const Ball<S>> balls) {
  playback.evaluate_all();
  BallHits found;
  for (std::uint32_t i = 0; i < balls.size(); ++i) {
    const auto& [at, radius] = balls[i];
    const double centre[3] = {double(at[0]), double(at[1]), double(at[2])};
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
      const Primitives& primitives = scene.bodies[body].primitives;
      if (primitives.kind == PrimitiveKind::control_nets) continue;
      for (std::uint32_t p = 0; p < primitives.count(); ++p) {
        if (!primitives.alive(p)) continue;
        const PolygonTriangles triangles = primitives.triangles(p);
        bool met = false;
        for (std::uint32_t k = 0; k < triangles.count() && !met; ++k) {
          double corners[3][3];
          for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t axis = 0; axis < 3; ++axis)
              corners[c][axis] = double(playback.positions(body)[std::size_t(3) * triangles[k][c] + axis]);
          met = ball_meets(centre, double(radius), corners);
        }
        if (met) found.push_back({i, body, p});
      }
    }
  }
  return found;
}

ProbeCheck compare_within(std::size_t balls, const BallHits& found, const BallHits& truth) {
  ProbeCheck check;
  check.probes = balls;
  check.hits = truth.size();
  BallHits missed, extra;
  std::set_difference(truth.begin(), truth.end(), found.begin(), found.end(), std::back_inserter(missed));
  std::set_difference(found.begin(), found.end(), truth.begin(), truth.end(), std::back_inserter(extra));
  check.missed = missed.size();
  check.extra = extra.size();
  const auto told = [](const BallHit& hit) {
    return "point " + std::to_string(hit.ball) + ": " + std::to_string(hit.body) + ":" +
           std::to_string(hit.primitive);
  };
  if (!missed.empty())
    check.first_violation = told(missed[0]) + " is within the radius, and is missed";
  else if (!extra.empty())
    check.first_violation = told(extra[0]) + " is reported too often, or is not within the radius";
  return check;
}

void ProbeCheck::add(const ProbeCheck& other) {
  probes += other.probes;
  hits += other.hits;
  missed += other.missed;
  extra += other.extra;
  misplaced += other.misplaced;
  rounded += other.rounded;
  parameter_error = std::max(parameter_error, other.parameter_error);
  if (first_violation.empty()) first_violation = other.first_violation;
}

template <class S>
ProbeCheck check_hits(const Scene<S>& scene, Playback<S>& playback, RayQuery query,
                      std::span<const Ray<S>> rays, std::span<const RayHit> found) {
  std::vector<RayHit> truth(rays.size());
  brute_force_hits(scene, playback, RayQuery::closest, rays, std::span<RayHit>(truth));
  return compare_hits(scene, playback, query, rays, found, std::span<const RayHit>(truth));
}

template <class S>
ProbeCheck compare_hits(const Scene<S>& scene, const Playback<S>& playback, RayQuery query,
                        std::span<const Ray<S>> rays, std::span<const RayHit> found,
                        std::span<const RayHit> truth) {
  ProbeCheck check;
  check.probes = rays.size();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    check.hits += truth[i] ? 1 : 0;
    const RayHit right = query == RayQuery::closest || !found[i] || !truth[i]
                             ? truth[i]
                             : alone(scene, playback, rays[i], found[i]);
    if (found[i] == right) continue;
    const bool rounded = found[i] && found[i].body == right.body && found[i].primitive == right.primitive;
    ++(!found[i] ? check.missed : !truth[i] ? check.extra : rounded ? check.rounded : check.misplaced);
    if (rounded && right.parameter != 0)
      check.parameter_error = std::max(
          check.parameter_error, std::abs(found[i].parameter - right.parameter) / std::abs(right.parameter));
    if (check.first_violation.empty())
      check.first_violation =
          "ray " + std::to_string(i) + ": " + text(found[i]) + " instead of " + text(truth[i]);
  }
  return check;
}

#define KBVH_INSTANTIATE(S)                                                                                \
  template BallHits brute_force_within(const Scene<S>&, Playback<S>&, std::span<const Ball<S>>);           \
  template void brute_force_hits(const Scene<S>&, Playback<S>&, RayQuery, std::span<const Ray<S>>,         \
                                 std::span<RayHit>);                                                       \
  template ProbeCheck compare_hits(const Scene<S>&, const Playback<S>&, RayQuery, std::span<const Ray<S>>, \
                                   std::span<const RayHit>, std::span<const RayHit>);                      \
  template ProbeCheck check_hits(const Scene<S>&, Playback<S>&, RayQuery, std::span<const Ray<S>>,         \
                                 std::span<const RayHit>);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
