#include "core/broad_phase/patch_members.hpp"

#include <algorithm>

namespace kbvh {
namespace {

std::uint64_t key_of(std::uint32_t a, std::uint32_t b) {
  return std::uint64_t(std::min(a, b)) << 32 | std::max(a, b);
}

}  // namespace

void PatchMembers::list_sides(const Elements& elements) {
  if (sides_listed_) return;
  const Primitives &faces = elements.of(Element::face), &edges = elements.of(Element::edge);
  sides_.clear();
  for (std::uint32_t f = 0; f < faces.count(); ++f)
    for (std::size_t c = 0; c < 3; ++c)
      if (faces.alive(f)) sides_.push_back({key_of(faces[f][c], faces[f][(c + 1) % 3]), f});
  std::sort(sides_.begin(), sides_.end(),
            [](const Side& a, const Side& b) { return a.key != b.key ? a.key < b.key : a.face < b.face; });
  faces_at_.assign(edges.count(), {none, none});
  for (std::uint32_t e = 0; e < edges.count(); ++e) {
    const std::uint64_t key = key_of(edges[e][0], edges[e][1]);
    auto side = std::lower_bound(sides_.begin(), sides_.end(), key,
                                 [](const Side& one, std::uint64_t other) { return one.key < other; });
    for (; side != sides_.end() && side->key == key; ++side) add(faces_at_[e], side->face);
  }
  sides_listed_ = true;
}

template <class S>
void PatchMembers::mark(const Elements& elements, const ElementLeaves<S>& faces, std::uint32_t padded,
                        std::span<const std::uint32_t> certified) {
  list_sides(elements);
  faces_.assign(elements.count(Element::face), none);
  vertices_.assign(elements.vertex_count(), {none, none});
  for (std::uint32_t patch = 0; patch < certified.size(); ++patch) {
    nodes_.assign(1, certified[patch]);
    while (!nodes_.empty()) {
      const WideNode& at = faces.tree.nodes[nodes_.back()];
      nodes_.pop_back();
      for (std::uint32_t c = 0; c < std::uint32_t(at.count - at.leaf_count); ++c)
        nodes_.push_back(at.first_child + c);
      for (std::uint32_t leaf = at.first_leaf; leaf < at.first_leaf + at.leaf_count; ++leaf) {
        const std::uint32_t* const corners = faces.corners + std::size_t(3) * leaf * padded;
        const std::uint32_t begin = faces.first_entry[leaf], count = faces.end_entry[leaf] - begin;
        for (std::uint32_t lane = 0; lane < count; ++lane) {
          faces_[faces.ids[begin + lane]] = patch;
          for (std::uint32_t c = 0; c < 3; ++c) add(vertices_[corners[c * padded + lane]], patch);
        }
      }
    }
  }
  edges_.assign(faces_at_.size(), {none, none});
  for (std::size_t e = 0; e < edges_.size(); ++e)
    for (const std::uint32_t face : faces_at_[e])
      if (face != none && faces_[face] != none) add(edges_[e], faces_[face]);
}

std::size_t PatchMembers::bytes() const {
  return (faces_.capacity() + nodes_.capacity()) * sizeof(std::uint32_t) +
         (vertices_.capacity() + edges_.capacity() + faces_at_.capacity()) * sizeof(Two) +
         sides_.capacity() * sizeof(Side);
}

template void PatchMembers::mark(const Elements&, const ElementLeaves<float>&, std::uint32_t,
                                 std::span<const std::uint32_t>);
template void PatchMembers::mark(const Elements&, const ElementLeaves<double>&, std::uint32_t,
                                 std::span<const std::uint32_t>);

}  // namespace kbvh
