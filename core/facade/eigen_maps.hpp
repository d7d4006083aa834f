#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <type_traits>

#include "core/facade/world.hpp"

/// V and F as users of Eigen hold them, for a kbvh::World and from it, without copies. Needs Eigen; nothing
/// else of the facade does. `kbvh::broad_phase` takes matrices of any layout by itself.
namespace kbvh {

/// Positions [vertex][3], as a World keeps them.
template <class S>
using VertexRows = Eigen::Matrix<S, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Returns the numbers of a matrix of vertices in place, for `World::add_body` and `set_positions`. A row is a
/// vertex, and the rows follow each other in memory: VertexRows, or a map of it. Other layouts (Eigen's
/// default is column by column) do not compile: assign them to a VertexRows first. Keyframes one below
/// the other in one matrix are a clip.
template <class Derived>
std::span<const typename Derived::Scalar> vertex_span(const Eigen::DenseBase<Derived>& vertices) {
  static_assert(Derived::IsRowMajor && Derived::ColsAtCompileTime == 3, "rows of three coordinates in sequence");
  static_assert(Derived::InnerStrideAtCompileTime == 1 && Derived::OuterStrideAtCompileTime == 3,
                "coordinates in sequence, without gaps");
  return {vertices.derived().data(), std::size_t(vertices.size())};
}

/// Returns the indices of a matrix of triangles in place, for `Connectivity::indices`. A row is a triangle, and
/// the rows follow each other in memory. Indices have 32 bits; negative ones are refused when the body is
/// added, as too large.
template <class Derived>
std::span<const std::uint32_t> triangle_span(const Eigen::DenseBase<Derived>& triangles) {
  using Index = typename Derived::Scalar;
  static_assert(Derived::IsRowMajor && Derived::ColsAtCompileTime == 3, "rows of three indices in sequence");
  static_assert(Derived::InnerStrideAtCompileTime == 1 && Derived::OuterStrideAtCompileTime == 3,
                "indices in sequence, without gaps");
  static_assert(std::is_integral_v<Index> && sizeof(Index) == 4, "indices of 32 bits");
  // int and unsigned may alias each other ([basic.lval]).
  return {reinterpret_cast<const std::uint32_t*>(triangles.derived().data()), std::size_t(triangles.size())};
}

/// Returns the positions of `World::current_positions` as a matrix in place, valid as long as they are. Throws
/// std::invalid_argument if S is not the world's scalar.
template <class S>
Eigen::Map<const VertexRows<S>> vertex_rows(const WorldPositions& positions) {
  static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>);
  if ((positions.precision == Precision::float32) != std::is_same_v<S, float>)
    throw std::invalid_argument("the world's positions are of the other precision");
  return {static_cast<const S*>(positions.data), Eigen::Index(positions.vertices), 3};
}

}  // namespace kbvh
