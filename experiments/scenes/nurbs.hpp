#pragma once
#include <cstdint>
#include <vector>

#include "experiments/io/primitives.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

/// The spacing of a surface's knots.
enum class KnotSpacing : std::uint8_t {
  clamped,  ///< the surface begins and ends at its outermost control points
  uniform,  ///< equal spans throughout
};

/// The parameters of a NURBS surface.
struct NurbsConfig {
  std::uint32_t spans = 2000;  ///< knot spans; rounded to the nearest square number
  std::uint32_t degree = 3;    ///< in both directions
  KnotSpacing knots = KnotSpacing::clamped;
  Point centre{0, 0, 0};
  double side = 2.0;
  std::uint32_t keyframes = 60;
  double keyframes_per_second = 30.0;
};

/// The surface, and the data needed to evaluate it.
struct NurbsSurface {
  io::AnimatedMesh mesh;        ///< control points that move, a control net for each pair of spans
  io::SplineSurface spline;     ///< knots and degrees
  std::vector<double> weights;  ///< of control points, all positive: between 1/2 and 2
};

/// Makes a horizontal square in waves that travel and cross, as a NURBS surface whose control points rise and
/// sink. O(control points x keyframes). Throws io::InputError on values out of range.
NurbsSurface nurbs_surface(const NurbsConfig& config);

}  // namespace kbvh::scenes
