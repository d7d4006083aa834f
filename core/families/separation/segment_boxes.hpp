#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/separation/curve_hulls.hpp"
#include "core/families/separation/overlap_clock.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// A box over one segment, in which its bounds are linear. Stores the bounds at the segment's begin and end,
/// in the lanes of the six gaps (OverlapClock) that the box contributes to. The first box of a pair stores
/// upper x, -lower x, upper y, ...; the second box stores -lower x, upper x, -lower y, .... The gaps of a
/// pair are lane-by-lane sums.
template <class S>
struct alignas(16 * sizeof(S)) SegmentBox {
  static constexpr std::size_t lanes = 8;
  static constexpr std::size_t stamp_lane = 7;
  /// [begin, end][lane]. Lanes 6 and 7 are positive numbers; at[1][7] is the stamp of the segment.
  S at[2][lanes];

  static SegmentBox none() {
    SegmentBox box{};
    return box;
  }
};
static_assert(sizeof(SegmentBox<float>) == 64);

/// Position of a box in its pair. Bounds of the first box are inflated (overlap_clock.hpp).
enum class BoxRole : std::uint8_t { first, second };

/// The boxes of all nodes over the segment between two keyframes, from the vertices that currently realise
/// their sides; in a body on curves, from the chains of CurveHulls at the places of these vertices. Requires
/// that all moving bodies have the same keyframe times. If a realiser has its own plan, all numbers of the
/// box are NaN. A box is computed when it is read. A side with a new realiser is recomputed at once.
template <class S>
class SegmentBoxes {
 public:
  /// Reserves the roles that the bodies have in the scene's pairs. follow_tree makes room for their boxes.
  SegmentBoxes(std::vector<const FlightPlans<S>*> plans, std::span<const BodyPair> pairs,
               const CurveHulls<S>& hulls)
      : hulls_(&hulls), bodies_(plans.size()) {
    for (std::size_t body = 0; body < plans.size(); ++body) {
      bodies_[body].plans = plans[body];
      bodies_[body].at_rest = plans[body]->keyframe_count() < 2;
      const auto times = plans[body]->keyframe_times();
      if (bodies_[body].at_rest || plans[body]->keyframed_count() == 0) continue;
      if (times_.empty()) times_ = times;
      alike_ = alike_ && std::equal(times.begin(), times.end(), times_.begin(), times_.end());
    }
    // The scalar type must represent stamps, which are segment numbers, exactly.
    alike_ = alike_ && times_.size() < (std::size_t(1) << 20);
    for (const BodyPair& pair : pairs) {
      bodies_[pair.first].takes_part[0] = true;
      bodies_[pair.second].takes_part[1] = true;
    }
  }

  /// Returns whether the moving bodies share keyframe times. If not, no other function but bytes() may be
  /// called.
  bool usable() const { return alike_ && !times_.empty(); }

  /// Return the current segment, [begin, end). Infinite before the first and after the last keyframe.
  double begin() const { return begin_; }
  double end() const { return end_; }

  /// Sets the realisers of a body, six vertices per node, and makes room for the boxes of all nodes.
  void follow_tree(std::uint32_t body, std::size_t nodes, const std::uint32_t* realisers) {
    Body& own = bodies_[body];
    own.realisers = realisers;
    for (const int role : {0, 1})
      if (own.takes_part[role] && own.boxes[role].size() < nodes) own.boxes[role].resize(nodes);
  }
  /// Enters the segment that contains t, and invalidates all boxes.
  void start(double t) {
    for (Body& body : bodies_)
      for (auto& boxes : body.boxes)
        for (SegmentBox<S>& box : boxes) box.at[1][SegmentBox<S>::stamp_lane] = 0;
    go_to(std::size_t(std::upper_bound(times_.begin(), times_.end(), t) - times_.begin()));
  }
  /// Advances to the next segment.
  void next_segment() { go_to(segment_ + 1); }

