#include "experiments/io/weld.hpp"

#include <limits>
#include <unordered_map>

#include "core/base/library_gaps.hpp"

namespace kbvh::io {
namespace {

std::uint64_t mixed(std::uint64_t hash, const double* p) {
  for (int axis = 0; axis < 3; ++axis) {
    hash = (hash ^ bit_cast<std::uint64_t>(p[axis] + 0.0)) * 0x9E3779B97F4A7C15u;  // + 0.0: merges both zeros
    hash ^= hash >> 29;
  }
  return hash;
}

bool equal(const double* a, const double* b) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

}  // namespace

void weld(AnimatedMesh& mesh, const std::vector<double>& rest) {
  const std::size_t n = mesh.vertex_count, keyframes = mesh.keyframe_times.size();
  const auto at = [&](std::size_t k, std::size_t v) { return &mesh.positions[3 * (k * n + v)]; };
  std::vector<std::uint64_t> hash(n, 1);
  for (std::size_t v = 0; v < n; ++v) hash[v] = mixed(hash[v], &rest[3 * v]);
  for (std::size_t k = 0; k < keyframes; ++k) {
    for (std::size_t v = 0; v < n; ++v) hash[v] = mixed(hash[v], at(k, v));
  }
  std::vector<bool> used(n, false);
  for (std::uint32_t v : mesh.primitive_vertices) used[v] = true;

  const auto same = [&](std::size_t a, std::size_t b) {
    if (!equal(&rest[3 * a], &rest[3 * b])) return false;
    for (std::size_t k = 0; k < keyframes; ++k) {
      if (!equal(at(k, a), at(k, b))) return false;
    }
    return true;
  };
  std::unordered_multimap<std::uint64_t, std::uint32_t> kept_by_hash;
  std::vector<std::uint32_t> kept, new_id(n, 0);
  for (std::uint32_t v = 0; v < n; ++v) {
    if (!used[v]) continue;
    const auto [begin, end] = kept_by_hash.equal_range(hash[v]);
    auto it = begin;
    while (it != end && !same(kept[it->second], v)) ++it;
    if (it != end) {
      new_id[v] = it->second;
      continue;
    }
    new_id[v] = static_cast<std::uint32_t>(kept.size());
    kept_by_hash.emplace(hash[v], new_id[v]);
    kept.push_back(v);
  }
  for (std::uint32_t& v : mesh.primitive_vertices) v = new_id[v];
  // Every vertex moves to the front or stays, so this works in place.
  for (std::size_t k = 0, out = 0; k < keyframes; ++k) {
    for (std::uint32_t v : kept) {
      for (std::size_t axis = 0; axis < 3; ++axis) mesh.positions[out++] = at(k, v)[axis];
    }
  }
  mesh.vertex_count = static_cast<std::uint32_t>(kept.size());
  mesh.positions.resize(3 * kept.size() * keyframes);
}

}  // namespace kbvh::io
