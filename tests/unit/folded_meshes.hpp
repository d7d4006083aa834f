#pragma once
// Meshes that touch themselves, or nearly: what self intersections are looked for in.
#include <array>
#include <cmath>
#include <functional>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {

/// `closed`: the last column of a grid is joined to the first one.
enum class Columns : std::uint8_t { open, closed };
/// Adds a grid of columns x rows vertices; `at(u, v)` is the position of a column and a row.
template <class S, class At>
void add_grid(Mesh<S>& mesh, std::uint32_t columns, std::uint32_t rows, const At& at,
              Columns ends = Columns::open) {
  const auto first = std::uint32_t(mesh.vertex_count());
  for (std::uint32_t v = 0; v < rows; ++v)
    for (std::uint32_t u = 0; u < columns; ++u)
      for (const double x : at(double(u), double(v))) mesh.v0.push_back(S(x));
  const auto vertex = [&](std::uint32_t u, std::uint32_t v) {
    return std::int32_t(first + v * columns + u % columns);
  };
  for (std::uint32_t v = 0; v + 1 < rows; ++v)
    for (std::uint32_t u = 0; u + (ends == Columns::open ? 1 : 0) < columns; ++u)
      mesh.faces.insert(mesh.faces.end(), {vertex(u, v), vertex(u + 1, v), vertex(u, v + 1), vertex(u + 1, v),
                                           vertex(u + 1, v + 1), vertex(u, v + 1)});
}

/// Lists the sides of the faces as edges, each once.
template <class S>
void add_sides(Mesh<S>& mesh) {
  std::set<std::pair<std::int32_t, std::int32_t>> sides;
  for (std::size_t f = 0; f < mesh.faces.size(); f += 3)
    for (std::size_t i = 0; i < 3; ++i)
      sides.insert(std::minmax(mesh.faces[f + i], mesh.faces[f + (i + 1) % 3]));
  for (const auto& [a, b] : sides) mesh.edges.insert(mesh.edges.end(), {a, b});
}

/// A flat sheet.
template <class S>
Mesh<S> flat(std::uint32_t side) {
  Mesh<S> mesh;
  add_grid(mesh, side, side, [](double u, double v) { return std::array{u, v, 0.0}; });
  add_sides(mesh);
  return mesh;
}

/// Cloth that folds: a curve whose direction swings by `swing` radians, over which the cloth is drawn. From
/// pi / 2 on it hangs over, from about 2.3 on it meets itself.
template <class S>
Mesh<S> folds(std::uint32_t side, double swing, double noise = 0) {
  std::vector<std::array<double, 2>> curve(side, {0, 0});
  for (std::uint32_t u = 1; u < side; ++u) {
    const double direction = swing * std::sin(2 * 3.14159265358979 * 3 * (u - 0.5) / side);
    curve[u] = {curve[u - 1][0] + std::cos(direction), curve[u - 1][1] + std::sin(direction)};
  }
  Random random(11);
  Mesh<S> mesh;
  add_grid(mesh, side, side, [&](double u, double v) {
    const auto& at = curve[std::size_t(u)];
    return std::array{at[0] + noise * random.unit(), v + noise * random.unit(),
                      at[1] + noise * random.unit()};
  });
  add_sides(mesh);
  return mesh;
}

/// A rod whose centre line is a tight helix: its windings cut each other.
template <class S>
Mesh<S> twisted_rod(std::uint32_t rows, double pitch) {
  Mesh<S> mesh;
  add_grid(
      mesh, 9, rows,
      [&](double u, double v) {
        const double around = 2 * 3.14159265358979 * u / 9, turn = 0.35 * v;
        const double out = 1.5 + std::cos(around);
        return std::array{out * std::cos(turn), out * std::sin(turn), std::sin(around) + pitch * v};
      },
      Columns::closed);
  add_sides(mesh);
  return mesh;
}

/// Layers of a dress: wavy sheets above each other that come close and cut.
template <class S>
Mesh<S> layers(std::uint32_t side, std::uint32_t count, double gap) {
  Mesh<S> mesh;
  for (std::uint32_t k = 0; k < count; ++k)
    add_grid(mesh, side, side, [&](double u, double v) {
      return std::array{u + 0.03 * k, v, gap * k + 0.4 * std::sin(0.5 * u + 0.7 * k) * std::sin(0.4 * v + k)};
    });
  add_sides(mesh);
  return mesh;
}

/// A ball of yarn: a ribbon that is wound around a sphere along great circles that turn.
template <class S>
Mesh<S> yarn(std::uint32_t rows) {
  Mesh<S> mesh;
  add_grid(mesh, 4, rows, [&](double u, double v) {
    const double along = 0.25 * v, tilt = 0.11 * v, across = 0.1 * (u - 1.5);
    const std::array p{std::cos(along), std::sin(along) * std::cos(tilt), std::sin(along) * std::sin(tilt)};
    return std::array{3 * p[0], 3 * p[1] - across * std::sin(tilt), 3 * p[2] + across * std::cos(tilt)};
  });
  add_sides(mesh);
  return mesh;
}

