#include "core/families/events/leaf_vertex_lists.hpp"

#include <algorithm>
#include <utility>

#include "core/base/inverted_lists.hpp"

namespace kbvh {

LeafVertexLists::LeafVertexLists(const Topology& topology, const Primitives& primitives) {
  LeafVertices lists = unique_leaf_vertices(topology, primitives);
  vertices_ = ListPool(lists.offsets, std::move(lists.vertices));
}
LeafVertexLists::~LeafVertexLists() = default;
LeafVertexLists::LeafVertexLists(LeafVertexLists&&) noexcept = default;
LeafVertexLists& LeafVertexLists::operator=(LeafVertexLists&&) noexcept = default;

void LeafVertexLists::index(std::uint32_t vertex_count) {
  if (leaves_.keys() == 0) leaves_ = inverted(vertices_, vertex_count);
}

void LeafVertexLists::add_leaves_of(std::span<const std::uint32_t> vertices,
                                    std::vector<std::uint32_t>& leaves) const {
  for (std::uint32_t v : vertices) {
    if (v >= leaves_.keys()) continue;
    leaves.insert(leaves.end(), leaves_[v].begin(), leaves_[v].end());
  }
}

void LeafVertexLists::assign(std::uint32_t leaf, std::vector<std::uint32_t>& vertices,
                             std::uint32_t vertex_count) {
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  unlist(leaf);
  vertices_.assign(leaf, vertices);
  list(leaf, vertex_count);
}

void LeafVertexLists::follow(const TopologyEdit& edit, std::uint32_t nodes, std::uint32_t vertex_count) {
  std::vector<std::pair<std::uint32_t, std::vector<std::uint32_t>>> moved;
  for (const TopologyEdit::Move& move : edit.moved) {
    const auto vertices = vertices_[move.from];
    if (vertices.empty()) continue;
    moved.emplace_back(move.to, std::vector<std::uint32_t>(vertices.begin(), vertices.end()));
    unlist(move.from);
    vertices_.clear(move.from);
  }
  vertices_.resize(nodes);
  for (const auto& [to, vertices] : moved) {
    unlist(to);
    vertices_.assign(to, vertices);
    list(to, vertex_count);
  }
}

void LeafVertexLists::list(std::uint32_t leaf, std::uint32_t vertex_count) {
  if (leaves_.keys() == 0) return;
  leaves_.resize(vertex_count);
  for (std::uint32_t v : vertices_[leaf]) leaves_.push(v, leaf);
}

void LeafVertexLists::unlist(std::uint32_t leaf) {
  if (leaves_.keys() == 0) return;
  for (std::uint32_t v : vertices_[leaf]) leaves_.erase(v, leaf);
}

}  // namespace kbvh
