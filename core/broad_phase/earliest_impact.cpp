#include "core/broad_phase/earliest_impact.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "core/base/assert.hpp"
#include "core/broad_phase/approach.hpp"
#include "core/continuous/impact_batch.hpp"

namespace kbvh {
namespace {

/// Candidates that are tested together, and the earliest impact among them and those before.
class ImpactSearch {
 public:
  ImpactSearch(CandidateKind kind, double separation, EarliestImpact& earliest, EarliestImpactStats& counts)
      : kind_(kind),
        separation_(separation),
        earliest_(&earliest),
        counts_(&counts),
        batch_(kind == CandidateKind::edge_edge ? Contact::Kind::edge_edge : Contact::Kind::vertex_face) {}

  /// Adds a candidate and its points at t = 0 and t = 1, in the order of MovingPoints.
  template <class S>
  void add(const Candidate& candidate, const S* const (&begin)[4], const S* const (&end)[4]) {
    candidates_[batch_.size()] = candidate;
    batch_.add(begin, end);
    if (batch_.full()) test();
  }

  /// Tests all that were added.
  void test() {
    if (separation_ > 0)
      test_approaches();
    else
      test_impacts();
    batch_.clear();
  }

 private:
  void test_impacts() {
    const ImpactBatch::Mask sooner = leave_out_later(batch_.all());
    batch_.decide(sooner, &counts_->impacts);
    for (ImpactBatch::Mask rest = sooner; rest != 0; rest &= rest - 1) {
      const auto i = std::size_t(std::countr_zero(rest));
      take(candidates_[i], batch_.impact(i));
    }
  }

  void test_approaches() {
    ImpactBatch::Mask rest = leave_out_later(batch_.all());
    for (double until = earliest_->end; rest != 0; rest &= rest - 1) {
      if (earliest_->end < until) {
        until = earliest_->end;
        rest = leave_out_later(rest);
        if (rest == 0) return;
      }
      const auto i = std::size_t(std::countr_zero(rest));
      const ImpactBatch::Query query = batch_.query(i);
      take(candidates_[i], find_approach(batch_.kind(), query.points(), separation_, &counts_->impacts));
    }
  }

  /// Returns those of the given candidates that may come within the separation before the earliest impact
  /// so far.
  ImpactBatch::Mask leave_out_later(ImpactBatch::Mask which) {
    const ImpactBatch::Mask later = which & batch_.apart_until(earliest_->end, separation_);
    counts_->later += std::uint64_t(std::popcount(later));
    return which & ~later;
  }

  void take(const Candidate& candidate, const Impact& impact) {
    if (!impact.touches) return;
    const auto key = [](double time, CandidateKind of, const Candidate& pair) {
      return std::tuple(time, of, pair.first, pair.second);
    };
    if (earliest_->touches &&
        key(earliest_->end, earliest_->kind, earliest_->pair) < key(impact.end, kind_, candidate))
      return;
    // The interval of every other first contact ends no earlier than this one's, so no contact comes before
    // this beginning.
    *earliest_ = {true, kind_, candidate, std::max(0.0, impact.end - impact_width), impact.end};
  }

  CandidateKind kind_;
  double separation_;
  EarliestImpact* earliest_;
  EarliestImpactStats* counts_;
  ImpactBatch batch_;
  Candidate candidates_[ImpactBatch::room];
};

}  // namespace

template <class S>
void take_earlier_impacts(CandidateKind kind, const Elements& elements, const S* begin, const S* end,
                          std::span<const Candidate> candidates, double separation, EarliestImpact& earliest,
                          EarliestImpactStats* stats, const PatchMembers* patches) {
  KBVH_ASSERT(kind == CandidateKind::face_vertex || kind == CandidateKind::edge_edge);
  KBVH_ASSERT(patches == nullptr || separation == 0);
  const bool edges = kind == CandidateKind::edge_edge;
  EarliestImpactStats counts;
  ImpactSearch search(kind, separation, earliest, counts);
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
    const auto at = [&](const S* points, int i) { return points + std::size_t(4) * vertices[i]; };
    search.add(candidate, {at(begin, 0), at(begin, 1), at(begin, 2), at(begin, 3)},
               {at(end, 0), at(end, 1), at(end, 2), at(end, 3)});
  }
  search.test();
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
