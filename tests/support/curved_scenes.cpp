#include "tests/support/curved_scenes.hpp"

#include <functional>
#include <stdexcept>

namespace kbvh::test {

namespace {

struct Bent {
  double bend = 0, twist = 0;
};

/// One coordinate in one segment.
struct Place {
  std::uint32_t body, vertex;
  std::size_t segment;
  int axis;
  double x0, x1, seconds;
};

/// Returns the scene with other curves between the same keyframes.
template <class S>
TestScene<S> bent(TestScene<S> test, const std::function<Bent(const Place&)>& rule) {
  for (std::uint32_t b = 0; b < test.scene.bodies.size(); ++b) {
    FlightPlans<S>& plans = test.scene.bodies[b].plans;
    const auto times = plans.keyframe_times();
    const std::size_t scalars = std::size_t(3) * plans.vertex_count();
    std::vector<S> positions;
    for (std::size_t k = 0; k < times.size(); ++k)
      positions.insert(positions.end(), plans.keyframe(k), plans.keyframe(k) + scalars);
    std::vector<SegmentBends<S>> bends(times.size() - 1);
    for (std::size_t k = 0; k + 1 < times.size(); ++k)
      for (std::size_t i = 0; i < scalars; ++i) {
        const Bent rounded = rule({b, std::uint32_t(i / 3), k, int(i % 3), double(plans.keyframe(k)[i]),
                                   double(plans.keyframe(k + 1)[i]), times[k + 1] - times[k]});
        bends[k].bend.push_back(S(rounded.bend));
        bends[k].twist.push_back(S(rounded.twist));
      }
    plans = FlightPlans<S>(plans.vertex_count(), {times.begin(), times.end()}, std::move(positions),
                           std::move(bends));
  }
  return test;
}

double noise(const Place& at, std::uint32_t which) {
  return Random(((std::uint64_t(at.body) * 4096 + at.vertex) * 64 + at.segment) * 8 +
                std::uint64_t(at.axis) * 2 + which)
      .unit();
}

}  // namespace

const std::vector<std::string>& curved_scene_names() {
  static const std::vector<std::string> names{"curved_soups",
                                              "curved_thrown",
                                              "curved_gravity",
                                              "curved_mixed",
                                              "curved_ties",
                                              "curved_twins",
                                              "curved_touching",
                                              "curved_mirror",
                                              "curved_far",
                                              "curved_extremes",
                                              "curved_keyframes_a_millionth_apart"};
  return names;
}

template <class S>
TestScene<S> curved_scene(const std::string& name, std::uint32_t l) {
  const auto of = [&](const char* base, const std::function<Bent(const Place&)>& rule) {
    TestScene<S> test = bent(synthetic_scene<S>(base, l), rule);
    test.scene.name = name;
    return test;
  };
  // Large random bends: up to three roots of a difference in a segment.
  if (name == "curved_soups")
    return of("soups", [](const Place& at) { return Bent{noise(at, 0), 2 * noise(at, 1)}; });
  // Differing accelerations, and drag that grows: parabolas and cubics over an obstacle at rest.
  if (name == "curved_thrown")
    return of("static_obstacle", [](const Place& at) {
      const double wind = at.axis == 0   ? 0.05 * (at.vertex % 7)
                          : at.axis == 2 ? 0.2 + 0.02 * (at.vertex % 5)
                                         : 0.0;
      return Bent{wind, at.segment % 2 == 0 ? -0.3 * wind : 0.0};
    });
  // One acceleration for all vertices of a body: every difference is linear.
  if (name == "curved_gravity")
    return of("sheets", [](const Place& at) { return Bent{at.axis == 2 ? 0.4 + 0.1 * at.body : 0.0, 0.0}; });
  // Lines, parabolas and cubics by turns, in bodies with keyframes of their own; one body has lines alone.
  if (name == "curved_mixed")
    return of("four_bodies_own_keyframes", [](const Place& at) {
      if (at.body == 1 || at.segment % 3 == 2) return Bent{};
      return Bent{0.5 * noise(at, 0), at.segment % 3 == 1 ? 0.8 * noise(at, 1) : 0.0};
    });
  // Small integers: roots at knots, double and common roots, equal pieces.
  if (name == "curved_ties")
    return of("integer_ties", [](const Place& at) {
      return Bent{4.0 * int((at.vertex + at.segment) % 3) - 4.0,
                  4.0 * int((at.vertex * 5 + at.segment) % 3) - 4.0};
    });
  // Twins share their ends, and curves in some segments only.
  if (name == "curved_twins")
    return of("coincident_intervals", [](const Place& at) {
      const bool apart = at.segment == 1 || at.segment == 3;
      Place twin = at;
      if (!apart) twin.vertex = at.vertex % 3 + at.vertex / 6 * 6;
      return Bent{0.5 * noise(twin, 0), at.segment % 2 == 0 ? 0.5 * noise(twin, 1) : 0.0};
    });
  // Differences that are squares: vertices meet at 1/2 without crossing, or stay together.
  if (name == "curved_touching")
    return of("integer_ties", [](const Place& at) {
      // x = c (2 s - 1)^2 + linear part: from c at both ends down to zero.
      return Bent{-4.0 * int(at.vertex % 2) * double(at.x0 == at.x1 ? at.x0 : 1.0), 0.0};
    });
  // Every pair of vertices meets at the same instant, some three times in a segment.
  if (name == "curved_mirror")
    return of("all_cross_at_once", [](const Place& at) {
      if (at.body != 0 || at.axis != 0) return Bent{};
      const double place = at.x0 - 1, strength = at.vertex % 3 == 0 ? 16.0 : 2.0;
      return Bent{-strength * place, 2 * strength * place};
    });
  if (name == "curved_far")
    return of("pure_translation_far", [](const Place& at) {
      return Bent{at.axis == 2 ? 0.5 + 0.125 * (at.vertex % 3) : 0.0,
                  at.axis == 1 ? 0.25 * (at.vertex % 4) : 0.0};
    });
  if (name == "curved_extremes")
    return of("extreme_velocities", [](const Place& at) {
      return Bent{(at.vertex % 3 == 0 ? 0.5 : -0.25) * at.x0, (at.vertex % 2 == 0 ? 0.25 : 0.5) * at.x1};
    });
  if (name == "curved_keyframes_a_millionth_apart")
    return of("keyframes_a_millionth_apart", [](const Place& at) {
      return Bent{0.2 * noise(at, 0) * at.seconds, 0.2 * noise(at, 1)};
    });
  throw std::invalid_argument("no such scene: " + name);
}

template TestScene<float> curved_scene(const std::string&, std::uint32_t);
template TestScene<double> curved_scene(const std::string&, std::uint32_t);

}  // namespace kbvh::test
