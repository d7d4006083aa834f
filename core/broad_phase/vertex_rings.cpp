#include "core/broad_phase/vertex_rings.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

namespace kbvh {
namespace {

/// Calls take(v, w) for the ends of each living edge and of each side of a living face.
template <class Take>
void for_each_connection(const Elements& elements, const Take& take) {
  for (const Element element : {Element::edge, Element::face}) {
    const Primitives& list = elements.of(element);
    const std::size_t corners = std::size_t(element) + 1, sides = element == Element::edge ? 1 : 3;
    for (std::uint32_t id = 0; id < list.count(); ++id) {
      if (!list.alive(id)) continue;
      const std::span<const std::uint32_t> vertices = list[id];
      for (std::size_t i = 0; i < sides; ++i) take(vertices[i], vertices[(i + 1) % corners]);
    }
  }
}

}  // namespace

void VertexRings::list_neighbours(const Elements& elements) {
  first_neighbour_.assign(std::size_t(elements.vertex_count()) + 2, 0);
  for_each_connection(elements, [this](std::uint32_t v, std::uint32_t w) {
    ++first_neighbour_[v + 2];
    ++first_neighbour_[w + 2];
  });
  // Entry v + 1 is the place of the next neighbour of v, and in the end one past its last.
  for (std::size_t i = 3; i < first_neighbour_.size(); ++i) first_neighbour_[i] += first_neighbour_[i - 1];
  neighbours_.resize(first_neighbour_.back());
  for_each_connection(elements, [this](std::uint32_t v, std::uint32_t w) {
    neighbours_[first_neighbour_[v + 1]++] = w;
    neighbours_[first_neighbour_[w + 1]++] = v;
  });
}

void VertexRings::build(const Elements& elements, std::uint32_t rings) {
  const std::uint32_t count = elements.vertex_count();
  constexpr std::uint32_t never = std::numeric_limits<std::uint32_t>::max();
  const std::uint64_t corners =
      elements.of(Element::edge).vertices.size() + 2 * elements.of(Element::face).vertices.size();
  if (corners >= never)
    throw std::length_error("edges and sides of faces name 2^32 neighbours of vertices or more");
  list_neighbours(elements);
  visited_.assign(count, never);
  first_.assign(1, 0);
  vertices_.clear();
  signatures_.resize(count);
  for (std::uint32_t v = 0; v < count; ++v) {
    const std::size_t begin = vertices_.size();
    vertices_.push_back(v);
    visited_[v] = v;
    std::size_t ring = begin;  // the last ring so far is [ring, end)
    for (std::uint32_t k = 0; k < rings && ring < vertices_.size(); ++k) {
      const std::size_t end = vertices_.size();
      for (; ring < end; ++ring) {
        const std::uint32_t from = vertices_[ring];
        for (std::uint32_t i = first_neighbour_[from]; i < first_neighbour_[from + 1]; ++i) {
          const std::uint32_t w = neighbours_[i];
          if (visited_[w] == v) continue;
          visited_[w] = v;
          vertices_.push_back(w);
        }
      }
    }
    if (vertices_.size() >= std::size_t(never))
      throw std::length_error(std::to_string(rings) + " rings of " + std::to_string(count) +
                              " vertices hold 2^32 vertices or more");
    std::sort(vertices_.begin() + std::ptrdiff_t(begin), vertices_.end());
    std::uint64_t signature = 0;
    for (std::size_t i = begin; i < vertices_.size(); ++i) signature |= bit(vertices_[i]);
    signatures_[v] = signature;
    first_.push_back(std::uint32_t(vertices_.size()));
  }
}

bool VertexRings::connect(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) const {
  std::uint64_t bits = 0;
  for (const std::uint32_t v : b) bits |= bit(v);
  for (const std::uint32_t v : a) {
    if ((signatures_[v] & bits) == 0) continue;
    const auto begin = vertices_.begin() + first_[v], end = vertices_.begin() + first_[v + 1];
    for (const std::uint32_t w : b)
      if (std::binary_search(begin, end, w)) return true;
  }
  return false;
}

std::size_t VertexRings::bytes() const {
  return (first_neighbour_.capacity() + neighbours_.capacity() + first_.capacity() + vertices_.capacity() +
          visited_.capacity()) *
             sizeof(std::uint32_t) +
         signatures_.capacity() * sizeof(std::uint64_t);
}

}  // namespace kbvh
