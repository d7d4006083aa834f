// The members of BroadPhase that find self intersections and impacts.
#include "core/broad_phase/self_intersections.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/broad_phase/broad_phase.hpp"
#include "core/broad_phase/checked_input.hpp"

namespace kbvh {

template <class S>
std::size_t FaceTests<S>::keep(const std::uint32_t* corners, const S* points, Candidate* pairs,
                               std::size_t count, KernelSet kernels) {
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
    triangles_intersect<S>({triangles_.data(), here}, touch_.data(), stats_, kernels);
    for (std::size_t i = 0; i < here; ++i) {
      pairs[kept] = pairs[begin + i];
      kept += touch_[i];
    }
  }
  return kept;
}

template <class S>
void FaceTests<S>::take_stats(TriangleTestStats& stats) {
  stats.tests += stats_.tests;
  stats.filtered += stats_.filtered;
  stats.exact += stats_.exact;
  stats_ = {};
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
  const std::uint32_t* const corners = elements_->of(Element::face).vertices.data();
  const bool filtered = filter_.looks_at(kind);
  const auto sift = [&](Candidate* pairs, std::size_t count, std::uint32_t runner) {
    if (filtered) count = filter_.keep(*elements_, kind, {pairs, count});
    return face_tests_[runner].keep(corners, present_points(), pairs, count, kernels_);
  };
  counts.box_tests += run_search(job, out, sift);
  for (FaceTests<S>& tests : face_tests_) tests.take_stats(counts.triangles);
  last_box_tests_ = counts.box_tests;
  if (stats == nullptr) return;
  stats->patches += counts.patches;
  stats->certified += counts.certified;
  stats->box_tests += counts.box_tests;
  stats->triangles.tests += counts.triangles.tests;
  stats->triangles.filtered += counts.triangles.filtered;
  stats->triangles.exact += counts.triangles.exact;
}

template <class S>
const PatchMembers& BroadPhase<S>::certified_patches() {
  ElementTree<S>& tree = current_tree(Element::face);
  if (tree.empty()) {
    patch_members_.mark(*elements_, ElementLeaves<S>{}, 0, {});
    return patch_members_;
  }
  const ElementLeaves<S> faces = tree.leaves();
  patches_.run(faces, tree.padded_leaf_size(), tree.contours(elements_->vertex_count()), points_.data(),
               end_points_.data());
  patch_members_.mark(*elements_, faces, tree.padded_leaf_size(), patches_.certified());
  return patch_members_;
}

template <class S>
EarliestImpact BroadPhase<S>::earliest_impact(double separation, EarliestImpactStats* stats,
                                              SelfCulling culling) {
  elements();
  if (motion_ != Motion::straight)
    throw std::logic_error("an impact is asked for without a motion from V0 to V1");
  if (!(separation >= 0 && separation <= double(radius_)))
    throw std::invalid_argument("earliest_impact() takes a separation from 0 to the radius " +
                                number_text(double(radius_)) + ", not " + number_text(separation));
  constexpr CandidateKind kinds[] = {CandidateKind::face_vertex, CandidateKind::edge_edge};
  std::size_t candidates = 0;
  for (const CandidateKind kind : kinds) candidates += kept(kind).size();
  // Few candidates are tested in less time than all faces.
  const bool cull =
      culling == SelfCulling::cones && separation == 0 && candidates > elements_->count(Element::face);
  const PatchMembers* const patches = cull ? &certified_patches() : nullptr;
  EarliestImpact earliest;
  for (const CandidateKind kind : kinds)
    take_earlier_impacts<S>(kind, *elements_, points_.data(), end_points_.data(), span_of(kept(kind)),
                            separation, earliest, stats, patches);
  return earliest;
}

template class FaceTests<float>;
template class FaceTests<double>;
template void BroadPhase<float>::self_intersections(CandidateBuffer&, SelfCulling, SelfIntersectionStats*);
template void BroadPhase<double>::self_intersections(CandidateBuffer&, SelfCulling, SelfIntersectionStats*);
template const PatchMembers& BroadPhase<float>::certified_patches();
template const PatchMembers& BroadPhase<double>::certified_patches();
template EarliestImpact BroadPhase<float>::earliest_impact(double, EarliestImpactStats*, SelfCulling);
template EarliestImpact BroadPhase<double>::earliest_impact(double, EarliestImpactStats*, SelfCulling);

}  // namespace kbvh
