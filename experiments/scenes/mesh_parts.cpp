#include "experiments/scenes/mesh_parts.hpp"

#include <cmath>
#include <utility>

#include "core/base/library_gaps.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

namespace {
constexpr std::uint32_t max_triangles = 1u << 27;
}

void check_triangles(std::uint32_t triangles, const char* shape) {
  if (triangles > max_triangles)
    throw io::InputError(std::string(shape) + ": " + std::to_string(triangles) +
                         " triangles asked for, at most " + std::to_string(max_triangles) + " are possible");
}

void check_length(double value, const char* what) {
  if (!(value > 0.0) || !(value < 1e6))
    throw io::InputError(std::string(what) + " is " + shortest_text(value) + ", must be in (0, 1e6)");
}

std::uint32_t nearest_frequency(std::uint32_t triangles, std::uint32_t per_square) {
  const double ideal = double(triangles) / double(per_square);
  const auto f = std::uint64_t(std::sqrt(ideal));
  const double below = ideal - double(f * f);
  const double above = double((f + 1) * (f + 1)) - ideal;
  return std::uint32_t(std::max<std::uint64_t>(1, above < below ? f + 1 : f));
}

io::AnimatedMesh triangle_mesh(const std::string& shape, std::vector<std::uint32_t> corners,
                               std::vector<double> positions) {
  io::AnimatedMesh mesh;
  const std::size_t count = corners.size() / 3;
  mesh.name = shape + "-" + std::to_string(count);
  mesh.vertex_count = std::uint32_t(positions.size() / 3);
  mesh.primitive_offsets.resize(count + 1);
  for (std::size_t i = 0; i <= count; ++i) mesh.primitive_offsets[i] = std::uint32_t(3 * i);
  mesh.primitive_vertices = std::move(corners);
  mesh.keyframe_times = {0.0};
  for (double& x : positions) x = rounded_to_float(x);
  mesh.positions = std::move(positions);
  return mesh;
}

io::AnimatedMesh separate_triangles(const std::string& shape, std::uint32_t count) {
  std::vector<std::uint32_t> corners(3 * std::size_t(count));
  for (std::size_t v = 0; v < corners.size(); ++v) corners[v] = std::uint32_t(v);
  io::AnimatedMesh mesh = triangle_mesh(shape, std::move(corners), {});
  mesh.vertex_count = 3 * count;
  return mesh;
}

double cube_edge(double volume, std::uint32_t count) {
  double low = 0, high = 1;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (middle * middle * middle * double(count) > volume ? high : low) = middle;
  }
  return high;
}

void append_keyframe(io::AnimatedMesh& mesh, const std::vector<cloth::Vec>& positions) {
  for (const cloth::Vec& p : positions)
    for (const double x : {p.x, p.y, p.z}) mesh.positions.push_back(rounded_to_float(x));
}

std::vector<std::uint32_t> revolved_triangles(std::uint32_t rings, std::uint32_t segments) {
  const std::uint32_t top = rings * segments;
  const std::uint32_t bottom = top + 1;
  std::vector<std::uint32_t> corners;
  corners.reserve(6 * std::size_t(rings) * segments);
  for (std::uint32_t s = 0; s < segments; ++s) {
    const std::uint32_t next = (s + 1) % segments;
    corners.insert(corners.end(), {top, s, next});
    for (std::uint32_t ring = 0; ring + 1 < rings; ++ring) {
      const std::uint32_t upper = ring * segments;
      const std::uint32_t lower = upper + segments;
      corners.insert(corners.end(), {upper + s, lower + s, lower + next});
      corners.insert(corners.end(), {upper + s, lower + next, upper + next});
    }
    const std::uint32_t last = (rings - 1) * segments;
    corners.insert(corners.end(), {bottom, last + next, last + s});
  }
  return corners;
}

io::AnimatedMesh revolve(const std::string& shape, double x, double y, double top_z, double bottom_z,
                         const std::vector<ProfilePoint>& profile, std::uint32_t segments) {
  const auto rings = std::uint32_t(profile.size());
  std::vector<double> positions;
  positions.reserve(3 * (std::size_t(rings) * segments + 2));
  for (const ProfilePoint& p : profile)
    for (std::uint32_t s = 0; s < segments; ++s) {
      const double turns = double(s) / double(segments);
      positions.insert(positions.end(),
                       {x + p.r * cosine_of_turns(turns), y + p.r * sine_of_turns(turns), p.z});
    }
  positions.insert(positions.end(), {x, y, top_z, x, y, bottom_z});
  return triangle_mesh(shape, revolved_triangles(rings, segments), std::move(positions));
}

}  // namespace kbvh::scenes
