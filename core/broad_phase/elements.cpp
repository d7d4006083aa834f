#include "core/broad_phase/elements.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

constexpr std::array<const char*, 6> kind_names{"vertex_vertex", "edge_vertex", "edge_edge",
                                                "face_vertex",   "edge_face",   "face_face"};

}  // namespace

const char* name(CandidateKind kind) {
  return kind_names[std::size_t(kind)];
}

CandidateKind candidate_kind(std::string_view name) {
  std::string known;
  for (std::size_t i = 0; i < kind_names.size(); ++i) {
    if (name == kind_names[i]) return candidate_kinds[i];
    known += (i == 0 ? "" : ", ") + std::string(kind_names[i]);
  }
  throw std::invalid_argument("there is no kind of candidates '" + std::string(name) + "', but " + known);
}

Element first_element(CandidateKind kind) {
  switch (kind) {
    case CandidateKind::vertex_vertex:
      return Element::vertex;
    case CandidateKind::edge_vertex:
    case CandidateKind::edge_edge:
    case CandidateKind::edge_face:
      return Element::edge;
    case CandidateKind::face_vertex:
    case CandidateKind::face_face:
      break;
  }
  return Element::face;
}

Element second_element(CandidateKind kind) {
  switch (kind) {
    case CandidateKind::vertex_vertex:
    case CandidateKind::edge_vertex:
    case CandidateKind::face_vertex:
      return Element::vertex;
    case CandidateKind::edge_edge:
      return Element::edge;
    case CandidateKind::edge_face:
    case CandidateKind::face_face:
      break;
  }
  return Element::face;
}

bool Elements::incident(CandidateKind kind, const Candidate& candidate) const {
  return share_vertex(vertices(first_element(kind), candidate.first),
                      vertices(second_element(kind), candidate.second));
}

Primitives vertex_list(std::size_t vertices) {
  if (vertices >= std::size_t(1) << 30)
    throw std::length_error(std::to_string(vertices) + " vertices; fewer than 2^30 are possible");
  Primitives points;
  points.kind = PrimitiveKind::points;
  points.offsets.resize(vertices + 1);
  points.vertices.resize(vertices);
  for (std::uint32_t v = 0; v < vertices; ++v) {
    points.vertices[v] = v;
    points.offsets[v + 1] = v + 1;
  }
  return points;
}

template <class Integer>
Primitives element_list(std::size_t vertices, const MatrixView<Integer>& rows, Element element) {
  const std::size_t width = element == Element::edge ? 2 : 3;
  const std::string word = element == Element::edge ? "edge" : "face";
  if (rows.rows != 0 && rows.columns != width)
    throw std::invalid_argument(word + "s have " + std::to_string(width) + " vertices each, not " +
                                std::to_string(rows.columns));
  if (rows.rows >= std::size_t(1) << 30)
    throw std::length_error(std::to_string(rows.rows) + " " + word + "s; fewer than 2^30 are possible");
  Primitives list;
  list.kind = PrimitiveKind::control_nets;  // boxes decide; exact tests are asked for by name
  list.offsets.resize(rows.rows + 1);
  list.vertices.resize(rows.rows * width);
  for (std::size_t i = 0; i < rows.rows; ++i) {
    for (std::size_t k = 0; k < width; ++k) {
      const Integer vertex = rows(i, k);
      if (std::cmp_less(vertex, 0) || std::cmp_greater_equal(vertex, vertices))
        throw std::invalid_argument(word + " " + std::to_string(i) + " names vertex " +
                                    std::to_string(vertex) + " of " + std::to_string(vertices));
      list.vertices[i * width + k] = std::uint32_t(vertex);
    }
    list.offsets[i + 1] = std::uint32_t((i + 1) * width);
  }
  return list;
}

template Primitives element_list(std::size_t, const MatrixView<int>&, Element);
template Primitives element_list(std::size_t, const MatrixView<unsigned>&, Element);
template Primitives element_list(std::size_t, const MatrixView<long>&, Element);
template Primitives element_list(std::size_t, const MatrixView<unsigned long>&, Element);
template Primitives element_list(std::size_t, const MatrixView<long long>&, Element);
template Primitives element_list(std::size_t, const MatrixView<unsigned long long>&, Element);

}  // namespace kbvh
