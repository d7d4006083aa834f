#include "experiments/scenes/nurbs.hpp"

#include <cmath>

namespace kbvh::scenes {
namespace {

/// Returns the knots of n spans, from 0 to n where the surface is defined.
std::vector<double> knots_of(std::uint32_t spans, std::uint32_t degree, KnotSpacing spacing) {
  std::vector<double> knots;
  for (std::uint32_t i = 0; i < spans + 2 * degree + 1; ++i) {
    const double knot = double(i) - double(degree);
    knots.push_back(spacing == KnotSpacing::uniform ? knot : std::min(std::max(knot, 0.0), double(spans)));
  }
  return knots;
}

}  // namespace

NurbsSurface nurbs_surface(const NurbsConfig& config) {
  if (config.degree < 1 || config.degree > 16)
    throw io::InputError("nurbs: degree is " + std::to_string(config.degree) + ", must be from 1 to 16");
  if (config.spans > (1u << 24))
    throw io::InputError("nurbs: " + std::to_string(config.spans) + " spans asked for, at most " +
                         std::to_string(1u << 24) + " are possible");
  const std::uint32_t p = config.degree;
  const auto n = std::uint32_t(std::max(1.0, std::floor(std::sqrt(double(config.spans)) + 0.5)));
  const std::uint32_t row = n + p;
  NurbsSurface result;
  io::SplineSurface& spline = result.spline;
  spline.degree_u = spline.degree_v = p;
  spline.knots_u = spline.knots_v = knots_of(n, p, config.knots);
  spline.first_u = spline.first_v = 0;
  spline.last_u = spline.last_v = n;
  io::AnimatedMesh& mesh = result.mesh;
  mesh.vertex_count = row * row;
  for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
    spline.points.push_back(v);
    result.weights.push_back(0.5 + 1.5 * double((v * 7919u) % 16u) / 15.0);
  }
  io::add_control_nets(mesh, spline);
  mesh.name = "nurbs-" + std::to_string(mesh.primitive_count());
  mesh.keyframe_times = keyframe_times(config.keyframes, config.keyframes_per_second);
  mesh.positions.reserve(std::size_t{3} * mesh.vertex_count * config.keyframes);
  // A control point lies at the mean of its knots (Greville), so that without its waves the surface would be
  // the square itself, with each knot at its place.
  std::vector<double> along(row);
  for (std::uint32_t i = 0; i < row; ++i) {
    double sum = 0;
    for (std::uint32_t k = 1; k <= p; ++k) sum += spline.knots_u[i + k];
    along[i] = config.side * (sum / double(p) / double(n) - 0.5);
  }
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    const double phase = double(k) / 40.0;
    for (std::uint32_t j = 0; j < row; ++j)
      for (std::uint32_t i = 0; i < row; ++i) {
        const double x = along[i] / config.side, y = along[j] / config.side;
        const double height = 0.12 * sine_of_turns(1.5 * x + 0.4 * y - phase) +
                              0.06 * sine_of_turns(3.1 * y - 0.7 * x + 1.7 * phase) +
                              0.015 * sine_of_turns(0.13 * double(i) + 0.21 * double(j) + 3.0 * phase);
        mesh.positions.push_back(rounded_to_float(config.centre[0] + along[i]));
        mesh.positions.push_back(rounded_to_float(config.centre[1] + along[j]));
        mesh.positions.push_back(rounded_to_float(config.centre[2] + config.side * height));
      }
  }
  return result;
}

}  // namespace kbvh::scenes
