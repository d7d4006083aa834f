#pragma once
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/rational_geometry.hpp"
#include "tests/support/synthetic_scenes.hpp"

// Scenes that play frame by frame with an interval join for every kernel set, and their exact plans.

namespace kbvh::test {

constexpr std::uint32_t frames_per_segment = 7;

/// One coordinate at both ends of a segment.
struct Line {
  Rational first, last;
};

/// A primitive on the exact plan, and its boxes at both ends: lower and upper sides, exactly and nearly.
struct Flight {
  std::vector<std::array<Line, 3>> corners;
  Rational lower[2][3], upper[2][3];
  double lower_near[2][3], upper_near[2][3];
};

/// All primitives of a body over a segment.
struct BodyFlight {
  std::vector<Flight> primitives;
};

/// A body on its plans between two times without a knot in between.
template <class S>
BodyFlight exact_flight(const Body<S>& body, double begin, double end) {
  std::vector<std::array<Line, 3>> vertices(body.plans.vertex_count());
  BodyFlight flight;
  for (std::uint32_t v = 0; v < vertices.size(); ++v)
    for (int axis = 0; axis < 3; ++axis) {
      const Piece<S> piece = body.plans.piece_after(v, axis, begin);
      vertices[v][std::size_t(axis)] = {value_at(piece, begin), value_at(piece, end)};
    }
  for (std::uint32_t p = 0; p < body.primitives.count(); ++p) {
    Flight& primitive = flight.primitives.emplace_back();
    for (const std::uint32_t v : body.primitives[p]) primitive.corners.push_back(vertices[v]);
    for (int end_of = 0; end_of < 2; ++end_of)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        Rational &lower = primitive.lower[end_of][axis], &upper = primitive.upper[end_of][axis];
        for (const auto& corner : primitive.corners) {
          const Rational& x = end_of == 0 ? corner[axis].first : corner[axis].last;
          if (&corner == primitive.corners.data() || x < lower) lower = x;
          if (&corner == primitive.corners.data() || x > upper) upper = x;
        }
        primitive.lower_near[end_of][axis] = lower.convert_to<double>();
        primitive.upper_near[end_of][axis] = upper.convert_to<double>();
      }
  }
  return flight;
}

/// All bodies over the current segment.
template <class S>
std::vector<BodyFlight> exact_flights(const Scene<S>& scene, const LinearBounds<S>& bounds) {
  const double end = std::isinf(bounds.end()) ? bounds.begin() : bounds.end();
  std::vector<BodyFlight> flights;
  for (const Body<S>& body : scene.bodies) flights.push_back(exact_flight(body, bounds.begin(), end));
  return flights;
}

/// Triangles in parallel planes, one body over the other, with gaps of some ulps that change by some ulps:
/// the margins, which are some ulps as well, decide every pair.
template <class S>
Scene<S> grazing(S place) {
  Random random(61);
  const S ulp = place * std::numeric_limits<S>::epsilon();
  Scene<S> scene;
  for (std::uint32_t b = 0; b < 2; ++b) {
    constexpr std::uint32_t triangles = 20, keyframes = 4;
    Primitives primitives;
    for (std::uint32_t p = 0; p < triangles; ++p) {
      const std::uint32_t corners[3] = {3 * p, 3 * p + 1, 3 * p + 2};
      primitives.add(corners);
    }
    std::vector<double> times;
    std::vector<S> positions;
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      times.push_back(0.25 * k);
      for (std::uint32_t p = 0; p < triangles; ++p) {
        const S height = b == 0 ? place - ulp * S(random.below(8)) : place + ulp * S(random.below(48));
        const S wide = place / 2;
        positions.insert(positions.end(), {0, 0, height, wide, 0, height, 0, wide, height});
      }
    }
    scene.bodies.push_back({"body" + std::to_string(b), primitives,
                            FlightPlans<S>(3 * triangles, std::move(times), std::move(positions))});
  }
  scene.pairs = all_pairs(scene.bodies);
  validate(scene);
  return scene;
}

/// These scenes, near and far from the origin, and the synthetic scenes.
template <class S>
Scene<S> scene_of(const std::string& name) {
  if (name == "grazing") return grazing<S>(1);
  if (name == "grazing_far") return grazing<S>(1024);
  return synthetic_scene<S>(name).scene;
}

/// The joins of one kernel set, over one kind of tree.
template <class S>
struct Joiner {
  KernelSet kernels;
  LinearBounds<S> bounds;
  std::vector<IntervalJoin<S>> joins;
  std::vector<TriangleSpanFilter<S>> answers;

  Joiner(const Scene<S>& scene, const SegmentMotion<S>& motion, const Topologies& topologies, KernelSet set,
         const SegmentCuts& cuts)
      : kernels(set),
        bounds(SceneView<S>(scene), motion, topologies, set, {cuts}),
        joins(scene.pairs.size()),
        answers(scene.pairs.size()) {
    bounds.start();
    join(scene);
  }
  bool advance(const Scene<S>& scene) {
    if (!bounds.advance()) return false;
    join(scene);
    return true;
  }
  void join(const Scene<S>& scene) {
    for (std::size_t i = 0; i < joins.size(); ++i) {
      joins[i].join(bounds.segment(), SceneView<S>(scene), scene.pairs[i].first, scene.pairs[i].second);
      answers[i].start(joins[i]);
    }
  }
};

/// A scene, joined by every kernel set, that plays frame by frame.
template <class S>
struct Play {
  const Scene<S>& scene;
  Playback<S> playback;
  SegmentMotion<S> motion;
  std::vector<std::unique_ptr<Joiner<S>>> joiners;

  Play(const Scene<S>& played, const BuilderConfig& builder, const SegmentCuts& cuts)
      : scene(played), playback(played), motion(playback) {
    playback.seek(overlaid_keyframes(scene).front());
    playback.evaluate_all();
    Topologies topologies;
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
      topologies.push_back(build_topology(scene.bodies[body].primitives, playback.positions(body), builder));
    for (const KernelSet set : supported_kernel_sets())
      joiners.push_back(std::make_unique<Joiner<S>>(scene, motion, topologies, set, cuts));
  }

  /// Calls `at_segment` for each new segment, and `at_frame` for each frame.
  template <class AtSegment, class AtFrame>
  void run(const AtSegment& at_segment, const AtFrame& at_frame) {
    bool is_new = true;
    for (const double t : frame_times(scene, frames_per_segment)) {
      playback.seek(t);
      for (const auto& joiner : joiners) is_new = joiner->advance(scene) || is_new;
      if (is_new) at_segment();
      is_new = false;
      at_frame();
    }
  }
};

}  // namespace kbvh::test
