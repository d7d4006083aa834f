#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/separation/overlap_clock.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// A box over one segment, in which its bounds are linear: their values at begin and end, in the lanes of the
/// six gaps (OverlapClock) that the box takes part in. Of the first box of a pair these are upper x, -lower
/// x, upper y, ..., of the second one -lower x, upper x, -lower y, ...: the gaps of a pair are sums lane by
/// lane.
template <class S>
struct alignas(16 * sizeof(S)) SegmentBox {
  static constexpr std::size_t lanes = 8;
  static constexpr std::size_t stamp_lane = 7;
  S at[2]
      [lanes];  ///< [begin, end]; lanes 6 and 7 are positive numbers, and at[1][7] says which segment it is

  static SegmentBox none() {
    SegmentBox box{};
    return box;
  }
};
static_assert(sizeof(SegmentBox<float>) == 64);

/// Which box of a pair: bounds of the first one are widened (overlap_clock.hpp).
enum class BoxRole : std::uint8_t { first, second };

/// The boxes of all nodes over the segment between two keyframes, by the vertices that realise their sides
/// now. All moving bodies must have the same keyframes; where a vertex with a plan of its own takes part, all
/// numbers are NaN. Boxes are made when they are read; a side that has another realiser is made anew at once.
template <class S>
class SegmentBoxes {
 public:
  /// Room for the boxes in which bodies take part in the scene's pairs.
  SegmentBoxes(std::vector<const FlightPlans<S>*> plans, std::span<const BodyPair> pairs)
      : bodies_(plans.size()) {
    for (std::size_t body = 0; body < plans.size(); ++body) {
      bodies_[body].plans = plans[body];
      bodies_[body].at_rest = plans[body]->keyframe_count() < 2;
      const auto times = plans[body]->keyframe_times();
      if (bodies_[body].at_rest || plans[body]->keyframed_count() == 0) continue;
      if (times_.empty()) times_ = times;
      alike_ = alike_ && std::equal(times.begin(), times.end(), times_.begin(), times_.end());
    }
    // Segments are numbered in the scalar.
    alike_ = alike_ && times_.size() < (std::size_t(1) << 20);
    for (const BodyPair& pair : pairs) {
      bodies_[pair.first].takes_part[0] = true;
      bodies_[pair.second].takes_part[1] = true;
    }
  }

  /// Is there anything to be known of segments? Else nothing here may be called.
  bool usable() const { return alike_ && !times_.empty(); }

  /// The present segment: from begin until before end; infinite before the first and after the last keyframe.
  double begin() const { return begin_; }
  double end() const { return end_; }

  /// Room for all nodes; forgets their boxes. `realisers` has six vertices a node.
  void follow_tree(std::uint32_t body, std::size_t nodes, const std::uint32_t* realisers) {
    Body& own = bodies_[body];
    own.realisers = realisers;
    for (const int role : {0, 1})
      if (own.takes_part[role] && own.boxes[role].size() < nodes) own.boxes[role].resize(nodes);
  }
  /// Goes to the segment that t is in, and forgets all boxes.
  void start(double t) {
    for (Body& body : bodies_)
      for (auto& boxes : body.boxes)
        for (SegmentBox<S>& box : boxes) box.at[1][SegmentBox<S>::stamp_lane] = 0;
    go_to(std::size_t(std::upper_bound(times_.begin(), times_.end(), t) - times_.begin()));
  }
  /// Goes to the segment after the present one.
  void go_on() { go_to(segment_ + 1); }

