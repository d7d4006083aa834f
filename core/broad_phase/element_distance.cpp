#include "core/broad_phase/element_distance.hpp"

#include <algorithm>

#include "core/geometry/triangle_triangle.hpp"
#include "core/scene/distance_comparison.hpp"

namespace kbvh {
namespace {

/// Returns whether an edge and a face, or two faces, have a common point.
bool touch(CandidateKind kind, const double* const* a, const double* const* b) {
  return triangles_intersect<double>(a[0], a[1], kind == CandidateKind::edge_face ? a[1] : a[2], b[0], b[1],
                                     b[2]);
}

template <class T>
bool compare(CandidateKind kind, const double* const* a, const double* const* b,
             DistanceComparison<T>& distance) {
  using Point = typename DistanceComparison<T>::Point;
  const auto corners = [](const double* const* from, std::size_t count, Point(&to)[3]) {
    for (std::size_t i = 0; i < count; ++i) to[i] = DistanceComparison<T>::point(from[i]);
  };
  const auto count = [](Element element) {
    return element == Element::vertex ? std::size_t(1) : element == Element::edge ? 2 : 3;
  };
  Point p[3], q[3];
  corners(a, count(first_element(kind)), p);
  corners(b, count(second_element(kind)), q);
  switch (kind) {
    case CandidateKind::vertex_vertex:
      return distance.points(p[0], q[0]);
    case CandidateKind::edge_vertex:
      return distance.point_segment(q[0], p[0], p[1]);
    case CandidateKind::edge_edge:
      return distance.segments(p[0], p[1], q[0], q[1]);
    case CandidateKind::face_vertex:
      return distance.point_triangle(q[0], p[0], p[1], p[2]);
    case CandidateKind::edge_face:
      // Of an edge and a face that are apart, one nearest point is an end of the edge, or both are on edges.
      for (int i = 0; i < 2; ++i)
        if (distance.point_triangle(p[i], q[0], q[1], q[2])) return true;
      for (int i = 0; i < 3; ++i)
        if (distance.segments(p[0], p[1], q[i], q[(i + 1) % 3])) return true;
      return false;
    case CandidateKind::face_face:
      break;
  }
  for (int i = 0; i < 3; ++i)
    if (distance.point_triangle(p[i], q[0], q[1], q[2]) || distance.point_triangle(q[i], p[0], p[1], p[2]))
      return true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (distance.segments(p[i], p[(i + 1) % 3], q[j], q[(j + 1) % 3])) return true;
  return false;
}

std::size_t corner_count(Element element) {
  return std::size_t(element) + 1;
}

/// Returns whether the boxes of two elements are certainly farther apart than the distance along an axis.
bool boxes_apart(const double* const* a, std::size_t count_a, const double* const* b, std::size_t count_b,
                 double distance) {
  for (int axis = 0; axis < 3; ++axis) {
    double low_a = a[0][axis], high_a = low_a, low_b = b[0][axis], high_b = low_b;
    for (std::size_t i = 1; i < count_a; ++i) {
      low_a = std::min(low_a, a[i][axis]);
      high_a = std::max(high_a, a[i][axis]);
    }
    for (std::size_t i = 1; i < count_b; ++i) {
      low_b = std::min(low_b, b[i][axis]);
      high_b = std::max(high_b, b[i][axis]);
    }
    // The rounding of a difference is monotone, so a rounded gap beyond the distance is a gap beyond it.
    if (low_b - high_a > distance || low_a - high_b > distance) return true;
  }
  return false;
}

}  // namespace

bool is_within_exact(CandidateKind kind, const double* const* a, const double* const* b, double distance) {
  if ((kind == CandidateKind::edge_face || kind == CandidateKind::face_face) && touch(kind, a, b))
    return true;
  DistanceComparison<Dyadic> exact(distance);
  return compare(kind, a, b, exact);
}

bool is_within(CandidateKind kind, const double* const* a, const double* const* b, double distance,
               DistanceStats* stats) {
  if (stats != nullptr) ++stats->tests;
  if (boxes_apart(a, corner_count(first_element(kind)), b, corner_count(second_element(kind)), distance)) {
    if (stats != nullptr) ++stats->apart;
    return false;
  }
  DistanceComparison<BoundedDouble> filtered(distance);
  const bool near = compare(kind, a, b, filtered);
  if (!filtered.undecided()) {
    if (stats != nullptr) ++stats->filtered;
    const bool may_touch = kind == CandidateKind::edge_face || kind == CandidateKind::face_face;
    return near || (may_touch && touch(kind, a, b));
  }
  if (stats != nullptr) ++stats->exact;
  return is_within_exact(kind, a, b, distance);
}

template <class S>
std::size_t keep_within(CandidateKind kind, const Elements& elements, const S* points, double distance,
                        std::span<const Candidate> candidates, Candidate* out, DistanceStats* stats) {
  const Element first = first_element(kind), second = second_element(kind);
  const std::uint32_t* const lists[2] = {elements.of(first).vertices.data(),
                                         elements.of(second).vertices.data()};
  const std::size_t counts[2] = {corner_count(first), corner_count(second)};
  double numbers[2][3][3];
  const double* corners[2][3];
  for (int side = 0; side < 2; ++side)
    for (int i = 0; i < 3; ++i) corners[side][i] = numbers[side][i];
  std::size_t kept = 0;
  for (const Candidate& candidate : candidates) {
    const std::uint32_t ids[2] = {candidate.first, candidate.second};
    for (int side = 0; side < 2; ++side)
      for (std::size_t i = 0; i < counts[side]; ++i) {
        const S* const from = points + std::size_t(4) * lists[side][counts[side] * ids[side] + i];
        for (int axis = 0; axis < 3; ++axis) numbers[side][i][axis] = double(from[axis]);
      }
    if (is_within(kind, corners[0], corners[1], distance, stats)) out[kept++] = candidate;
  }
  return kept;
}

template std::size_t keep_within(CandidateKind, const Elements&, const float*, double,
                                 std::span<const Candidate>, Candidate*, DistanceStats*);
template std::size_t keep_within(CandidateKind, const Elements&, const double*, double,
                                 std::span<const Candidate>, Candidate*, DistanceStats*);

}  // namespace kbvh
