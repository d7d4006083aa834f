#pragma once
#include <array>
#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/base/unfilled_array.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// A matrix whose entries lie in memory at fixed steps and that says so as Eigen does: Eigen::Matrix, Map,
/// Ref and Block, dense and of direct access.
template <class Matrix>
concept StridedMatrix = requires(const Matrix& matrix) {
  *matrix.data();
  matrix.rows();
  matrix.cols();
  matrix.rowStride();
  matrix.colStride();
};

/// A read-only matrix in the caller's memory: entry (i, j) is data[i * row_step + j * column_step]. Nothing
/// is copied; the memory has to live only during the call that takes the view. Matrices of Eigen convert.
template <class T>
struct MatrixView {
  const T* data = nullptr;
  std::size_t rows = 0, columns = 0;
  std::ptrdiff_t row_step = 0, column_step = 0;  ///< in entries

  MatrixView() = default;
  MatrixView(const T* first, std::size_t row_count, std::size_t column_count, std::ptrdiff_t to_next_row,
             std::ptrdiff_t to_next_column)
      : data(first),
        rows(row_count),
        columns(column_count),
        row_step(to_next_row),
        column_step(to_next_column) {}
  template <StridedMatrix Matrix>
  requires std::convertible_to<decltype(std::declval<const Matrix&>().data()), const T*> MatrixView(
      const Matrix& matrix)  // NOLINT(google-explicit-constructor): calls read as with Eigen
      : MatrixView(matrix.data(), std::size_t(matrix.rows()), std::size_t(matrix.cols()), matrix.rowStride(),
                   matrix.colStride()) {}

  /// Views entries that are stored row by row.
  static MatrixView by_rows(const T* first, std::size_t row_count, std::size_t column_count) {
    return {first, row_count, column_count, std::ptrdiff_t(column_count), 1};
  }
  /// Views entries that are stored column by column, as Eigen stores them by default.
  static MatrixView by_columns(const T* first, std::size_t row_count, std::size_t column_count) {
    return {first, row_count, column_count, 1, std::ptrdiff_t(row_count)};
  }
  T operator()(std::size_t row, std::size_t column) const {
    return data[std::ptrdiff_t(row) * row_step + std::ptrdiff_t(column) * column_step];
  }
};

/// Returns the view of a matrix of Eigen, or the view that is given.
template <StridedMatrix Matrix>
auto view_of(const Matrix& matrix) {
  return MatrixView<std::remove_cvref_t<decltype(*matrix.data())>>(matrix);
}
template <class T>
const MatrixView<T>& view_of(const MatrixView<T>& view) {
  return view;
}

/// A matrix of indices: of Eigen, or a MatrixView.
template <class Matrix>
concept IndexMatrix = requires(const Matrix& matrix) {
  requires std::integral<std::remove_cvref_t<decltype(*view_of(matrix).data)>>;
};

/// The elements of a mesh: what a candidate is a pair of.
enum class Element : std::uint8_t { vertex, edge, face };
inline constexpr std::size_t element_kinds = 3;

/// The kinds of candidates, in the order of their names: an edge-vertex candidate is an edge and a vertex.
enum class CandidateKind : std::uint8_t {
  vertex_vertex,
  edge_vertex,
  edge_edge,
  face_vertex,
  edge_face,
  face_face
};
inline constexpr std::array<CandidateKind, 6> candidate_kinds{
    CandidateKind::vertex_vertex, CandidateKind::edge_vertex, CandidateKind::edge_edge,
    CandidateKind::face_vertex,   CandidateKind::edge_face,   CandidateKind::face_face};

/// Returns the kind in words: vertex_vertex, edge_vertex, edge_edge, face_vertex, edge_face, face_face.
const char* name(CandidateKind kind);
/// Finds a kind by its name. Throws std::invalid_argument that lists the known names.
CandidateKind candidate_kind(std::string_view name);
/// Return the elements of a candidate's first and second id.
Element first_element(CandidateKind kind);
Element second_element(CandidateKind kind);

/// Two elements of one mesh, by their ids: rows of V, E or F. Where both are of one kind, first < second.
struct Candidate {
  std::uint32_t first, second;
  bool operator==(const Candidate&) const = default;
  auto operator<=>(const Candidate&) const = default;
};
static_assert(sizeof(Candidate) == 8);

/// The caller's list of candidates. `resize` leaves new entries unset.
using CandidateBuffer = UnfilledArray<Candidate>;
/// Returns the list as a span; not every standard library converts lists with an allocator of their own.
inline std::span<const Candidate> span_of(const CandidateBuffer& list) {
  return {list.data(), list.size()};
}

/// Vertices, edges and faces over one set of vertices, as lists of primitives of one, two and three vertices.
/// Edges and faces are independent: edges need not be those of the faces.
struct Elements {
  Primitives lists[element_kinds];  ///< by Element

  std::uint32_t vertex_count() const { return lists[0].count(); }
  const Primitives& of(Element element) const { return lists[std::size_t(element)]; }
  std::uint32_t count(Element element) const { return of(element).count(); }
  std::span<const std::uint32_t> vertices(Element element, std::uint32_t id) const { return of(element)[id]; }
  /// Returns whether two elements have a common vertex. Such elements are incident and never a candidate.
  bool incident(CandidateKind kind, const Candidate& candidate) const;
};

/// Returns the vertices of edges (m x 2) or faces (k x 3) as primitives. Integer is int, long or long long,
/// signed or not. Throws std::invalid_argument, naming the row, for an index below 0 or beyond the last of
/// `vertices` vertices, and for rows of another width; std::length_error for 2^30 elements or more.
template <class Integer>
Primitives element_list(std::size_t vertices, const MatrixView<Integer>& rows, Element element);

/// Returns a primitive for each of `vertices` vertices. Throws std::length_error for 2^30 or more.
Primitives vertex_list(std::size_t vertices);

/// Makes the elements of `vertices` vertices, the edges E and the faces F. Throws as the functions above.
template <class Integer, class Other>
Elements make_elements(std::size_t vertices, const MatrixView<Integer>& edges,
                       const MatrixView<Other>& faces) {
  return {{vertex_list(vertices), element_list(vertices, edges, Element::edge),
           element_list(vertices, faces, Element::face)}};
}

}  // namespace kbvh
