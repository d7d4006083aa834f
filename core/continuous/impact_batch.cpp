#include "core/continuous/impact_batch.hpp"

#include <bit>

namespace kbvh {

ImpactBatch::ImpactBatch(Contact::Kind kind, KernelSet kernels, const ImpactErrors& errors)
    : kind_(kind), kernels_(&KBVH_SELECT_KERNELS(kernels, impact_kernels)), errors_(errors) {}

ImpactBatch::Query ImpactBatch::query(std::size_t i) const {
  Query result;
  for (std::size_t point = 0; point < 4; ++point)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result.begin[point][axis] = block_.points[0][point][axis][i];
      result.end[point][axis] = block_.points[1][point][axis][i];
    }
  return result;
}

ImpactBatch::Mask ImpactBatch::apart_until(double until, double separation) const {
  const auto apart =
      kind_ == Contact::Kind::vertex_face ? kernels_->apart_vertex_face : kernels_->apart_edge_edge;
  return apart(block_, all(), until, separation, errors_);
}

ImpactBatch::Mask ImpactBatch::filter(Mask which) {
  static_assert(impact_width == 0x1p-20);
  ImpactVerdicts verdicts;
  const auto decide_them =
      kind_ == Contact::Kind::vertex_face ? kernels_->decide_vertex_face : kernels_->decide_edge_edge;
  decide_them(block_, which, errors_, verdicts);
  for (Mask rest = verdicts.free; rest != 0; rest &= rest - 1)
    impacts_[std::size_t(std::countr_zero(rest))] = {};
  for (Mask rest = verdicts.touching; rest != 0; rest &= rest - 1) {
    const auto i = std::size_t(std::countr_zero(rest));
    impacts_[i] = {true, verdicts.begin[i], verdicts.begin[i] + impact_width};
  }
  return verdicts.free | verdicts.touching;
}

void ImpactBatch::decide(Mask which, ImpactStats* stats) {
  const Mask decided = filter(which);
  if (stats != nullptr) {
    const auto count = std::uint64_t(std::popcount(decided));
    stats->tests += count;
    stats->filtered += count;
  }
  for (Mask rest = which & ~decided; rest != 0; rest &= rest - 1) {
    const auto i = std::size_t(std::countr_zero(rest));
    impacts_[i] = find_impact(kind_, query(i).points(), stats);
  }
}

}  // namespace kbvh
