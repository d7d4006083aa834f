#include "core/scene/with_radius.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/motion/admissible.hpp"
#include "core/motion/error_free.hpp"

namespace kbvh {
namespace {

/// Returns the largest S that is at most a + b; no negative zero.
template <class S>
S sum_rounded_down(S a, S b) {
  const TwoPart<S> sum = two_sum(a, b);
  const S rounded = sum.lo < 0 ? std::nextafter(sum.hi, -std::numeric_limits<S>::infinity()) : sum.hi;
  return rounded + S(0);
}
template <class S>
S sum_rounded_up(S a, S b) {
  return S(0) - sum_rounded_down(-a, -b);
}

/// Returns half of a radius, rounded up to S.
template <class S>
S half_of(double radius) {
  if (!(radius >= 0 && radius <= double(admissible_magnitude<S>)))
    throw std::invalid_argument("the radius is " + number_text(radius) + ", not a number from 0 to " +
                                admissible_text<S>());
  const S half = S(radius / 2);
  return double(half) < radius / 2 || 2 * double(half) < radius
             ? std::nextafter(half, std::numeric_limits<S>::infinity())
             : half;
}

template <class S>
void write_grown(const S* positions, std::size_t vertices, S half, S* corners) {
  for (std::size_t v = 0; v < vertices; ++v)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S x = positions[3 * v + axis];
      corners[6 * v + axis] = sum_rounded_down(x, -half);
      corners[6 * v + 3 + axis] = sum_rounded_up(x, half);
    }
}

Primitives nets_of_corners(const Primitives& primitives) {
  Primitives nets;
  nets.kind = PrimitiveKind::control_nets;
  nets.offsets.reserve(primitives.offsets.size());
  for (std::size_t p = 1; p < primitives.offsets.size(); ++p)
    nets.offsets.push_back(2 * primitives.offsets[p]);
  nets.vertices.reserve(2 * primitives.vertices.size());
  for (const std::uint32_t v : primitives.vertices) {
    nets.vertices.push_back(2 * v);
    nets.vertices.push_back(2 * v + 1);
  }
  nets.removed = primitives.removed;
  nets.removed_count = primitives.removed_count;
  return nets;
}

template <class S>
FlightPlans<S> plans_of_corners(const Body<S>& body, S half) {
  const FlightPlans<S>& plans = body.plans;
  if (plans.curved() || plans.has_own_plans() || plans.keyframed_count() != plans.vertex_count())
    throw std::invalid_argument("body '" + body.name +
                                "' has no boxes with a radius: its vertices move on curves, or on plans of " +
                                "their own");
  const std::size_t keyframes = plans.keyframe_count(), vertices = plans.vertex_count();
  if (keyframes > 1 && half > 0) {
    // A position is rounded by half an epsilon of its size at most, its corners likewise.
    S largest = half;
    for (std::size_t k = 0; k < keyframes; ++k)
      for (std::size_t i = 0; i < 3 * vertices; ++i)
        largest = std::max(largest, std::fabs(plans.keyframe(k)[i]));
    half = half + 4 * std::numeric_limits<S>::epsilon() * largest + std::numeric_limits<S>::min();
  }
  std::vector<S> corners(6 * vertices * keyframes);
  for (std::size_t k = 0; k < keyframes; ++k)
    write_grown(plans.keyframe(k), vertices, half, corners.data() + 6 * vertices * k);
  if (plans.is_handed_in()) return FlightPlans<S>::handed_in(std::uint32_t(2 * vertices), std::move(corners));
  const auto times = plans.keyframe_times();
  return FlightPlans<S>(std::uint32_t(2 * vertices), {times.begin(), times.end()}, std::move(corners));
}

}  // namespace

template <class S>
Scene<S> with_radius(const Scene<S>& scene, double radius) {
  const S half = half_of<S>(radius);
  Scene<S> grown;
  grown.name = scene.name;
  grown.pairs = scene.pairs;
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b) {
    const Body<S>& body = scene.bodies[b];
    const std::uint32_t first = scene.first_of_set(b);
    grown.bodies.push_back({body.name, nets_of_corners(body.primitives),
                            first == b ? plans_of_corners(body, half) : grown.bodies[first].plans,
                            body.vertex_set});
  }
  validate(grown);
  return grown;
}

template <class S>
void write_corners(const S* positions, std::uint32_t vertices, double radius, S* corners) {
  write_grown(positions, vertices, half_of<S>(radius), corners);
}

#define KBVH_INSTANTIATE(S)                               \
  template Scene<S> with_radius(const Scene<S>&, double); \
  template void write_corners(const S*, std::uint32_t, double, S*);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
