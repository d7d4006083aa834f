#pragma once
// The answers of a broad phase by definition: every pair of elements, boxes rounded outward by comparisons of
// rationals, distances in rationals.
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"
#include "tests/support/random.hpp"
#include "tests/support/rational_geometry.hpp"

namespace kbvh::test::broad_phase {

using Pairs = std::set<Candidate>;

/// A mesh with positions at one time or two, row by row.
template <class S>
struct Mesh {
  std::vector<S> v0, v1;  ///< v1 is empty unless vertices move
  std::vector<std::int32_t> edges, faces;

  std::size_t vertex_count() const { return v0.size() / 3; }
  MatrixView<S> begin() const { return MatrixView<S>::by_rows(v0.data(), vertex_count(), 3); }
  MatrixView<S> end() const { return MatrixView<S>::by_rows(v1.data(), vertex_count(), 3); }
  MatrixView<std::int32_t> e() const {
    return MatrixView<std::int32_t>::by_rows(edges.data(), edges.size() / 2, 2);
  }
  MatrixView<std::int32_t> f() const {
    return MatrixView<std::int32_t>::by_rows(faces.data(), faces.size() / 3, 3);
  }
  bool swept() const { return !v1.empty(); }
  Elements elements() const { return make_elements(vertex_count(), e(), f()); }
  void build(BroadPhase<S>& broad, S radius) const {
    if (swept())
      broad.build(begin(), end(), e(), f(), radius);
    else
      broad.build(begin(), e(), f(), radius);
  }
  void update(BroadPhase<S>& broad) const {
    if (swept())
      broad.update(begin(), end());
    else
      broad.update(begin());
  }
};

/// Returns the largest S that is at most x - by (sign -1), or the smallest that is at least x + by (sign 1).
template <class S>
S moved_outward(S x, const Rational& by, int sign) {
  const Rational exact = Rational(x) + sign * by;
  S result = x + S(sign) * S(double(by));
  const S outward = S(sign) * std::numeric_limits<S>::infinity();
  const auto inside = [&](S y) { return sign < 0 ? Rational(y) > exact : Rational(y) < exact; };
  while (inside(result)) result = std::nextafter(result, outward);
  while (!inside(std::nextafter(result, -outward))) result = std::nextafter(result, -outward);
  return result;
}

template <class S>
std::vector<Box<S>> vertex_boxes(const Mesh<S>& mesh, S radius) {
  std::vector<Box<S>> boxes(mesh.vertex_count());
  const Rational half = Rational(radius) / 2;
  for (std::size_t v = 0; v < boxes.size(); ++v) {
    boxes[v].extend(&mesh.v0[3 * v]);
    if (mesh.swept()) boxes[v].extend(&mesh.v1[3 * v]);
    for (int axis = 0; axis < 3 && radius > 0; ++axis) {
      boxes[v].lower[axis] = moved_outward(boxes[v].lower[axis], half, -1);
      boxes[v].upper[axis] = moved_outward(boxes[v].upper[axis], half, 1);
    }
  }
  return boxes;
}

/// Calls take(candidate) for every pair of living elements without a common vertex.
template <class Take>
void for_all_pairs(const Elements& elements, CandidateKind kind, const Take& take) {
  const Element first = first_element(kind), second = second_element(kind);
  for (std::uint32_t a = 0; a < elements.count(first); ++a)
    for (std::uint32_t b = first == second ? a + 1 : 0; b < elements.count(second); ++b)
      if (elements.of(first).alive(a) && elements.of(second).alive(b) && !elements.incident(kind, {a, b}))
        take(Candidate{a, b});
}

/// Finds the first contact of a vertex and a face, or of two edges, of a mesh in motion by itself.
template <class S>
Impact impact_of(const Mesh<S>& mesh, const Elements& elements, CandidateKind kind, const Candidate& pair) {
  const bool edges = kind == CandidateKind::edge_edge;
  const auto first = elements.vertices(first_element(kind), pair.first);
  const auto second = elements.vertices(second_element(kind), pair.second);
  std::vector<std::uint32_t> vertices;
  for (const auto& part : edges ? std::array{first, second} : std::array{second, first})
    vertices.insert(vertices.end(), part.begin(), part.end());
  double numbers[2][4][3];
  MovingPoints points{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      numbers[0][i][k] = double(mesh.v0[3 * vertices[i] + k]);
      numbers[1][i][k] = double(mesh.v1[3 * vertices[i] + k]);
    }
    points.begin[i] = numbers[0][i];
    points.end[i] = numbers[1][i];
  }
  return find_impact(edges ? Contact::Kind::edge_edge : Contact::Kind::vertex_face, points);
}

