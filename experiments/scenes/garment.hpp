#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/scenes/cloth_parts.hpp"
#include "experiments/scenes/garment_pattern.hpp"

namespace kbvh::scenes {

/// The parameters of the simulation: a figure that walks along +x, and the garment that it wears (Z&W s.9 has
/// a man's shirt and a woman's dress). Metres, seconds, kilograms.
struct GarmentConfig {
  GarmentKind kind = GarmentKind::shirt;
  /// Triangles of the garment; the nearest number that the pattern allows is used and is part of its name.
  std::uint32_t triangles = 32000;
  /// Perturbs the gait: phase, pace, and swing of legs and arms. The same seed gives the same walk at every
  /// resolution.
  std::uint64_t seed = 1;
  std::uint32_t keyframes = 60;
  double keyframes_per_second = 30.0;
  std::uint32_t avatar_triangles = 12000;  ///< nearest possible number, independent of the garment's

  /// Garments of more triangles are simulated in two levels: one of about this number in full, and one of all
  /// triangles whose averages over the squares of the first level are constrained to it.
  std::uint32_t full_triangles = 66000;
  std::uint32_t fine_steps = 12;  ///< solver steps per keyframe of the second level

  double area_density = 0.18;         ///< kg/m^2
  double stretch_stiffness = 4000.0;  ///< N/m along the threads
  double shear_stiffness = 300.0;     ///< N/m along the diagonals
  double bending_rigidity = 1.5e-5;   ///< N m, per width of cloth
  double air_drag = 2.0;              ///< 1/m: deceleration along the normal is air_drag x (normal speed)^2
  double viscosity = 0.004;           ///< m^2/s, smooths velocities within the cloth (inner friction)
  double friction = 0.4;              ///< Coulomb's coefficient, cloth on figure and cloth on itself
  double layer_distance = 0.6;        ///< kept between layers, in mean grid squares; 0: it may cut itself

  /// The drawn figure lies 1 mm below the solid that stops the cloth; in patches it rises above it by up to
  /// this.
  double skin_bite = 0.002;

  /// Solver steps per keyframe of the full simulation; 0: from grid and keyframe spacing, so that threads
  /// stretch by a few percent at most.
  std::uint32_t substeps_per_keyframe = 0;
};

/// Simulates the scene: {garment, avatar}, both moving, the first keyframe at time 0. The preceding 1.2 s, in
/// which the figure lowers its arms and begins to walk, are simulated and not kept.
///
/// Up to `full_triangles` the whole garment is simulated with the tablecloth's method (extended
/// position-based dynamics, many small steps of one iteration): threads and diagonals, bending, drag in the
/// wind of walking, inner friction, contact with friction against the figure's solid (signed distance of
/// rounded cones), layers that repel each other. Larger garments are simulated in this way at about
/// `full_triangles`. This motion, interpolated smoothly (Catmull-Rom in space and time), guides a second
/// simulation at all triangles: `fine_steps` steps per keyframe in which only averages over the coarser
/// squares are constrained to the guide (after Bergou et al. 2007, "TRACKS"). Finer folds therefore move by
/// their own threads, bending, inertia and contact with the figure. This second level does not keep layers of
/// cloth apart.
///
/// The result depends on the config alone, to the last bit, on every machine with IEEE doubles and
/// -ffp-contract=off. Vertices of the garment lie outside the solid except for a millimetre or two where the
/// cloth is pinched between arm and trunk; edges and triangles between them may cut it. Throws io::InputError
/// on values out of range.
///
/// 99 of 100 threads stretch by less than 7% (shirt) or 4% (dress) at 8k triangles; the worst, short threads
/// around the armholes, stretch by 40% and 15% for an instant. Time on one core for 60 keyframes: 4 s for 8k
/// triangles, 35 s for 32k, 2.5 minutes for 326k of shirt, 2 minutes for 580k of dress.
std::vector<io::AnimatedMesh> simulate_garment(const GarmentConfig& config, const Progress& progress = {});

/// Returns a name for the result of simulate_garment(config): readable, usable as a file name, different
/// whenever any value of the config or the solver's version differs.
std::string cache_key(const GarmentConfig& config);

}  // namespace kbvh::scenes
