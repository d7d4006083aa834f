#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/families/drift/drift_body.hpp"
#include "core/families/wide/wide_probes.hpp"

namespace kbvh {

/// The state of a body's stored boxes at the current frame.
enum class StoredBoxes : std::uint8_t {
  current,  ///< they contain the body
  old,      ///< they contain the body after DriftBody::moved_on
  unknown,  ///< only DriftBody::box does
};

/// Returns the state of a body's stored boxes. `listed`: boxes are kept as long as the lists that were made
/// with them.
template <class S>
StoredBoxes stored_boxes(const DriftBody<S>& body, bool listed) {
  if (!body.near && body.watch != DriftBody<S>::Watch::nothing) return StoredBoxes::unknown;
  return listed && body.watch == DriftBody<S>::Watch::drift ? StoredBoxes::old : StoredBoxes::current;
}

/// Answers probes in boxes that were made at an earlier frame. When a probe first reads a box, it is inflated
/// by the displacements since then.
template <class S>
class DriftProbes {
 public:
  DriftProbes(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : probes_(scene, motion), motion_(motion) {}

  /// Registers that bodies may have moved, or boxes were made.
  void moved() { ++moment_; }

  /// Answers probes at the time of the motion. `stored_boxes` returns the state of the
  /// boxes of hierarchies[body]; unknown ones are computed from positions when a probe enters the body. The
  /// other parameters are those of WideProbes.
  void answer(std::vector<WideHierarchy<S>>& hierarchies, const std::vector<DriftBody<S>>& bodies,
              bool listed, const Probes<S>& probes, TriangleTestStats& stats, std::uint64_t& tests,
              RayBodies* counts) {
    if (moving_.empty()) make_room(hierarchies);
    const auto side_of = [&](std::uint32_t body) {
      WideHierarchy<S>& hierarchy = hierarchies[body];
      WideProbeSide<S> side(&hierarchy, nullptr);
      if (hierarchy.empty()) return side;
      Moving& moving = moving_[body];
      moving.boxes = stored_boxes(bodies[body], listed);
      if (moving.boxes == StoredBoxes::current) return side;
      prepare(moving, bodies[body]);
      side.stale = moving.stale.data();
      side.root = rounded_outwards(bodies[body].box);
      if (moving.boxes == StoredBoxes::old) side.child_bounds = moving.child_bounds.data();
      return side;
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) {
      Moving& moving = moving_[body];
      WideHierarchy<S>& hierarchy = hierarchies[body];
      if (moving.boxes == StoredBoxes::unknown) {
        hierarchy.positions_changed();
        hierarchy.refit(motion_.positions(body));
        std::fill(moving.stale.begin(), moving.stale.end(), 0);
        return;
      }
      const std::size_t width = hierarchy.width(), begin = node * lane_scalars(hierarchy.width());
      const S* from = hierarchy.arrays().child_bounds + begin;
      S* to = moving.child_bounds.data() + begin;
      for (std::size_t row = 0; row < 6; ++row)
        for (std::size_t lane = 0; lane < width; ++lane) {
          const S side = from[row * width + lane];
          to[row * width + lane] = side + (moving.by[row] - moving.rounding * std::abs(side));
        }
      moving.stale[node] = 0;
    };
    probes_.answer(probes, side_of, make, stats, tests, counts);
  }

  std::size_t bytes() const {
    std::size_t total = probes_.bytes() + moving_.capacity() * sizeof(Moving);
    for (const Moving& one : moving_) total += one.child_bounds.size() * sizeof(S) + one.stale.size();
    return total;
  }

 private:
  /// The boxes of one body at the last call for which its stored boxes were not current.
  struct Moving {
    StoredBoxes boxes = StoredBoxes::current;
    std::uint64_t moment = 0;
    AlignedArray<S> child_bounds;     ///< as in WideArrays
    std::vector<std::uint8_t> stale;  ///< [wide node]
    S by[6] = {};                     ///< added to each row
    S rounding = 0;                   ///< share of a side by which it moves outwards
  };

  void make_room(const std::vector<WideHierarchy<S>>& hierarchies) {
    moving_.resize(hierarchies.size());
    for (std::size_t body = 0; body < hierarchies.size(); ++body) {
      const std::size_t nodes = hierarchies[body].node_count();
      moving_[body].stale.assign(nodes, 1);
      moving_[body].child_bounds.assign(nodes * lane_scalars(hierarchies[body].width()), S(0));
    }
  }
  void prepare(Moving& moving, const DriftBody<S>& body) {
    if (moving.moment == moment_) return;
    moving.moment = moment_;
    std::fill(moving.stale.begin(), moving.stale.end(), 1);
    if (moving.boxes != StoredBoxes::old) return;
    // A sum has two roundings of half a unit: of the displacement and of the result.
    moving.rounding = body.rounding() + 2 * std::numeric_limits<S>::epsilon();
    for (int axis = 0; axis < 3; ++axis) {
      const auto slack = [&](double way) {
        return 4 * DriftBody<S>::eps * std::abs(way) + 4 * double(std::numeric_limits<S>::min());
      };
      moving.by[axis] = S(body.low[axis] - slack(body.low[axis]));
      moving.by[axis + 3] = S(-body.high[axis] - slack(body.high[axis]));
    }
  }

  static Box<S> rounded_outwards(const Box<double>& box) {
    constexpr S infinity = std::numeric_limits<S>::infinity();
    Box<S> rounded;
    for (int axis = 0; axis < 3; ++axis) {
      rounded.lower[axis] = S(box.lower[axis]);
      rounded.upper[axis] = S(box.upper[axis]);
      if (double(rounded.lower[axis]) > box.lower[axis])
        rounded.lower[axis] = std::nextafter(rounded.lower[axis], -infinity);
      if (double(rounded.upper[axis]) < box.upper[axis])
        rounded.upper[axis] = std::nextafter(rounded.upper[axis], infinity);
    }
    return rounded;
  }

  WideProbes<S> probes_;
  SampledMotion<S> motion_;
  std::vector<Moving> moving_;  ///< [body], from the first call on
  std::uint64_t moment_ = 1;
};

}  // namespace kbvh