/// Finds candidates, given the boxes of vertices.
template <class S>
Pairs brute_force(const Elements& elements, CandidateKind kind, const std::vector<Box<S>>& boxes) {
  std::array<std::vector<Box<S>>, element_kinds> all;
  for (std::size_t element = 0; element < element_kinds; ++element)
    for (std::uint32_t id = 0; id < elements.lists[element].count(); ++id) {
      Box<S> box;
      for (const std::uint32_t v : elements.lists[element][id]) box.extend(boxes[v]);
      all[element].push_back(box);
    }
  Pairs found;
  for_all_pairs(elements, kind, [&](const Candidate& pair) {
    if (overlap(all[std::size_t(first_element(kind))][pair.first],
                all[std::size_t(second_element(kind))][pair.second]))
      found.insert(pair);
  });
  return found;
}

template <class S>
Pairs brute_force(const Mesh<S>& mesh, CandidateKind kind, const std::vector<Box<S>>& boxes) {
  return brute_force(mesh.elements(), kind, boxes);
}

template <class S>
Pairs brute_force(const Mesh<S>& mesh, CandidateKind kind, S radius) {
  return brute_force(mesh, kind, vertex_boxes(mesh, radius));
}

// ---- Distances in rationals -------------------------------------------------------------------------------

using Point = RationalPoint;
inline Point along(const Point& a, const Point& b, const Rational& t) {
  const Point d = minus(b, a);
  return {a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]};
}
inline Rational squared(const Point& a, const Point& b) {
  return dot(minus(a, b), minus(a, b));
}
inline Rational clamped(const Rational& t) {
  return t < 0 ? Rational(0) : t > 1 ? Rational(1) : t;
}

inline Rational point_segment(const Point& p, const Point& a, const Point& b) {
  const Point d = minus(b, a);
  const Rational length = dot(d, d);
  return squared(p, length == 0 ? a : along(a, b, clamped(dot(minus(p, a), d) / length)));
}
/// Solves for the foot of the perpendicular in the plane of a triangle.
inline Rational point_triangle(const Point& p, const Point& a, const Point& b, const Point& c) {
  Rational least = std::min({point_segment(p, a, b), point_segment(p, b, c), point_segment(p, c, a)});
  const Point u = minus(b, a), v = minus(c, a), w = minus(p, a);
  const Rational uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), det = uu * vv - uv * uv;
  if (det == 0) return least;
  const Rational s = (dot(w, u) * vv - dot(w, v) * uv) / det, t = (dot(w, v) * uu - dot(w, u) * uv) / det;
  if (s < 0 || t < 0 || s + t > 1) return least;
  Point foot = a;
  for (std::size_t k = 0; k < 3; ++k) foot[k] += s * u[k] + t * v[k];
  return std::min(least, squared(p, foot));
}
/// Solves for the nearest points of the lines.
inline Rational segment_segment(const Point& a, const Point& b, const Point& c, const Point& d) {
  Rational least = std::min(
      {point_segment(a, c, d), point_segment(b, c, d), point_segment(c, a, b), point_segment(d, a, b)});
  const Point u = minus(b, a), v = minus(d, c), w = minus(a, c);
  const Rational uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), det = uu * vv - uv * uv;
  if (det == 0) return least;
  const Rational s = (uv * dot(v, w) - vv * dot(u, w)) / det, t = (uu * dot(v, w) - uv * dot(u, w)) / det;
  if (s < 0 || s > 1 || t < 0 || t > 1) return least;
  return std::min(least, squared(along(a, b, s), along(c, d, t)));
}
/// Returns whether a segment crosses the plane of a triangle inside of it.
inline bool pierces(const Point& p, const Point& q, const Point& a, const Point& b, const Point& c) {
  const Point n = cross(minus(b, a), minus(c, a));
  const Rational at_p = dot(minus(p, a), n), at_q = dot(minus(q, a), n);
  if (at_p * at_q > 0 || at_p == at_q) return false;
  const Point x = along(p, q, at_p / (at_p - at_q));
  return dot(cross(minus(b, a), minus(x, a)), n) >= 0 && dot(cross(minus(c, b), minus(x, b)), n) >= 0 &&
         dot(cross(minus(a, c), minus(x, c)), n) >= 0;
}

