#pragma once
#include <cstdint>
#include <span>

#include "core/broad_phase/elements.hpp"
#include "core/continuous/impact.hpp"

namespace kbvh {

/// The first contact, or the first time within a separation, during a motion from t = 0 to t = 1. If there is
/// one, its time lies in [begin, end], and no two elements touch, or are within the separation, before
/// `begin`.
struct EarliestImpact {
  bool touches = false;
  CandidateKind kind = CandidateKind::face_vertex;  ///< or edge_edge
  /// The pair whose first contact is enclosed by the smallest `end` (then by kind and ids); another pair may
  /// touch earlier by less than `impact_width`.
  Candidate pair{};
  double begin = 1, end = 1;
};

/// Counts what a search for the earliest impact did with its candidates.
struct EarliestImpactStats {
  std::uint64_t candidates = 0;
  std::uint64_t later = 0;  ///< apart until an impact that was found before
  ImpactStats impacts{};    ///< of all others
};

/// Takes the earlier of `earliest` and the first times at which candidates, face_vertex or edge_edge, are
/// within the separation: exact verdicts by find_impact for a separation of 0, else by find_approach. Points
/// are [vertex][4], at t = 0 and t = 1. The result does not depend on the order of candidates.
template <class S>
void take_earlier_impacts(CandidateKind kind, const Elements& elements, const S* begin, const S* end,
                          std::span<const Candidate> candidates, double separation, EarliestImpact& earliest,
                          EarliestImpactStats* stats = nullptr);

extern template void take_earlier_impacts(CandidateKind, const Elements&, const float*, const float*,
                                          std::span<const Candidate>, double, EarliestImpact&,
                                          EarliestImpactStats*);
extern template void take_earlier_impacts(CandidateKind, const Elements&, const double*, const double*,
                                          std::span<const Candidate>, double, EarliestImpact&,
                                          EarliestImpactStats*);

}  // namespace kbvh
