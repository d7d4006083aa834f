#include "experiments/io/weld.hpp"

#include <numeric>
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

std::vector<bool> used_vertices(const AnimatedMesh& mesh) {
  std::vector<bool> used(mesh.vertex_count, false);
  for (const std::uint32_t v : mesh.primitive_vertices) used[v] = true;
  return used;
}

/// Returns for each vertex the first used vertex with the same positions; unused vertices are their own.
std::vector<std::uint32_t> originals(const AnimatedMesh& mesh, const std::vector<double>& rest) {
  const std::size_t n = mesh.vertex_count, keyframes = mesh.keyframe_times.size();
  const auto at = [&](std::size_t k, std::size_t v) { return &mesh.positions[3 * (k * n + v)]; };
  std::vector<std::uint64_t> hash(n, 1);
  if (!rest.empty())
    for (std::size_t v = 0; v < n; ++v) hash[v] = mixed(hash[v], &rest[3 * v]);
  for (std::size_t k = 0; k < keyframes; ++k) {
    for (std::size_t v = 0; v < n; ++v) hash[v] = mixed(hash[v], at(k, v));
  }
  const auto same = [&](std::size_t a, std::size_t b) {
    if (!rest.empty() && !equal(&rest[3 * a], &rest[3 * b])) return false;
    for (std::size_t k = 0; k < keyframes; ++k) {
      if (!equal(at(k, a), at(k, b))) return false;
    }
    return true;
  };
  const std::vector<bool> used = used_vertices(mesh);
  std::unordered_multimap<std::uint64_t, std::uint32_t> kept;  // by hash
  std::vector<std::uint32_t> original(n);
  std::iota(original.begin(), original.end(), 0u);
  for (std::uint32_t v = 0; v < n; ++v) {
    if (!used[v]) continue;
    const auto [begin, end] = kept.equal_range(hash[v]);
    auto it = begin;
    while (it != end && !same(it->second, v)) ++it;
    if (it != end)
      original[v] = it->second;
    else
      kept.emplace(hash[v], v);
  }
  return original;
}

std::size_t count_copies(const std::vector<std::uint32_t>& original) {
  std::size_t copies = 0;
  for (std::uint32_t v = 0; v < original.size(); ++v) copies += original[v] != v ? 1 : 0;
  return copies;
}

}  // namespace

std::size_t weld(AnimatedMesh& mesh, const std::vector<double>& rest) {
  const std::vector<std::uint32_t> original = originals(mesh, rest);
  for (std::uint32_t& v : mesh.primitive_vertices) v = original[v];
  return count_copies(original);
}

std::size_t copies_at_seams(const AnimatedMesh& mesh, const std::vector<double>& rest) {
  return count_copies(originals(mesh, rest));
}

void drop_unused_vertices(AnimatedMesh& mesh) {
  const std::vector<bool> used = used_vertices(mesh);
  const std::size_t n = mesh.vertex_count;
  std::vector<std::uint32_t> kept, new_id(n, 0);
  for (std::uint32_t v = 0; v < n; ++v) {
    if (!used[v]) continue;
    new_id[v] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(v);
  }
  for (std::uint32_t& v : mesh.primitive_vertices) v = new_id[v];
  // Every vertex moves to the front or stays, so this works in place.
  std::size_t out = 0;
  for (std::size_t k = 0; k < mesh.keyframe_times.size(); ++k) {
    for (const std::uint32_t v : kept) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        mesh.positions[out++] = mesh.positions[3 * (k * n + v) + axis];
    }
  }
  mesh.vertex_count = static_cast<std::uint32_t>(kept.size());
  mesh.positions.resize(out);
}

}  // namespace kbvh::io
