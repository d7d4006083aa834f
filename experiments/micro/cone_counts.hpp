#pragma once
// Three ways to the certificates of patches at the frames of a linear segment, counted: at each frame,
// by events at the failures of certificates, and by bisection of the segment.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "cone_failures.hpp"
#include "core/broad_phase/patch_culling.hpp"
#include "patch_tree.hpp"

namespace kbvh::experiments::micro {

/// Positions [vertex][4] at the frames 1 to l of a segment; frame l is its end.
using FramePositions = std::vector<std::vector<double>>;
inline FramePositions frame_positions(const ClothSegment& segment, int frames) {
  FramePositions positions;
  for (int k = 1; k <= frames; ++k) positions.push_back(segment.at(double(k) / frames));
  return positions;
}

inline void add_work(const PatchCertificate<double>::Work& work, ConeCounts& counts) {
  counts.signs += work.faces + work.sides;
  counts.determinants += work.determinants;
}

/// Certifies again at each frame, as BroadPhase::self_intersections does: from the root down, each patch up
/// to its first wrong sign.
inline void count_each_frame(const PatchTree& patches, const FramePositions& positions, ConeCounts& counts) {
  PatchCulling<double> culling;
  for (const std::vector<double>& points : positions) {
    culling.run(patches.leaves(), patches.padded(), patches.contours(), points.data(), nullptr);
    counts.patches += culling.patches();
    counts.certified_patches += culling.certified().size();
    for (const std::uint32_t node : culling.certified()) counts.certified_faces += patches.faces_below(node);
  }
  add_work(culling.work(), counts);
}

/// A patch that was certified from a frame to another, the last one included.
struct CertifiedFrames {
  std::uint32_t node;
  int first, last;
};

/// Certifies for motions: a patch that does not hold for the motion from a frame to another, but in the
/// middle of them, is asked for both halves; one that does not hold there leaves all these frames to its
/// children. Needs no roots.
class BisectedCones {
 public:
  BisectedCones(const PatchTree& patches, const FramePositions& positions)
      : patches_(patches), positions_(positions) {
    certify(0, 0, int(positions.size()) - 1);
  }
  void add_to(ConeCounts& counts) const {
    add_work(certificate_.work(), counts);
    counts.patches += tests_;
    for (const CertifiedFrames& one : certified_) {
      const auto frames = std::uint64_t(one.last - one.first + 1);
      counts.certified_patches += frames;
      counts.certified_faces += frames * patches_.faces_below(one.node);
    }
  }
  /// What was certified, with frames from 0 on.
  const std::vector<CertifiedFrames>& certified() const { return certified_; }

 private:
  bool holds(std::uint32_t node, int first, int last) {
    ++tests_;
    certificate_.take(positions_[std::size_t(first)].data(),
                      first == last ? nullptr : positions_[std::size_t(last)].data());
    return certificate_.holds(patches_.leaves(), patches_.padded(), node, patches_.contours().of(node));
  }
  void certify(std::uint32_t node, int first, int last) {
    if (holds(node, first, last)) {
      certified_.push_back({node, first, last});
      return;
    }
    const int middle = first + (last - first) / 2;
    if (first < last && holds(node, middle, middle)) {
      if (first == middle)
        certified_.push_back({node, first, first});
      else
        certify(node, first, middle);
      certify(node, middle + 1, last);
    } else {
      patches_.for_children(node, [&](std::uint32_t child) { certify(child, first, last); });
    }
  }

  const PatchTree& patches_;
  const FramePositions& positions_;
  PatchCertificate<double> certificate_;
  std::vector<CertifiedFrames> certified_;
  std::uint64_t tests_ = 0;
};

/// A patch that was certified along an axis from a time of the segment to another; both in [0, 1].
struct CertifiedSpan {
  std::uint32_t node;
  double begin, end;
  std::array<double, 3> axis;
};

/// Schedules failures: the root at the beginning of the segment, at the failure of a certificate the children
/// of the patch, for the rest of the segment. A patch that failed does not return before the next segment:
/// its end of failing would be a second kind of event. `certified` receives what was certified.
inline void count_events(const PatchTree& patches, const ClothSegment& segment, int frames,
                         ConeCounts& counts, std::vector<CertifiedSpan>* certified = nullptr) {
  ConeFailure failure(patches, segment);
  std::vector<std::pair<std::uint32_t, double>> stack{{0, 0.0}};
  while (!stack.empty()) {
    const auto [node, from] = stack.back();
    stack.pop_back();
    double until = from;
    const double time = failure.time(node, from, counts);
    if (time != ConeFailure::at_once) {
      const bool fails = time <= 1;
      counts.failures += fails ? 1 : 0;
      until = fails ? from + time * (1 - from) : ConeFailure::never;
      const auto first = std::max<std::int64_t>(1, std::int64_t(std::ceil(from * frames)));
      const std::int64_t last = fails ? std::int64_t(std::ceil(until * frames)) - 1 : frames;
      const auto held = std::uint64_t(std::max<std::int64_t>(0, last - first + 1));
      counts.certified_patches += held;
      counts.certified_faces += held * patches.faces_below(node);
      if (certified != nullptr) certified->push_back({node, from, std::min(until, 1.0), failure.axis()});
    }
    if (until < 1) patches.for_children(node, [&](std::uint32_t child) { stack.emplace_back(child, until); });
  }
}

/// The counts of all three ways.
struct ConeWays {
  ConeCounts each_frame, events, bisected;
};

/// Counts one segment of l frames.
inline void count_cones(const PatchTree& patches, const ClothSegment& segment, int frames, ConeWays& ways) {
  const FramePositions positions = frame_positions(segment, frames);
  count_each_frame(patches, positions, ways.each_frame);
  count_events(patches, segment, frames, ways.events);
  BisectedCones(patches, positions).add_to(ways.bisected);
}

}  // namespace kbvh::experiments::micro