  /// Computes the boxes of the nodes for which wanted(node) is true, in the order of the nodes.
  template <class Wanted>
  void make_all(std::uint32_t body, const Wanted& wanted) {
    Body& own = bodies_[body];
    for (const int role : {0, 1}) {
      auto& boxes = own.boxes[std::size_t(role)];
      if (own.at_rest) continue;
      constexpr std::uint32_t ahead = 8;
      const auto nodes = std::uint32_t(boxes.size());
      for (std::uint32_t node = 0; node < nodes; ++node) {
        if (node + ahead < nodes && wanted(node + ahead))
          for (std::size_t lane = 0; lane < 6; ++lane)
            __builtin_prefetch(own.last[bound_of(BoxRole(role), lane)] +
                               3 * std::size_t(realiser(own, BoxRole(role), node + ahead, lane)));
        if (wanted(node)) box(body, BoxRole(role), node);
      }
    }
  }

  const SegmentBox<S>& box(std::uint32_t body, BoxRole role, std::uint32_t node) {
    Body& own = bodies_[body];
    SegmentBox<S>& box = own.boxes[std::size_t(role)][node];
    if (box.at[1][SegmentBox<S>::stamp_lane] != stamp(own)) make(own, role, node, box);
    return box;
  }
  void prefetch(std::uint32_t body, BoxRole role, std::uint32_t node) const {
    // A body without this role has no boxes.
    const auto& boxes = bodies_[body].boxes[std::size_t(role)];
    if (node < boxes.size()) __builtin_prefetch(&boxes[node]);
  }
  /// Prefetches the positions of a vertex at the ends of the segment.
  void prefetch_vertex(std::uint32_t body, std::uint32_t vertex) const {
    const Body& own = bodies_[body];
    if (vertex >= own.plans->keyframed_count()) return;
    for (const std::size_t bound : {0, 1}) {
      __builtin_prefetch(own.first[bound] + 3 * std::size_t(vertex));
      __builtin_prefetch(own.last[bound] + 3 * std::size_t(vertex));
    }
  }
  /// Returns the lane of a side.
  static std::size_t lane_of(BoxRole role, Side side) { return role == BoxRole::first ? side ^ 1U : side; }
  /// Updates one side of a node, which has a new realiser.
  void side_changed(std::uint32_t body, std::uint32_t node, Side side) {
    Body& own = bodies_[body];
    for (const int role : {0, 1}) {
      if (!own.takes_part[role]) continue;
      SegmentBox<S>& box = own.boxes[role][node];
      if (box.at[1][SegmentBox<S>::stamp_lane] != stamp(own) || own.plans->has_own_plans())
        forget(box);
      else
        read_lane(own, BoxRole(role), node, lane_of(BoxRole(role), side), box);
    }
  }
  /// Invalidates the boxes of a node, whose realisers or plans may have changed.
  void node_changed(std::uint32_t body, std::uint32_t node) {
    for (auto& boxes : bodies_[body].boxes)
      if (!boxes.empty()) forget(boxes[node]);
  }

  /// Returns the linear piece of a coordinate of a body with the given values at the segment's begin and end.
  /// Valid only between keyframes.
  Piece<S> piece(std::uint32_t body, S first, S last) const {
    if (!bodies_[body].at_rest) return {begin_, end_, first, last, PieceKind::chord};
    return {bodies_[body].plans->keyframe_times()[0], infinity, first, S(0), PieceKind::ray};
  }

  std::size_t bytes() const {
    std::size_t total = 0;
    for (const Body& body : bodies_)
      for (const auto& boxes : body.boxes) total += boxes.capacity() * sizeof(SegmentBox<S>);
    return total;
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  struct Body {
    const FlightPlans<S>* plans = nullptr;
    const std::uint32_t* realisers = nullptr;
    bool at_rest = false;                               ///< has no motion apart from per-vertex plans
    std::array<bool, 2> takes_part{};                   ///< [role]
    std::array<std::vector<SegmentBox<S>>, 2> boxes{};  ///< [role][node]
    /// Keyframes at the ends of the segment, for lower and for upper bounds.
    std::array<const S*, 2> first{}, last{};
  };

  void go_to(std::size_t segment) {
    segment_ = segment;
    stamp_ = S(segment + 2);
    begin_ = segment == 0 ? -infinity : times_[segment - 1];
    end_ = segment == times_.size() ? infinity : times_[segment];
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      const std::size_t last_keyframe = body.plans->keyframe_count() - 1;
      const S* const chains[2] = {hulls_->lower(index), hulls_->upper(index)};
      for (const std::size_t bound : {0, 1}) {
        const auto keyframe = [&](std::size_t k) {
          return chains[bound] == nullptr ? body.plans->keyframe(k)
                                          : chains[bound] + 3 * k * body.plans->keyframed_count();
        };
        body.first[bound] = keyframe(body.at_rest || segment == 0 ? 0 : segment - 1);
        body.last[bound] = keyframe(body.at_rest ? 0 : std::min(segment, last_keyframe));
      }
    }
  }
  /// Returns the stamp of an up-to-date box. A resting body has the same stamp in all segments.
  S stamp(const Body& body) const { return body.at_rest ? S(1) : stamp_; }
  static void forget(SegmentBox<S>& box) { box.at[1][SegmentBox<S>::stamp_lane] = 0; }