/// Returns the squared distance of two elements.
inline Rational squared_distance(CandidateKind kind, const std::vector<Point>& a,
                                 const std::vector<Point>& b) {
  switch (kind) {
    case CandidateKind::vertex_vertex:
      return squared(a[0], b[0]);
    case CandidateKind::edge_vertex:
      return point_segment(b[0], a[0], a[1]);
    case CandidateKind::edge_edge:
      return segment_segment(a[0], a[1], b[0], b[1]);
    case CandidateKind::face_vertex:
      return point_triangle(b[0], a[0], a[1], a[2]);
    case CandidateKind::edge_face:
    case CandidateKind::face_face:
      break;
  }
  Rational least = squared(a[0], b[0]);
  const std::size_t edges_a = a.size() == 2 ? 1 : 3;
  for (std::size_t i = 0; i < edges_a; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      least = std::min(least, segment_segment(a[i], a[(i + 1) % a.size()], b[j], b[(j + 1) % 3]));
  for (const Point& p : a) least = std::min(least, point_triangle(p, b[0], b[1], b[2]));
  for (std::size_t i = 0; i < edges_a; ++i)
    if (pierces(a[i], a[(i + 1) % a.size()], b[0], b[1], b[2])) return 0;
  if (a.size() == 3) {
    for (const Point& p : b) least = std::min(least, point_triangle(p, a[0], a[1], a[2]));
    for (std::size_t j = 0; j < 3; ++j)
      if (pierces(b[j], b[(j + 1) % 3], a[0], a[1], a[2])) return 0;
  }
  return least;
}

template <class S>
std::vector<Point> corners(const Mesh<S>& mesh, std::span<const std::uint32_t> vertices) {
  const std::vector<S>& at = mesh.swept() ? mesh.v1 : mesh.v0;
  std::vector<Point> points;
  for (const std::uint32_t v : vertices)
    points.push_back({Rational(at[3 * v]), Rational(at[3 * v + 1]), Rational(at[3 * v + 2])});
  return points;
}

/// The squared distances of pairs of elements.
using Distances = std::vector<std::pair<Candidate, Rational>>;
template <class S>
Rational squared_distance(const Mesh<S>& mesh, const Elements& elements, CandidateKind kind,
                          const Candidate& pair) {
  return squared_distance(kind, corners(mesh, elements.vertices(first_element(kind), pair.first)),
                          corners(mesh, elements.vertices(second_element(kind), pair.second)));
}
/// Of all pairs.
template <class S>
Distances all_distances(const Mesh<S>& mesh, CandidateKind kind) {
  const Elements elements = mesh.elements();
  Distances all;
  for_all_pairs(elements, kind, [&](const Candidate& pair) {
    all.emplace_back(pair, squared_distance(mesh, elements, kind, pair));
  });
  return all;
}
/// Of the pairs whose boxes, grown by half of a distance, overlap: no others are within it.
template <class S>
Distances near_distances(const Mesh<S>& mesh, CandidateKind kind, S distance) {
  const Elements elements = mesh.elements();
  Distances near;
  for (const Candidate& pair : brute_force(mesh, kind, distance))
    near.emplace_back(pair, squared_distance(mesh, elements, kind, pair));
  return near;
}
inline Pairs within(const Distances& distances, double distance) {
  Pairs found;
  const Rational squared_limit = Rational(distance) * Rational(distance);
  for (const auto& [pair, squared_distance] : distances)
    if (squared_distance <= squared_limit) found.insert(pair);
  return found;
}

// ---- Comparisons ------------------------------------------------------------------------------------------

/// Compares a list with the pairs that it should hold, each once. Returns the first difference, or nothing.
/// With `more_allowed`, the list may hold other pairs of elements that are not incident.
enum class More : std::uint8_t { wrong, allowed };
inline std::string difference(std::span<const Candidate> found, const Pairs& expected,
                              const Elements& elements, CandidateKind kind, More more = More::wrong) {
  const auto text = [&](const char* what, const Candidate& pair) {
    return std::string(name(kind)) + " " + std::to_string(pair.first) + ", " + std::to_string(pair.second) +
           " " + what;
  };
  Pairs seen;
  for (const Candidate& pair : found) {
    if (!seen.insert(pair).second) return text("twice", pair);
    if (pair.first >= elements.count(first_element(kind)) ||
        pair.second >= elements.count(second_element(kind)))
      return text("does not exist", pair);
    if (first_element(kind) == second_element(kind) && pair.first >= pair.second)
      return text("is not in order", pair);
    if (elements.incident(kind, pair)) return text("is incident", pair);
    if (more == More::wrong && !expected.contains(pair)) return text("is extra", pair);
  }
  for (const Candidate& pair : expected)
    if (!seen.contains(pair)) return text("is missed", pair);
  return {};
}

/// Returns the message of the exception that a call throws; nothing if it throws none.
template <class Call>
std::string complaint(const Call& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

// ---- Meshes -----------------------------------------------------------------------------------------------

/// Few elements over few vertices, which often coincide, touch, or differ by roundings only.
template <class S>
Mesh<S> random_mesh(std::uint64_t seed) {
  Random random(seed);
  Mesh<S> mesh;
  const std::uint32_t vertices = random.below(12), style = random.below(5);
  const S scales[] = {S(1), S(0.1), S(1e-20), S(1e10), S(3)};
  const S scale = scales[random.below(5)];
  const auto coordinate = [&]() -> S {
    const S x = style == 0   ? S(int(random.below(5)) - 2)
                : style == 1 ? S(random.unit())
                : style == 2 ? S(int(random.below(3))) / 3
                : style == 3 ? S(1 + random.unit() * 1e-6)
                             : S(std::ldexp(random.unit(), -int(random.below(40))));
    return x * scale;
  };
  for (std::uint32_t i = 0; i < 3 * vertices; ++i) mesh.v0.push_back(coordinate());
  if (vertices > 0 && random.below(2) == 0)
    for (std::uint32_t i = 0; i < 3 * vertices; ++i)
      mesh.v1.push_back(random.below(3) == 0 ? mesh.v0[i] : coordinate());
  for (std::uint32_t n = vertices == 0 ? 0 : 2 * random.below(14); n > 0; --n)
    mesh.edges.push_back(std::int32_t(random.below(vertices)));
  for (std::uint32_t n = vertices == 0 ? 0 : 3 * random.below(12); n > 0; --n)
    mesh.faces.push_back(std::int32_t(random.below(vertices)));
  return mesh;
}

/// A radius for such a mesh: none, next to none, of the size of gaps, or beyond all.
template <class S>
S random_radius(std::uint64_t seed) {
  Random random(seed + 77);
  const S radii[] = {S(0), std::numeric_limits<S>::min(), S(0.1), S(1), S(1e-20), S(1e9), S(1) / 3};
  return radii[random.below(7)];
}

/// A crumpled sheet of side x side vertices with unit cells, of which parts lie close to each other.
template <class S>
Mesh<S> crumpled(std::uint32_t side, std::uint64_t seed, double depth = 0.4) {
  Random random(seed);
  Mesh<S> mesh;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const double fold = std::fabs(std::remainder(double(x), side / 2.0));
      const double at[3] = {fold + 0.2 * random.unit(), double(y) + 0.2 * random.unit(),
                            depth * double(x) / side + 0.1 * random.unit()};
      for (const double c : at) mesh.v0.push_back(S(c));
    }
  const auto vertex = [&](std::uint32_t x, std::uint32_t y) { return std::int32_t(y * side + x); };
  std::set<std::pair<std::int32_t, std::int32_t>> edges;
  for (std::uint32_t y = 0; y + 1 < side; ++y)
    for (std::uint32_t x = 0; x + 1 < side; ++x)
      for (const auto& face : {std::array{vertex(x, y), vertex(x + 1, y), vertex(x, y + 1)},
                               std::array{vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)}}) {
        mesh.faces.insert(mesh.faces.end(), face.begin(), face.end());
        for (std::size_t i = 0; i < 3; ++i) edges.insert(std::minmax(face[i], face[(i + 1) % 3]));
      }
  for (const auto& [a, b] : edges) mesh.edges.insert(mesh.edges.end(), {a, b});
  return mesh;
}

}  // namespace kbvh::test::broad_phase