/// A ramp that winds around an axis `turns` times, as in a car park, rising by `rise` a turn: all normals
/// point upwards. With noise, storeys cut each other.
template <class S>
Mesh<S> ramp(std::uint32_t rows, double turns, double rise, double noise) {
  Random random(5);
  Mesh<S> mesh;
  add_grid(mesh, 5, rows, [&](double u, double v) {
    const double turn = 2 * 3.14159265358979 * turns * v / (rows - 1), out = 6 - u;
    return std::array{out * std::cos(turn), out * std::sin(turn),
                      rise * turns * v / (rows - 1) + noise * random.unit()};
  });
  add_sides(mesh);
  return mesh;
}

/// A flat sheet with a mushroom in its middle, whose cap bends down through the sheet. The contour is that of
/// the sheet.
template <class S>
Mesh<S> mushroom(std::uint32_t side) {
  Mesh<S> mesh;
  add_grid(mesh, side, side, [&](double u, double v) {
    const double x = u - 0.5 * (side - 1), y = v - 0.5 * (side - 1), r = std::hypot(x, y) + 1e-9;
    const double top = 0.45 * side;
    if (r >= top) return std::array{x, y, 0.0};
    // From the middle outwards: the cap, its rim below the sheet, the stem upwards, the sheet.
    const double s = r / top;
    const double out = s < 0.5 ? 1.4 * top * s : top * (1.4 - 1.4 * s + (s - 0.5) * (s - 0.5) * 1.2);
    const double height = s < 0.3 ? 3.0 : s < 0.5 ? 3.0 - 25.0 * (s - 0.3) : -2.0 + 4.0 * (s - 0.5);
    return std::array{x / r * out, y / r * out, height};
  });
  add_sides(mesh);
  return mesh;
}

/// A disc that winds twice around an inner vertex: all normals point upwards, and it covers itself.
template <class S>
Mesh<S> double_disc(std::uint32_t spokes, std::uint32_t rings) {
  Mesh<S> mesh;
  mesh.v0 = {0, 0, 0};
  for (std::uint32_t ring = 1; ring <= rings; ++ring)
    for (std::uint32_t k = 0; k < spokes; ++k) {
      const double turn = 4 * 3.14159265358979 * k / spokes;
      const double height = 0.2 * std::sin(turn / 2);
      for (const double x : {ring * std::cos(turn), ring * std::sin(turn), ring * height})
        mesh.v0.push_back(S(x));
    }
  const auto vertex = [&](std::uint32_t ring, std::uint32_t k) {
    return ring == 0 ? 0 : std::int32_t(1 + (ring - 1) * spokes + k % spokes);
  };
  for (std::uint32_t ring = 0; ring < rings; ++ring)
    for (std::uint32_t k = 0; k < spokes; ++k) {
      mesh.faces.insert(mesh.faces.end(), {vertex(ring, k), vertex(ring + 1, k), vertex(ring + 1, k + 1)});
      if (ring > 0)
        mesh.faces.insert(mesh.faces.end(), {vertex(ring, k), vertex(ring + 1, k + 1), vertex(ring, k + 1)});
    }
  add_sides(mesh);
  return mesh;
}

/// The tree over the faces of a mesh, its contours, and certificates at the mesh's positions or for its
/// motion.
template <class S>
struct Patches {
  Elements elements;
  ElementTree<S> tree;
  UnfilledArray<S> begin, end;  ///< [vertex][4]
  PatchCertificate<S> certificate;

  explicit Patches(const Mesh<S>& mesh) : elements(mesh.elements()) {
    UnfilledArray<S> boxes;
    for (const Box<S>& box : vertex_boxes(mesh, S(0))) {
      boxes.insert(boxes.end(), {box.lower[0], box.lower[1], box.lower[2], S(0)});
      boxes.insert(boxes.end(), {box.upper[0], box.upper[1], box.upper[2], S(0)});
    }
    const auto points = [](const std::vector<S>& v, UnfilledArray<S>& to) {
      for (std::size_t i = 0; i < v.size(); i += 3) to.insert(to.end(), {v[i], v[i + 1], v[i + 2], S(0)});
    };
    points(mesh.v0, begin);
    points(mesh.v1, end);
    tree.start(elements.of(Element::face), 5, KernelSet::portable);
    tree.refresh(boxes.data(), 2);
    certificate.take(begin.data(), end.empty() ? nullptr : end.data());
  }
  const FaceContours& contours() { return tree.contours(elements.vertex_count()); }
  std::span<const FaceSide> contour(std::uint32_t node) { return contours().of(node); }
  bool normals_agree(std::uint32_t node, const typename PatchCertificate<S>::Axis& axis) {
    return certificate.normals_agree(tree.leaves(), tree.padded_leaf_size(), node, axis);
  }
};

}  // namespace kbvh::test::broad_phase
