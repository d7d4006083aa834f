// The members of BroadPhase that find self intersections.
#include "core/broad_phase/self_intersections.hpp"

#include <algorithm>

#include "core/broad_phase/broad_phase.hpp"

namespace kbvh {

template <class S>
std::size_t FaceTests<S>::keep(const std::uint32_t* corners, const S* points, Candidate* pairs,
                               std::size_t count, KernelSet kernels, TriangleTestStats& stats) {
  constexpr std::size_t at_once = 1024;
  triangles_.resize(at_once);
  touch_.resize(at_once);
  std::size_t kept = 0;
  for (std::size_t begin = 0; begin < count; begin += at_once) {
    const std::size_t here = std::min(at_once, count - begin);
    for (std::size_t i = 0; i < here; ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        const Candidate& pair = pairs[begin + i];
        triangles_[i].corner[c] = points + std::size_t(4) * corners[std::size_t(3) * pair.first + c];
        triangles_[i].corner[3 + c] = points + std::size_t(4) * corners[std::size_t(3) * pair.second + c];
      }
    triangles_intersect<S>({triangles_.data(), here}, touch_.data(), stats, kernels);
    for (std::size_t i = 0; i < here; ++i) {
      pairs[kept] = pairs[begin + i];
      kept += touch_[i];
    }
  }
  return kept;
}

template <class S>
void BroadPhase<S>::self_intersections(CandidateBuffer& out, SelfCulling culling,
                                       SelfIntersectionStats* stats) {
  elements();
  constexpr CandidateKind kind = CandidateKind::face_face;
  ++detections_;
  out.clear();
  last_box_tests_ = 0;
  ElementSearchJob<S> job = search_job(kind);
  if (job.starts.empty()) return;
  SelfIntersectionStats counts;
  counts.box_tests = 1;
  if (culling == SelfCulling::cones) {
    const FaceContours& contours = trees_[std::size_t(Element::face)].contours(elements_->vertex_count());
    patches_.run(job.a, job.padded, contours, present_points(), nullptr);
    job.starts = patches_.starts();
    job.leaf_pairs = patches_.leaf_pairs();
    counts.patches = patches_.patches();
    counts.certified = patches_.certified().size();
    counts.box_tests += patches_.box_tests();
  }
  job.usual = 4096;  // sifted at once
  const std::uint32_t* const corners = elements_->of(Element::face).vertices.data();
  const bool filtered = filter_.looks_at(kind);
  counts.box_tests += search_.run(job, out, [&](Candidate* pairs, std::size_t count) {
    if (filtered) count = filter_.keep(*elements_, kind, {pairs, count});
    return face_tests_.keep(corners, present_points(), pairs, count, kernels_, counts.triangles);
  });
  last_box_tests_ = counts.box_tests;
  if (stats == nullptr) return;
  stats->patches += counts.patches;
  stats->certified += counts.certified;
  stats->box_tests += counts.box_tests;
  stats->triangles.tests += counts.triangles.tests;
  stats->triangles.filtered += counts.triangles.filtered;
  stats->triangles.exact += counts.triangles.exact;
}

template class FaceTests<float>;
template class FaceTests<double>;
template void BroadPhase<float>::self_intersections(CandidateBuffer&, SelfCulling, SelfIntersectionStats*);
template void BroadPhase<double>::self_intersections(CandidateBuffer&, SelfCulling, SelfIntersectionStats*);

}  // namespace kbvh
