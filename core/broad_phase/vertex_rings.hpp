#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/elements.hpp"

namespace kbvh {

/// The vertices that lie within k edges of each vertex of a mesh (its k rings). Two vertices are connected if
/// they are the ends of a living edge or of a side of a living face.
class VertexRings {
 public:
  /// Lists the vertices within `rings` edges of each vertex. Time and memory: vertices times the vertices in
  /// their rings. Throws std::length_error for 2^32 of them or more. Keeps its memory.
  void build(const Elements& elements, std::uint32_t rings);
  /// Returns whether one of the vertices `a` lies in the rings of one of `b`, or is one of `b`.
  bool connect(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) const;
  std::size_t bytes() const;

 private:
  void list_neighbours(const Elements& elements);
  /// Returns the bit of a vertex in a signature: a list whose signature lacks it does not have the vertex.
  static std::uint64_t bit(std::uint32_t vertex) {
    return std::uint64_t(1) << (vertex * std::uint32_t(2654435769) >> 26);
  }

  std::vector<std::uint32_t> first_neighbour_, neighbours_;  // [vertex + 1]; with repetitions
  std::vector<std::uint32_t> first_, vertices_;  // [vertex + 1]: its own and those of its rings, ascending
  std::vector<std::uint64_t> signatures_;        // [vertex]: the bits of these
  std::vector<std::uint32_t> visited_;           // for temporary use
};

}  // namespace kbvh