  static S value(const S* keyframe, std::uint32_t vertex, BoxRole role, std::size_t lane) {
    const S x = keyframe[3 * std::size_t(vertex) + lane / 2];
    if (role == BoxRole::second) return lane % 2 == 0 ? -x : x;
    return widened_up(lane % 2 == 0 ? x : S(-x));
  }
  static std::size_t side_of(BoxRole role, std::size_t lane) {
    return role == BoxRole::first ? lane ^ 1U : lane;
  }
  /// Returns whether a lane holds lower (0) or upper bounds (1).
  static std::size_t bound_of(BoxRole role, std::size_t lane) { return side_of(role, lane) & 1U; }
  static std::uint32_t realiser(const Body& body, BoxRole role, std::uint32_t node, std::size_t lane) {
    return body.realisers[6 * std::size_t(node) + side_of(role, lane)];
  }
  void read_lane(const Body& body, BoxRole role, std::uint32_t node, std::size_t lane,
                 SegmentBox<S>& box) const {
    const std::uint32_t vertex = realiser(body, role, node, lane);
    const std::size_t bound = bound_of(role, lane);
    box.at[0][lane] = value(body.first[bound], vertex, role, lane);
    box.at[1][lane] = body.at_rest ? box.at[0][lane] : value(body.last[bound], vertex, role, lane);
  }
  static bool has_own_plan(const Body& body, std::uint32_t node) {
    const std::uint32_t* const realisers = body.realisers + 6 * std::size_t(node);
    return std::any_of(realisers, realisers + 6,
                       [&](std::uint32_t vertex) { return body.plans->has_own_plan(vertex); });
  }
  static void read_all(const Body& body, const std::array<const S*, 2>& keyframe, BoxRole role,
                       std::uint32_t node, S* to) {
    for (std::size_t lane = 0; lane < 6; ++lane)
      to[lane] = value(keyframe[bound_of(role, lane)], realiser(body, role, node, lane), role, lane);
  }
  void make(const Body& body, BoxRole role, std::uint32_t node, SegmentBox<S>& box) const {
    // The values at the end of the previous segment are those at the begin of this one.
    const bool follows = !body.at_rest && box.at[1][SegmentBox<S>::stamp_lane] == stamp_ - 1;
    if (body.plans->has_own_plans() && has_own_plan(body, node)) {
      std::fill_n(&box.at[0][0], 2 * SegmentBox<S>::lanes, std::numeric_limits<S>::quiet_NaN());
    } else {
      if (follows)
        std::copy_n(box.at[1], 6, box.at[0]);
      else
        read_all(body, body.first, role, node, box.at[0]);
      if (body.at_rest)
        std::copy_n(box.at[0], 6, box.at[1]);
      else
        read_all(body, body.last, role, node, box.at[1]);
    }
    for (const int end : {0, 1}) box.at[end][6] = box.at[end][7] = 1;
    box.at[1][SegmentBox<S>::stamp_lane] = stamp(body);
  }

  const CurveHulls<S>* hulls_;
  std::vector<Body> bodies_;
  std::span<const double> times_;  ///< keyframe times of all moving bodies
  bool alike_ = true;
  std::size_t segment_ = 0;  ///< number of keyframes at or before its begin
  S stamp_ = 0;
  double begin_ = -infinity, end_ = infinity;
};

}  // namespace kbvh
