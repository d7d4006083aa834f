#pragma once
#include <cstdint>
#include <vector>

#include "experiments/io/primitives.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

/// How the knots of a surface are spaced.
enum class KnotSpacing : std::uint8_t {
  clamped,  ///< the surface begins and ends at its outermost control points
  uniform,  ///< equal spans throughout
};

/// A NURBS surface that is asked for.
struct NurbsConfig {
  std::uint32_t spans = 2000;  ///< knot spans, of which the nearest square number is made
  std::uint32_t degree = 3;    ///< in both directions
  KnotSpacing knots = KnotSpacing::clamped;
  Point centre{0, 0, 0};
  double side = 2.0;
  std::uint32_t keyframes = 60;
  double keyframes_per_second = 30.0;
};

/// The surface, and what else it takes to evaluate it.
struct NurbsSurface {
  io::AnimatedMesh mesh;        ///< control points that move, a control net for each pair of spans
  io::SplineSurface spline;     ///< knots and degrees
  std::vector<double> weights;  ///< of control points, all positive: between 1/2 and 2
};

/// A horizontal square in waves that travel and cross, as a NURBS surface whose control points rise and sink.
/// O(control points x keyframes). Throws io::InputError on values out of range.
NurbsSurface nurbs_surface(const NurbsConfig& config);

}  // namespace kbvh::scenes
