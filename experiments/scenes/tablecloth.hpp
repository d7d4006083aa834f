#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/scenes/cloth_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

/// The parameters of the simulation: a square cloth dropped flat, slightly askew, on a round table. Metres,
/// seconds, kilograms.
struct TableclothConfig {
  /// Triangles of the cloth; the nearest grid of 2 f^2 is simulated, and its number is part of the cloth's
  /// name.
  std::uint32_t triangles = 2048;
  /// Perturbs the start: yaw, tilt, offset and unevenness. The same seed gives the same cloth at every
  /// resolution.
  std::uint64_t seed = 1;
  std::uint32_t keyframes = 60;
  double keyframes_per_second = 30.0;

  double side = 2.0;                  ///< of the square cloth
  double drop_height = 0.12;          ///< of the cloth's centre above the table at the first keyframe
  double area_density = 0.2;          ///< kg/m^2, cotton
  double stretch_stiffness = 4000.0;  ///< N/m along the threads
  double shear_stiffness = 400.0;     ///< N/m along the diagonals
  double bending_rigidity = 2e-5;     ///< N m, per width of cloth; folds become wider as it grows
  double air_drag = 3.0;              ///< 1/m: deceleration along the normal is air_drag x (normal speed)^2
  double viscosity = 0.004;           ///< m^2/s, smooths velocities within the cloth (inner friction)
  double friction = 0.5;              ///< Coulomb's coefficient, cloth on table and cloth on itself
  double layer_distance = 0.75;       ///< kept between layers, in grid squares; 0: the cloth may cut itself

  /// The solid that stops the cloth differs from the drawn table: it is higher by rest_gap and narrower by
  /// rim_bite. The cloth therefore lies just above the table top and cuts the drawn rim all around, so that
  /// collision queries have answers.
  double rest_gap = 0.001;
  double rim_bite = 0.002;  ///< see rest_gap

  std::uint32_t table_triangles = 2048;  ///< nearest possible number, independent of the cloth's
  RoundTableShape table{.centre_x = 0.03, .centre_y = -0.02};

  /// Solver steps per keyframe; 0: from grid and keyframe spacing, so that threads stretch by a few percent
  /// at most.
  std::uint32_t substeps_per_keyframe = 0;
};

/// Simulates the scene: {cloth (moving), table (static)}, the first keyframe at time 0.
///
/// Extended position-based dynamics with many small steps of one iteration each (Macklin et al. 2019, "Small
/// Steps in Physics Simulation"): threads and diagonals as distance constraints, bending as second
/// differences along both threads (quadratic bending, so rigidity does not depend on the grid), normal air
/// drag, inner viscosity, contact with Coulomb friction against the exact rounded disc, and vertices that
/// repel vertices of other layers within layer_distance. Self-contact is between vertices only: it keeps
/// layers apart nearly everywhere but is no guarantee, and the cloth may cut itself in places. Every
/// resolution is simulated directly, without interpolation.
///
/// The result depends on the config alone, to the last bit, on every machine with IEEE doubles and
/// -ffp-contract=off: no threads, no random order, no function of libm but sqrt, floor and fabs. 99 of 100
/// edges stretch by less than 3%, the worst of a clip by 7 to 12% for an instant. Time O(triangles^1.5 x
/// simulated seconds): about 0.3 s for 2k, 6 s for 16k and a minute for 65k triangles over 2 seconds of
/// cloth. Throws io::InputError on values out of range.
std::vector<io::AnimatedMesh> simulate_tablecloth(const TableclothConfig& config,
                                                  const Progress& progress = {});

/// Returns a name for the result of simulate_tablecloth(config): readable, usable as a file name, different
/// whenever any value of the config or the solver's version differs.
std::string cache_key(const TableclothConfig& config);

}  // namespace kbvh::scenes
