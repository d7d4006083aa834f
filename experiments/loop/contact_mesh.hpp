#pragma once
#include <cstdint>
#include <vector>

#include "core/base/hasher.hpp"
#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/pair_filter.hpp"
#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// What a broad phase has to know about a mesh: which of its elements may touch.
struct ContactMesh {
  std::uint32_t vertices = 0;
  EdgeList edges;
  FaceList faces;
  std::vector<std::uint8_t>
      obstacle;                      ///< [vertex]; elements of such vertices alone are no pairs of each other
  std::vector<std::uint32_t> inner;  ///< vertices that touch nothing

  ContactMesh() = default;
  explicit ContactMesh(const SimulatedMesh& mesh)
      : vertices(mesh.vertex_count()),
        edges(mesh.edges),
        faces(mesh.faces),
        obstacle(mesh.obstacle),
        inner(mesh.inner) {}

  /// Returns the groups of vertices by which elements of obstacles pair with others only.
  std::vector<GroupMask> vertex_groups() const {
    constexpr GroupMask of_moving{1, ~std::uint32_t(0)}, of_obstacle{2, ~std::uint32_t(2)};
    std::vector<GroupMask> groups;
    groups.reserve(obstacle.size());
    for (const std::uint8_t one : obstacle) groups.push_back(one != 0 ? of_obstacle : of_moving);
    return groups;
  }
};

/// Returns whether the seeded fault of tests takes a pair: one of `every`, by its ids.
inline bool is_lost(CandidateKind kind, const Candidate& pair, std::uint32_t every) {
  Hasher hash;
  hash.mix(std::uint64_t(pair.first) << 32 | pair.second);
  hash.mix(std::uint64_t(kind));
  return (hash.value() >> 32) % every == 0;
}

}  // namespace kbvh::experiments::loop
