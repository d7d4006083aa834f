#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

/// Small bodies made by formula, for scenes, tests and benchmarks. Everything here is deterministic to the
/// last bit on every machine with IEEE doubles: only + - * / and square roots are used (sines are polynomials
/// of our own), there are no threads and no unordered containers. All positions are rounded to float, so that
/// a scene in float holds exactly what a scene in double holds. Closed meshes are welded, outward facing, of
/// genus 0 (vertices - edges + triangles = 2).
///
/// A shape cannot have every number of triangles; each function takes the nearest number that its pattern
/// allows, and the mesh's name ends with the number used ("icosphere-20480"). Requests below the pattern's
/// smallest number give that smallest number; requests above 2^27 triangles throw io::InputError.
namespace kbvh::scenes {

/// A point or a vector: x, y, z in metres; z points up.
using Point = std::array<double, 3>;

/// sin(2 pi turns), error below 1e-15, the same bits everywhere (libm's sine is not). |turns| < 2^50.
double sine_of_turns(double turns);
/// cos(2 pi turns), see sine_of_turns.
double cosine_of_turns(double turns);

/// The float nearest to value, as a double, and never a negative zero. To be used instead of
/// double(float(value)), which GCC 12.2 can miscompile.
double rounded_to_float(double value);

/// A stream of random numbers by counter (splitmix64): the n-th number of a seed needs no earlier one.
class SeededNoise {
 public:
  explicit SeededNoise(std::uint64_t seed) : seed_(seed) {}
  /// 64 well-mixed bits for this index.
  std::uint64_t bits(std::uint64_t index) const;
  /// Uniform in [-1, 1), a multiple of 2^-52.
  double signed_unit(std::uint64_t index) const;

 private:
  std::uint64_t seed_;
};

// --- static shapes
// -------------------------------------------------------------------------------------------

/// Geodesic sphere: every face of an icosahedron cut into f^2 triangles and blown up to the sphere; 20 f^2
/// triangles of similar size.
io::AnimatedMesh icosphere(std::uint32_t triangles, const Point& centre, double radius);

/// Sphere by longitude and latitude, with slivers at the poles: about twice as many segments as rings; 2 s r
/// triangles for s segments and r rings between the poles.
io::AnimatedMesh uv_sphere(std::uint32_t triangles, const Point& centre, double radius);

/// Axis-parallel closed box, every face a grid of f x f squares; 12 f^2 triangles.
io::AnimatedMesh box(std::uint32_t triangles, const Point& lower, const Point& upper);

/// Horizontal square sheet (open, Euler characteristic 1) of f x f squares, whose diagonals alternate; 2 f^2
/// triangles. Vertex (i, j) has id j (f + 1) + i and lies at centre + side ((i, j) / f - 1/2).
io::AnimatedMesh sheet(std::uint32_t triangles, const Point& centre, double side);

/// Number of squares along a side of the sheet whose 2 f^2 triangles are nearest to the request.
std::uint32_t sheet_squares(std::uint32_t triangles);
/// Vertex ids of the sheet's triangles, three each.
std::vector<std::uint32_t> sheet_triangles(std::uint32_t squares);

/// A round table: a disc with rounded rim on a pedestal, all lengths in metres.
struct RoundTableShape {
  double centre_x = 0.0;
  double centre_y = 0.0;
  double radius = 0.6;
  double top = 0.875;             ///< height of the upper surface
  double thickness = 0.05;        ///< of the disc
  double rim_radius = 0.02;       ///< of the rounding, at most half of the thickness
  double pedestal_radius = 0.05;  ///< 0: no pedestal, the table is a floating disc
  double base_radius = 0.25;      ///< of the pedestal's foot, on the floor z = 0
};

/// Surface of revolution around a vertical axis, 2 s r triangles for s segments and r rings; closed.
io::AnimatedMesh round_table(std::uint32_t triangles, const RoundTableShape& shape);

// --- motions
// -------------------------------------------------------------------------------------------------

/// Keyframe times 0, 1/rate, 2/rate...
std::vector<double> keyframe_times(std::uint32_t keyframes, double keyframes_per_second);

/// The mesh at its first keyframe, with every coordinate rounded to a multiple of 2^-fraction_bits: with a
/// velocity per keyframe on the same lattice a translation is then exact in float (while below 2^(24 -
/// fraction_bits)).
io::AnimatedMesh snapped(const io::AnimatedMesh& mesh, int fraction_bits);

/// The mesh's first keyframe moving by `step` metres per keyframe.
io::AnimatedMesh translated(const io::AnimatedMesh& mesh, const Point& step, std::uint32_t keyframes,
                            double keyframes_per_second = 30.0);

/// The mesh's first keyframe turning about the vertical axis through `centre`, by `turns` per keyframe.
io::AnimatedMesh rotated(const io::AnimatedMesh& mesh, const Point& centre, double turns,
                         std::uint32_t keyframes, double keyframes_per_second = 30.0);

/// A sheet of 2 m in waves that travel and cross: five wavelengths, the finest of eight grid squares at
/// every resolution, so that large sheets carry motion of their own at every level of a tree. O(vertices x
/// keyframes).
io::AnimatedMesh waving_sheet(std::uint32_t triangles, std::uint32_t keyframes,
                              double keyframes_per_second = 30.0);

/// Separate triangles (3 own vertices each) strewn over the unit cube, with edges of about triangles^(-1/3),
/// each vertex drifting by a random step of at most a tenth of that per keyframe.
io::AnimatedMesh random_soup(std::uint32_t triangles, std::uint64_t seed, std::uint32_t keyframes,
                             double keyframes_per_second = 30.0);

/// Icosphere that grows linearly from first_radius to last_radius over the keyframes.
io::AnimatedMesh expanding_sphere(std::uint32_t triangles, const Point& centre, double first_radius,
                                  double last_radius, std::uint32_t keyframes,
                                  double keyframes_per_second = 30.0);

}  // namespace kbvh::scenes
