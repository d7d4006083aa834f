#pragma once
#include <cstdint>
#include <span>

#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/patch_members.hpp"
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

/// Counts what a search for the earliest impact did with its candidates. candidates = culled + later + tests.
struct EarliestImpactStats {
  std::uint64_t candidates = 0;
  std::uint64_t culled = 0;  ///< of one patch, which does not touch itself during the motion
  std::uint64_t later = 0;   ///< proved to be apart until an impact that was found before, or until t = 1
  ImpactStats impacts{};     ///< of all others
};

/// Takes the earlier of `earliest` and the first times at which candidates, face_vertex or edge_edge, are
/// within the separation: exact verdicts of find_impact for a separation of 0, else of find_approach.
/// Candidates are filtered in batches (core/continuous/impact_batch.hpp). Points are [vertex][4], at t = 0
/// and t = 1. The result does not depend on the order of candidates. Candidates within one of the `patches`
/// are skipped; these must be certified for the motion, and the separation 0.
template <class S>
void take_earlier_impacts(CandidateKind kind, const Elements& elements, const S* begin, const S* end,
                          std::span<const Candidate> candidates, double separation, EarliestImpact& earliest,
                          EarliestImpactStats* stats = nullptr, const PatchMembers* patches = nullptr);

extern template void take_earlier_impacts(CandidateKind, const Elements&, const float*, const float*,
                                          std::span<const Candidate>, double, EarliestImpact&,
                                          EarliestImpactStats*, const PatchMembers*);
extern template void take_earlier_impacts(CandidateKind, const Elements&, const double*, const double*,
                                          std::span<const Candidate>, double, EarliestImpact&,
                                          EarliestImpactStats*, const PatchMembers*);

}  // namespace kbvh
