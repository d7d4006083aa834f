#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/families/linear/linear_bounds.hpp"
#include "core/families/wide/wide_probes.hpp"

namespace kbvh {

/// Answers probes at a time of a segment whose boxes are linear in time. A box is interpolated when a probe
/// first reads it. A body that is apart from all others has only one box in the segment: its boxes are
/// computed from its positions when a probe enters it.
template <class S>
class LinearProbes {
 public:
  LinearProbes(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : probes_(scene, motion), motion_(motion) {}

  /// Answers probes at t, the time of the motion. stale[body][wide node] must be
  /// nonzero unless the boxes of the node's children in the body's hierarchy are those at t. The other
  /// parameters are those of WideProbes.
  void answer(LinearBounds<S>& bounds, double t, std::vector<std::vector<std::uint8_t>>& stale,
              const Probes<S>& probes, TriangleTestStats& stats, std::uint64_t& tests, RayBodies* bodies) {
    moments_.clear();
    for (std::uint32_t body = 0; body < bounds.body_count(); ++body)
      moments_.push_back({bounds.hierarchy(body).arrays(), bounds.side(body).ends(), stale[body].data(),
                          bounds.fraction(t)});
    const auto side_of = [&](std::uint32_t body) {
      WideProbeSide<S> side(&bounds.hierarchy(body), stale[body].data());
      if (!side.hierarchy->empty()) side.root = root_at(bounds.side(body), moments_[body].fraction);
      return side;
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) {
      auto& hierarchy = bounds.hierarchy(body);
      if (bounds.side(body).apart) {
        hierarchy.refit(motion_.positions(body));
        std::fill(stale[body].begin(), stale[body].end(), 0);
        return;
      }
      wide_linear_kernels<S>(hierarchy.kernels()).make(hierarchy.width())(moments_[body], node);
      stale[body][node] = 0;
    };
    probes_.answer(probes, side_of, make, stats, tests, bodies);
  }

  std::size_t bytes() const { return probes_.bytes() + moments_.capacity() * sizeof(WideMoment<S>); }

 private:
  /// Interpolates the box of a body. The margin covers all roundings but the last.
  static Box<S> root_at(const BodySegmentBounds<S>& side, S fraction) {
    constexpr S infinity = std::numeric_limits<S>::infinity();
    const Box<double> between = side.widened_between(0, double(fraction));
    Box<S> box;
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = std::nextafter(S(between.lower[axis]), -infinity);
      box.upper[axis] = std::nextafter(S(between.upper[axis]), infinity);
    }
    return box;
  }

  WideProbes<S> probes_;
  SampledMotion<S> motion_;
  std::vector<WideMoment<S>> moments_;  ///< [body], of the current call
};

}  // namespace kbvh
