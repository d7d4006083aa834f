#include "core/families/wide/swept_hierarchies.hpp"

#include <algorithm>

namespace kbvh {

template <class S>
void SweptHierarchies<S>::assign(std::uint32_t body, const WideHierarchy<S>& hierarchy) {
  const Primitives& primitives = scene_.primitives(body);
  const std::uint32_t vertices = scene_.vertex_count(body);
  Primitives twice;
  twice.kind = primitives.kind;
  std::vector<std::uint32_t> corners;
  for (std::uint32_t p = 0; p < primitives.count(); ++p) {
    corners.assign(primitives[p].begin(), primitives[p].end());
    for (const std::uint32_t v : primitives[p]) corners.push_back(v + vertices);
    twice.add(corners);
  }
  twice.removed = primitives.removed;
  twice.removed_count = primitives.removed_count;
  std::vector<std::uint32_t> nodes;
  hierarchies_[body].assign(hierarchy.built_topology(nodes), twice, hierarchy.kernels());
  positions_[body].resize(std::size_t(6) * vertices + 1);
}

template <class S>
void SweptHierarchies<S>::refit(std::span<const S* const> before, const SampledMotion<S>& motion) {
  for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) {
    const std::size_t size = std::size_t(3) * scene_.vertex_count(body);
    std::copy_n(before[body], size, positions_[body].data());
    std::copy_n(motion.positions(body), size, positions_[body].data() + size);
    hierarchies_[body].positions_changed();
    hierarchies_[body].refit(positions_[body].data());
  }
}

template <class S>
void SweptHierarchies<S>::pairs(WideQuery<S>& query, PairBuffer& out, std::uint64_t& tests) {
  const auto box_of = [&](std::uint32_t body) {
    return hierarchies_[body].empty() ? Box<double>{} : to_double(hierarchies_[body].box(0));
  };
  for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
    const BodyPair& pair = scene_.pairs()[i];
    query.run(side(pair.first), side(pair.second), out, tests);
  }
}

template <class S>
std::size_t SweptHierarchies<S>::bytes() const {
  std::size_t total = near_bodies_.bytes();
  for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
  for (const auto& positions : positions_) total += positions.size() * sizeof(S);
  return total;
}

template class SweptHierarchies<float>;
template class SweptHierarchies<double>;

}  // namespace kbvh
