#pragma once
#include <cstdint>
#include <string>

#include "experiments/study/impact_queries.hpp"

namespace kbvh::experiments {

/// Pairs of features whose boxes meet, where a box encloses the motion between two frames: the input of a
/// narrow phase of continuous collision detection. Features that share a vertex are no pair.
struct BoxCandidates {
  std::uint64_t vertex_face = 0, edge_edge = 0;
  std::uint64_t touching = 0;  ///< listed pairs of the frame pair that are known to touch
  std::uint64_t missed = 0;    ///< of these, pairs that are not among the candidates: 0
};

/// The space added to each side of the boxes.
enum class BoxMargin : std::uint8_t {
  none,     ///< closed boxes of the stored coordinates
  one_ulp,  ///< each vertex's box reaches to the next float, as in Scalable-CCD and the IPC toolkit
};

/// Finds the candidates between two frames by a strategy's swept pairs (`Strategy::swept_pairs`), with
/// vertices, edges and faces as primitives, in double. Throws ConfigError for an unknown strategy and
/// io::InputError for one that finds no contacts.
BoxCandidates box_candidates(const FramePair& frames, BoxMargin margin,
                             const std::string& strategy = "bottom_up");

/// Counts that others published for a frame pair of the same name; 0 if none are known.
struct PublishedCandidates {
  std::uint64_t vertex_face = 0, edge_edge = 0;
};
PublishedCandidates published_candidates(const std::string& name);

}  // namespace kbvh::experiments
