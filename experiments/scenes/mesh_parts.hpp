#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/scenes/cloth_parts.hpp"

/// The common parts of meshes made by formula.
namespace kbvh::scenes {

/// Throws io::InputError "shape: n triangles asked for ..." above 2^27.
void check_triangles(std::uint32_t triangles, const char* shape);

/// Throws io::InputError "what is ..." unless 0 < value < 1e6.
void check_length(double value, const char* what);

/// Returns the f >= 1 for which per_square * f^2 is nearest to the request.
std::uint32_t nearest_frequency(std::uint32_t triangles, std::uint32_t per_square);

/// Makes a mesh of triangles at rest from three vertex ids each and three coordinates per vertex, which are
/// rounded to float; its name is the shape's with the number of triangles.
io::AnimatedMesh triangle_mesh(const std::string& shape, std::vector<std::uint32_t> corners,
                               std::vector<double> positions);

/// Makes a mesh of separate triangles without positions.
io::AnimatedMesh separate_triangles(const std::string& shape, std::uint32_t count);

/// Returns the edge of the cubes of which `count` have this volume together: a multiple of 2^-40, at most 1.
/// By bisection: libm's cube root differs between platforms.
double cube_edge(double volume, std::uint32_t count);

/// Appends one keyframe, rounded to float. The caller sets the times.
void append_keyframe(io::AnimatedMesh& mesh, const std::vector<cloth::Vec>& positions);

struct ProfilePoint {
  double r, z;
};

/// Revolves a profile (from the upper to the lower pole; both poles lie on the axis and are given separately)
/// around the vertical axis through (x, y): one ring of `segments` vertices per profile point, then the
/// poles.
io::AnimatedMesh revolve(const std::string& shape, double x, double y, double top_z, double bottom_z,
                         const std::vector<ProfilePoint>& profile, std::uint32_t segments);

/// Returns the vertex ids of the triangles that `revolve` makes.
std::vector<std::uint32_t> revolved_triangles(std::uint32_t rings, std::uint32_t segments);

}  // namespace kbvh::scenes
