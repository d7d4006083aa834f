#include "core/broad_phase/earliest_impact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/base/assert.hpp"
#include "core/broad_phase/approach.hpp"

namespace kbvh {
namespace {

/// Four points in motion as find_impact takes them, in double.
struct Motion {
  double begin[4][3], end[4][3];
  MovingPoints points() const {
    return {{begin[0], begin[1], begin[2], begin[3]}, {end[0], end[1], end[2], end[3]}};
  }

  /// Returns whether the points [0, split) and the others are certainly in two boxes that are farther apart
  /// than the separation from t = 0 to t.
  bool apart_until(double t, int split, double separation) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      double low[2] = {infinity, infinity}, high[2] = {-infinity, -infinity}, largest = 0;
      for (int i = 0; i < 4; ++i) {
        const double from = begin[i][axis], to = end[i][axis], there = (1 - t) * from + t * to;
        const int side = i < split ? 0 : 1;
        low[side] = std::min({low[side], from, there});
        high[side] = std::max({high[side], from, there});
        largest = std::max({largest, std::fabs(from), std::fabs(to)});
      }
      // Each place at t is wrong by less than 4 half ulps of the largest number, and by underflow.
      const double margin = (separation + largest * 0x1p-49) * (1 + 0x1p-50) + 0x1p-1000;
      if (low[0] - high[1] > margin || low[1] - high[0] > margin) return true;
    }
    return false;
  }
};

}  // namespace

template <class S>
void take_earlier_impacts(CandidateKind kind, const Elements& elements, const S* begin, const S* end,
                          std::span<const Candidate> candidates, double separation, EarliestImpact& earliest,
                          EarliestImpactStats* stats, const PatchMembers* patches) {
  KBVH_ASSERT(kind == CandidateKind::face_vertex || kind == CandidateKind::edge_edge);
  KBVH_ASSERT(patches == nullptr || separation == 0);
  const bool edges = kind == CandidateKind::edge_edge;
  const Contact::Kind contact = edges ? Contact::Kind::edge_edge : Contact::Kind::vertex_face;
  EarliestImpactStats counts;
  Motion motion;
  for (const Candidate& candidate : candidates) {
    ++counts.candidates;
    if (patches != nullptr && patches->together(kind, candidate)) {
      ++counts.culled;
      continue;
    }
    std::uint32_t vertices[4];
    const auto first = elements.vertices(first_element(kind), candidate.first);
    const auto second = elements.vertices(second_element(kind), candidate.second);
    // Of a vertex and a face, find_impact takes the vertex first.
    std::copy(second.begin(), second.end(), edges ? vertices + 2 : vertices);
    std::copy(first.begin(), first.end(), edges ? vertices : vertices + 1);
    for (int i = 0; i < 4; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        motion.begin[i][axis] = double(begin[std::size_t(4) * vertices[i] + std::size_t(axis)]);
        motion.end[i][axis] = double(end[std::size_t(4) * vertices[i] + std::size_t(axis)]);
      }
    if (motion.apart_until(earliest.end, edges ? 2 : 1, separation)) {
      ++counts.later;
      continue;
    }
    const Impact impact = separation > 0
                              ? find_approach(contact, motion.points(), separation, &counts.impacts)
                              : find_impact(contact, motion.points(), &counts.impacts);
    if (!impact.touches) continue;
    const auto key = [](double time, CandidateKind of, const Candidate& pair) {
      return std::tuple(time, of, pair.first, pair.second);
    };
    if (earliest.touches &&
        key(earliest.end, earliest.kind, earliest.pair) < key(impact.end, kind, candidate))
      continue;
    // Every other first contact ends no earlier, so it begins no earlier than this.
    earliest = {true, kind, candidate, std::max(0.0, impact.end - impact_width), impact.end};
  }
  if (stats == nullptr) return;
  stats->candidates += counts.candidates;
  stats->culled += counts.culled;
  stats->later += counts.later;
  stats->impacts.tests += counts.impacts.tests;
  stats->impacts.filtered += counts.impacts.filtered;
  stats->impacts.exact += counts.impacts.exact;
}

template void take_earlier_impacts(CandidateKind, const Elements&, const float*, const float*,
                                   std::span<const Candidate>, double, EarliestImpact&, EarliestImpactStats*,
                                   const PatchMembers*);
template void take_earlier_impacts(CandidateKind, const Elements&, const double*, const double*,
                                   std::span<const Candidate>, double, EarliestImpact&, EarliestImpactStats*,
                                   const PatchMembers*);

}  // namespace kbvh