  /// Makes the boxes of those nodes for which wanted(node) is true, in the order of the nodes.
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
            __builtin_prefetch(own.last + 3 * std::size_t(realiser(own, BoxRole(role), node + ahead, lane)));
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
    // A body that takes no part in this role has no boxes.
    const auto& boxes = bodies_[body].boxes[std::size_t(role)];
    if (node < boxes.size()) __builtin_prefetch(&boxes[node]);
  }
  /// A side of a node has another realiser.
  void side_changed(std::uint32_t body, std::uint32_t node, Side side) {
    Body& own = bodies_[body];
    for (const int role : {0, 1}) {
      if (!own.takes_part[role]) continue;
      SegmentBox<S>& box = own.boxes[role][node];
      if (box.at[1][SegmentBox<S>::stamp_lane] != stamp(own) || own.plans->has_own_plans())
        forget(box);
      else
        read_lane(own, BoxRole(role), node, role == 0 ? side ^ 1U : side, box);
    }
  }
  /// Anything may have changed about a node's realisers or their plans.
  void node_changed(std::uint32_t body, std::uint32_t node) {
    for (auto& boxes : bodies_[body].boxes)
      if (!boxes.empty()) forget(boxes[node]);
  }

  /// The linear piece of a coordinate of a body that has these values at begin and end of the segment; only
  /// between keyframes.
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
    bool at_rest = false;                               ///< but for plans of their own
    std::array<bool, 2> takes_part{};                   ///< [role]
    std::array<std::vector<SegmentBox<S>>, 2> boxes{};  ///< [role][node]
    const S *first = nullptr, *last = nullptr;          ///< keyframes at the ends of the segment
  };

  void go_to(std::size_t segment) {
    segment_ = segment;
    stamp_ = S(segment + 2);
    begin_ = segment == 0 ? -infinity : times_[segment - 1];
    end_ = segment == times_.size() ? infinity : times_[segment];
    for (Body& body : bodies_) {
      const std::size_t last_keyframe = body.plans->keyframe_count() - 1;
      body.first = body.plans->keyframe(body.at_rest || segment == 0 ? 0 : segment - 1);
      body.last = body.plans->keyframe(body.at_rest ? 0 : std::min(segment, last_keyframe));
    }
  }
  /// What the stamp of a box that holds is: for a body at rest the same in all segments.
  S stamp(const Body& body) const { return body.at_rest ? S(1) : stamp_; }
  static void forget(SegmentBox<S>& box) { box.at[1][SegmentBox<S>::stamp_lane] = 0; }

  static S value(const S* keyframe, std::uint32_t vertex, BoxRole role, std::size_t lane) {
    const S x = keyframe[3 * std::size_t(vertex) + lane / 2];
    if (role == BoxRole::second) return lane % 2 == 0 ? -x : x;
    return widened_up(lane % 2 == 0 ? x : S(-x));
  }
  static std::uint32_t realiser(const Body& body, BoxRole role, std::uint32_t node, std::size_t lane) {
    return body.realisers[6 * std::size_t(node) + (role == BoxRole::first ? lane ^ 1U : lane)];
  }
  void read_lane(const Body& body, BoxRole role, std::uint32_t node, std::size_t lane,
                 SegmentBox<S>& box) const {
    const std::uint32_t vertex = realiser(body, role, node, lane);
    box.at[0][lane] = value(body.first, vertex, role, lane);
    box.at[1][lane] = body.at_rest ? box.at[0][lane] : value(body.last, vertex, role, lane);
  }
  static bool has_own_plan(const Body& body, std::uint32_t node) {
    const std::uint32_t* const realisers = body.realisers + 6 * std::size_t(node);
    return std::any_of(realisers, realisers + 6,
                       [&](std::uint32_t vertex) { return body.plans->has_own_plan(vertex); });
  }
  static void read_all(const Body& body, const S* keyframe, BoxRole role, std::uint32_t node, S* to) {
    for (std::size_t lane = 0; lane < 6; ++lane)
      to[lane] = value(keyframe, realiser(body, role, node, lane), role, lane);
  }
  void make(const Body& body, BoxRole role, std::uint32_t node, SegmentBox<S>& box) const {
    // What was the end is the begin now.
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

  std::vector<Body> bodies_;
  std::span<const double> times_;  ///< of the keyframes of all moving bodies
  bool alike_ = true;
  std::size_t segment_ = 0;  ///< keyframes not after it begins
  S stamp_ = 0;
  double begin_ = -infinity, end_ = infinity;
};

}  // namespace kbvh
