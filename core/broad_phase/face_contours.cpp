#include "core/broad_phase/face_contours.hpp"

#include <algorithm>

namespace kbvh {
namespace {

/// Both directions of a side are neighbours in the order of keys. Vertices are fewer than 2^30.
std::uint64_t key_of(std::uint32_t from, std::uint32_t to) {
  const std::uint64_t low = std::min(from, to), high = std::max(from, to);
  return low << 32 | high << 1 | (from < to ? 0 : 1);
}
FaceSide side_of(std::uint64_t key) {
  const auto low = std::uint32_t(key >> 32), high = std::uint32_t(key) >> 1;
  return (key & 1) == 0 ? FaceSide{low, high} : FaceSide{high, low};
}

}  // namespace

template <class S>
void FaceContours::build(const ElementLeaves<S>& faces, std::uint32_t nodes, std::uint32_t padded,
                         std::uint32_t vertices) {
  ranges_.resize(nodes);
  sides_.clear();
  side_from_.assign(vertices, 0);
  for (std::uint32_t n = nodes; n-- > 0;) {
    const WideNode& node = faces.tree.nodes[n];
    keys_.clear();
    bool tangled = false;
    for (std::uint32_t leaf = node.first_leaf; leaf < node.first_leaf + node.leaf_count; ++leaf) {
      const std::uint32_t* const corners = faces.corners + std::size_t(3) * leaf * padded;
      const std::uint32_t count = faces.end_entry[leaf] - faces.first_entry[leaf];
      for (std::uint32_t lane = 0; lane < count; ++lane)
        for (std::uint32_t c = 0; c < 3; ++c) {
          const std::uint32_t from = corners[c * padded + lane], to = corners[(c + 1) % 3 * padded + lane];
          if (from != to) keys_.push_back(key_of(from, to));
        }
    }
    for (std::uint32_t c = 0; c < std::uint32_t(node.count - node.leaf_count); ++c) {
      const Range& child = ranges_[node.first_child + c];
      tangled |= child.tangled;
      for (std::size_t i = child.begin; i < child.begin + child.count; ++i)
        keys_.push_back(key_of(sides_[i].from, sides_[i].to));
    }
    ranges_[n] = {sides_.size(), 0, false, tangled};
    if (!tangled) keep_contour(n);
  }
}

void FaceContours::keep_contour(std::uint32_t node) {
  Range& range = ranges_[node];
  std::sort(keys_.begin(), keys_.end());
  left_.clear();
  for (std::size_t i = 0, end = 0; i < keys_.size(); i = end) {
    int sum = 0;
    for (end = i; end < keys_.size() && keys_[end] >> 1 == keys_[i] >> 1; ++end)
      sum += (keys_[end] & 1) == 0 ? 1 : -1;
    if (sum < -1 || sum > 1) {
      range.tangled = true;
      return;
    }
    if (sum != 0) left_.push_back(side_of((keys_[i] & ~std::uint64_t(1)) | (sum < 0 ? 1 : 0)));
  }
  range.count = std::uint32_t(left_.size());
  range.simple = true;
  for (std::size_t i = 0; i < left_.size(); ++i) {
    std::uint32_t& first = side_from_[left_[i].from];
    if (first != 0) range.simple = false;
    first = std::uint32_t(i + 1);
  }
  if (!range.simple) {
    sides_.insert(sides_.end(), left_.begin(), left_.end());
    for (const FaceSide& side : left_) side_from_[side.from] = 0;
    return;
  }
  // As many sides end at a vertex as begin there, so every path from a side leads back to it.
  for (const FaceSide& start : left_)
    for (std::uint32_t from = start.from; side_from_[from] != 0;) {
      const FaceSide& side = left_[side_from_[from] - 1];
      sides_.push_back(side);
      side_from_[from] = 0;
      from = side.to;
    }
}

std::size_t FaceContours::bytes() const {
  return ranges_.capacity() * sizeof(Range) + (sides_.capacity() + left_.capacity()) * sizeof(FaceSide) +
         keys_.capacity() * sizeof(std::uint64_t) + side_from_.capacity() * sizeof(std::uint32_t);
}

template void FaceContours::build(const ElementLeaves<float>&, std::uint32_t, std::uint32_t, std::uint32_t);
template void FaceContours::build(const ElementLeaves<double>&, std::uint32_t, std::uint32_t, std::uint32_t);

}  // namespace kbvh
