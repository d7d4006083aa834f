#pragma once
// Two frames of a mesh as the contestants of the bench of the broad phase take them.
#include <cstdint>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"
#include "experiments/study/impact_queries.hpp"

namespace kbvh::experiments::micro {

/// Returns a view of points, three numbers each.
template <class S>
MatrixView<S> points_of(const std::vector<S>& v) {
  return MatrixView<S>::by_rows(v.data(), v.size() / 3, 3);
}

/// Two frames of a mesh, as a caller of the broad phase has them.
template <class S>
struct Mesh {
  std::vector<S> v[2];
  MatrixView<std::uint32_t> e, f;
  explicit Mesh(const FramePair& frames)
      : e(MatrixView<std::uint32_t>::by_rows(frames.edges[0].data(), frames.edges.size(), 2)),
        f(MatrixView<std::uint32_t>::by_rows(frames.faces[0].data(), frames.faces.size(), 3)) {
    for (int i = 0; i < 2; ++i) v[i].assign(frames.positions[i].begin(), frames.positions[i].end());
  }
  MatrixView<S> view(int frame) const { return points_of(v[frame]); }
};

/// Detects face-vertex and edge-edge candidates; returns how many there are.
template <class S>
std::size_t detect_both(BroadPhase<S>& broad, CandidateBuffer (&out)[2]) {
  broad.detect_face_vertex_candidates(out[0]);
  broad.detect_edge_edge_candidates(out[1]);
  return out[0].size() + out[1].size();
}

}  // namespace kbvh::experiments::micro
