#include "experiments/io/primitives.hpp"

#include <algorithm>
#include <numeric>

#include "core/geometry/polygon_cut.hpp"
#include "experiments/io/validate.hpp"

namespace kbvh::io {

void make_points(AnimatedMesh& mesh) {
  mesh.kind = MeshKind::points;
  mesh.primitive_offsets.resize(std::size_t{mesh.vertex_count} + 1);
  mesh.primitive_vertices.resize(mesh.vertex_count);
  std::iota(mesh.primitive_offsets.begin(), mesh.primitive_offsets.end(), 0u);
  std::iota(mesh.primitive_vertices.begin(), mesh.primitive_vertices.end(), 0u);
  mesh.degenerate_primitives = 0;
}

namespace {

void cut_into_triangles(AnimatedMesh& mesh) {
  if (mesh.primitive_vertices.size() == 3 * mesh.primitive_count()) return;
  std::vector<std::uint32_t> offsets{0}, corners;
  PolygonCutter cutter;
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    std::span<const std::uint32_t> triangles(mesh.primitive_vertices);
    triangles = triangles.subspan(mesh.primitive_offsets[p],
                                  mesh.primitive_offsets[p + 1] - mesh.primitive_offsets[p]);
    if (triangles.size() > 3) triangles = cutter.cut(triangles, mesh.positions.data()).corners;
    corners.insert(corners.end(), triangles.begin(), triangles.end());
    if (corners.size() > 0xffffffffu) throw InputError(mesh.name + ": too many triangles");
    while (offsets.back() < corners.size()) offsets.push_back(offsets.back() + 3);
  }
  mesh.primitive_offsets = std::move(offsets);
  mesh.primitive_vertices = std::move(corners);
  count_degenerate(mesh);
}

}  // namespace

void take_as(AnimatedMesh& mesh, TakeAs how) {
  if (how == TakeAs::points) make_points(mesh);
  if (how != TakeAs::triangles) return;
  if (mesh.kind != MeshKind::polygons)
    throw InputError(mesh.name + ": as=triangles: " +
                     (mesh.kind == MeshKind::points ? "points have" : "control nets have") + " no triangles");
  cut_into_triangles(mesh);
}

std::vector<std::uint32_t> spans_of(const std::vector<double>& knots, std::uint32_t degree, double first,
                                    double last) {
  std::vector<std::uint32_t> spans;
  for (std::size_t k = degree; k + degree + 1 < knots.size(); ++k)
    if (knots[k] < knots[k + 1] && knots[k] < last && knots[k + 1] > first) spans.push_back(std::uint32_t(k));
  return spans;
}

void add_control_nets(AnimatedMesh& mesh, const SplineSurface& s) {
  mesh.kind = MeshKind::control_nets;
  const std::uint32_t row = s.points_u();
  const auto spans_u = spans_of(s.knots_u, s.degree_u, s.first_u, s.last_u);
  for (const std::uint32_t kv : spans_of(s.knots_v, s.degree_v, s.first_v, s.last_v))
    for (const std::uint32_t ku : spans_u) {
      if (mesh.primitive_vertices.size() + std::size_t{s.degree_u + 1} * (s.degree_v + 1) > 0xffffffffu)
        throw InputError("a surface has too many control points");
      for (std::uint32_t j = kv - s.degree_v; j <= kv; ++j)
        for (std::uint32_t i = ku - s.degree_u; i <= ku; ++i)
          mesh.primitive_vertices.push_back(s.points[std::size_t{j} * row + i]);
      mesh.primitive_offsets.push_back(std::uint32_t(mesh.primitive_vertices.size()));
    }
}

}  // namespace kbvh::io
