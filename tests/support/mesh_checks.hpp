#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "experiments/scenes/shapes.hpp"

/// Checks of meshes that are made by formula.
namespace kbvh::test {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

inline std::vector<Edge> directed_edges(const io::AnimatedMesh& mesh) {
  std::vector<Edge> edges;
  for (std::size_t t = 0; t < mesh.primitive_count(); ++t)
    for (std::size_t i = 0; i < 3; ++i)
      edges.emplace_back(mesh.primitive_vertices[3 * t + i], mesh.primitive_vertices[3 * t + (i + 1) % 3]);
  std::sort(edges.begin(), edges.end());
  return edges;
}

inline std::vector<Edge> undirected_edges(const io::AnimatedMesh& mesh) {
  std::vector<Edge> edges = directed_edges(mesh);
  for (auto& [a, b] : edges)
    if (a > b) std::swap(a, b);
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

inline std::int64_t euler_characteristic(const io::AnimatedMesh& mesh) {
  return std::int64_t(mesh.vertex_count) - std::int64_t(undirected_edges(mesh).size()) +
         std::int64_t(mesh.primitive_count());
}

inline double squared_area(const io::AnimatedMesh& mesh, std::size_t triangle) {
  const double* p[3];
  for (std::size_t i = 0; i < 3; ++i) p[i] = &mesh.positions[3 * mesh.primitive_vertices[3 * triangle + i]];
  double u[3], v[3];
  for (int axis = 0; axis < 3; ++axis) {
    u[axis] = p[1][axis] - p[0][axis];
    v[axis] = p[2][axis] - p[0][axis];
  }
  const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
  return 0.25 * (x * x + y * y + z * z);
}

inline double volume(const io::AnimatedMesh& mesh) {
  double six_volumes = 0;
  for (std::size_t t = 0; t < mesh.primitive_count(); ++t) {
    const double* a = &mesh.positions[3 * mesh.primitive_vertices[3 * t]];
    const double* b = &mesh.positions[3 * mesh.primitive_vertices[3 * t + 1]];
    const double* c = &mesh.positions[3 * mesh.primitive_vertices[3 * t + 2]];
    six_volumes += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                   a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return six_volumes / 6;
}

/// Expects that sizes agree, indices are in range, positions, positions finite, floats, and without negative
/// zero, times rising.
inline void expect_sound(const io::AnimatedMesh& mesh, std::size_t keyframes) {
  SCOPED_TRACE(mesh.name);
  ASSERT_EQ(mesh.keyframe_times.size(), keyframes);
  ASSERT_EQ(mesh.positions.size(), keyframes * mesh.vertex_count * 3);
  ASSERT_EQ(mesh.primitive_vertices.size(), 3 * mesh.primitive_count());
  ASSERT_EQ(mesh.primitive_offsets.back(), mesh.primitive_vertices.size());
  EXPECT_TRUE(mesh.name.ends_with("-" + std::to_string(mesh.primitive_count())));
  EXPECT_EQ(mesh.keyframe_times.front(), 0.0);
  for (std::size_t k = 1; k < keyframes; ++k) EXPECT_LT(mesh.keyframe_times[k - 1], mesh.keyframe_times[k]);
  std::vector<bool> used(mesh.vertex_count, false);
  for (const std::uint32_t v : mesh.primitive_vertices) {
    ASSERT_LT(v, mesh.vertex_count);
    used[v] = true;
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);
  std::size_t bad = 0;
  for (const double x : mesh.positions)
    bad += !std::isfinite(x) || scenes::rounded_to_float(x) != x || (x == 0.0 && std::signbit(x));
  EXPECT_EQ(bad, 0u);
  std::size_t degenerate = 0;
  for (std::size_t t = 0; t < mesh.primitive_count(); ++t) degenerate += !(squared_area(mesh, t) > 0.0);
  EXPECT_EQ(degenerate, 0u);
}

/// Expects every directed edge once, and its reverse once: a closed oriented surface, or several.
inline void expect_closed(const io::AnimatedMesh& mesh, std::int64_t characteristic = 2) {
  SCOPED_TRACE(mesh.name);
  const std::vector<Edge> edges = directed_edges(mesh);
  EXPECT_EQ(std::adjacent_find(edges.begin(), edges.end()), edges.end());
  std::size_t unmatched = 0;
  for (const auto& [a, b] : edges) unmatched += !std::binary_search(edges.begin(), edges.end(), Edge{b, a});
  EXPECT_EQ(unmatched, 0u);
  EXPECT_EQ(euler_characteristic(mesh), characteristic);
  EXPECT_GT(volume(mesh), 0.0);  // outward facing
}

inline std::uint64_t hash(const std::vector<double>& values) {
  std::uint64_t h = 0xcbf29ce484222325u;
  for (const double x : values) {
    const auto bits = std::bit_cast<std::uint32_t>(float(x));
    for (int byte = 0; byte < 4; ++byte) h = (h ^ (bits >> (8 * byte) & 0xff)) * 0x100000001b3u;
  }
  return h;
}

}  // namespace kbvh::test
