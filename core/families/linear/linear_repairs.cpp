// Repairs of a segment's bounds where plans changed within it.

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/swept_root.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/geometry/predicates.hpp"
#include "core/motion/piece.hpp"
#include "core/motion/precise_quotient.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

namespace {
/// Orders a heap of knots, the earliest first.
constexpr auto later = [](const auto& a, const auto& b) { return a.time > b.time; };

/// Computes the coordinate at a time after the piece's begin, beyond its end if necessary, with an error of
/// half a unit of rounding. Returns false if, beyond the end, it is a small difference of numbers so large
/// that twice the precision of double leaves too few digits.
template <class S>
bool extend(const Piece<S>& piece, double t, S& coordinate) {
  const bool beyond = piece.kind == PieceKind::chord && t > piece.t1;
  if (piece.kind == PieceKind::chord && !beyond) {
    coordinate = round_piece(piece, t);
    return true;
  }
  DoubleDouble step{double(piece.x1), 0}, times = two_diff(t, piece.t0);
  if (beyond) {
    step = two_diff(double(piece.x1), double(piece.x0));
    times = precise_quotient(times, two_diff(piece.t1, piece.t0));
  }
  const DoubleDouble way = two_product(step.hi, times.hi), sum = two_sum(double(piece.x0), way.hi);
  const double value = sum.hi + (sum.lo + (way.lo + (step.hi * times.lo + step.lo * times.hi)));
  coordinate = S(value);
  if (std::abs(value) >= 0x1p-40 * (std::abs(double(piece.x0)) + std::abs(way.hi))) return true;
  if (!beyond) coordinate = round_piece(piece, t);
  return !beyond;
}

/// Extends a node's box to contain a vertex.
template <class S>
void enlarge(S* node_bounds, const S* position) {
  for (int axis = 0; axis < 3; ++axis) {
    node_bounds[axis] = std::min(node_bounds[axis], position[axis]);
    node_bounds[axis + 4] = std::max(node_bounds[axis + 4], position[axis]);
  }
}
/// Returns whether a line that begins at t can be extended back over the segment. Near the segment's end the
/// rounding of its last position would be multiplied by an arbitrarily large number.
bool extends_back(double begin, double t, double end) {
  return t - begin <= 16 * (end - t);
}
}  // namespace

template <class S>
bool LinearBounds<S>::repair(std::span<const PlanChange<S>> changes) {
  forget_ahead();
  const Segment& segment = segments_[present_];
  const double t = motion_.time();
  if (horizon_.frames() > 0) horizon_.changed();
  // At the segment's end every vertex is still where it was foreseen, and the next segment reads the new
  // plan.
  if (t == segment.end) return true;
  if (horizon_.frames() == 0 || whole_ || !(segment.begin <= t && t < segment.end) ||
      !extends_back(segment.begin, t, segment.end) || !(segment.end <= t + 2 * horizon_.frames() * step_))
    return false;
  for (const PlanChange<S>& change : changes)
    if (!hierarchy(change.body).empty() && !take_over(change.body)) return false;
  for (const PlanChange<S>& change : changes)
    if (!hierarchy(change.body).empty()) follow_change(change);
  const bool kept = remake_boxes();
  repairs_.kept += kept;
  return kept;
}

/// Moves the vertices whose knots have passed to their next lines.
template <class S>
bool LinearBounds<S>::pass_knots() {
  const double t = motion_.time();
  if (knots_.empty() || !(knots_.front().time < t)) return true;
  while (!knots_.empty() && knots_.front().time < t) {
    const Knot knot = knots_.front();
    std::pop_heap(knots_.begin(), knots_.end(), later);
    knots_.pop_back();
    if (!extends_back(begin(), knot.time, end())) return false;
    follow_pieces(knot.body, knot.vertex);
  }
  return remake_boxes();
}

/// Copies a body's positions at both ends, so that single ones can be replaced. Returns false if the body's
/// boxes cannot be replaced: those of a body at rest belong to both ends.
template <class S>
bool LinearBounds<S>::take_over(std::uint32_t index) {
  LinearBody<S>& body = bodies_[index];
  BodySegmentBounds<S>& side = segments_[present_].sides[index];
  if (!side.current || side.at_rest) return false;
  for (EndpointBounds<S>& end : side.at) {
    if (end.child_bounds != body.child_bounds[end.slot].data()) return false;
    std::vector<S>& room = body.room[end.slot];
    if (end.positions == room.data()) continue;
    room.assign(end.positions, end.positions + std::size_t(3) * scene_.vertex_count(index) + 1);
    end.positions = room.data();
  }
  if (!changed_[index].is_prepared()) changed_[index].prepare(body.hierarchy, scene_.vertex_count(index));
  return true;
}

/// Follows a new plan from the current time on. Plans without a knot are read from the change: that costs
/// less than reading their pieces.
template <class S>
void LinearBounds<S>::follow_change(const PlanChange<S>& change) {
  if (!change.times.empty()) return follow_pieces(change.body, change.vertex);
  const S* const from = motion_.position(change.body, change.vertex);
  const double t = motion_.time();
  S last[3];
  for (int axis = 0; axis < 3; ++axis)
    lost_ |= !extend<S>({t, none, from[axis], change.velocity[axis], PieceKind::ray}, end(), last[axis]);
  follow_line(change.body, change.vertex, t, from, last);
}

/// Follows the plan of a vertex from its last knot on.
template <class S>
void LinearBounds<S>::follow_pieces(std::uint32_t body, std::uint32_t vertex) {
  S from[3], last[3];
  Piece<S> piece;
  for (int axis = 0; axis < 3; ++axis) {
    piece = motion_.piece(body, vertex, axis);
    from[axis] = piece.x0;
    lost_ |= !extend(piece, end(), last[axis]);
  }
  if (piece.t1 < end()) {
    knots_.push_back({piece.t1, body, vertex});
    std::push_heap(knots_.begin(), knots_.end(), later);
  }
  follow_line(body, vertex, piece.t0, from, last);
}

/// Moves a vertex to the line from `from` at time t to `last` at the segment's end, extended back to the
/// segment's begin, to P = from - (last - from) * back. At a fraction s after t, the error of the line is s
/// times the rounding of `last` plus 1 - s times that of P. Each of these is half a unit; P adds some
/// roundings in double of (last - from) * back, which is at most 2 |P| + s |last|.
template <class S>
void LinearBounds<S>::follow_line(std::uint32_t index, std::uint32_t vertex, double t, const S* from,
                                  const S* last) {
  BodySegmentBounds<S>& side = segments_[present_].sides[index];
  side.rounding = unit_rounding<S> + S(0x1p-49);
  S* position[2];
  for (std::size_t end = 0; end < 2; ++end)
    position[end] = bodies_[index].room[side.at[end].slot].data() + std::size_t(3) * vertex;
  const double back = (t - begin()) / (end() - t);
  for (int axis = 0; axis < 3; ++axis) {
    position[0][axis] = S(double(from[axis]) - (double(last[axis]) - double(from[axis])) * back);
    position[1][axis] = last[axis];
    // A box hides NaN, so the segment cannot be used.
    lost_ = lost_ || !std::isfinite(position[0][axis]) || !std::isfinite(position[1][axis]);
  }
  if (side.apart) {
    for (std::size_t end = 0; end < 2; ++end)
      enlarge(bodies_[index].node_bounds[side.at[end].slot].data(), position[end]);
  } else {
    changed_[index].mark(vertex);
    to_remake_[index] = 1;
  }
}

/// Recomputes the boxes of marked leaves and above. Returns whether the segment can still be used: boxes are
/// in the range of numbers, and no bodies that were apart have come near each other.
template <class S>
bool LinearBounds<S>::remake_boxes() {
  Segment& segment = segments_[present_];
  const bool lost = std::exchange(lost_, false);
  for (std::uint32_t index = 0; index < body_count(); ++index) {
    BodySegmentBounds<S>& side = segment.sides[index];
    if (to_remake_[index] != 0) {
      to_remake_[index] = 0;
      LinearBody<S>& body = bodies_[index];
      const std::span<const std::uint32_t> nodes = changed_[index].nodes();
      const auto refit = wide_refit_kernels<S>(body.hierarchy.kernels()).listed(body.hierarchy.width());
      WideArrays<S> arrays = body.hierarchy.arrays();
      for (const EndpointBounds<S>& end : side.at) {
        arrays.child_bounds = body.child_bounds[end.slot].data();
        arrays.node_bounds = body.node_bounds[end.slot].data();
        refit(arrays, end.positions, nodes.data(), std::uint32_t(nodes.size()));
        // Rows and slabs of the changed leaves are not current; 0 is no valid stamp.
        for (auto* stamps : {&body.stamps[end.slot], &body.block_stamps[end.slot], &body.slab_stamps})
          if (!stamps->empty())
            for (const std::uint32_t leaf : changed_[index].leaves()) (*stamps)[leaf] = 0;
      }
      counts_[index].refitted += 2 * nodes.size();
      repairs_.leaves += changed_[index].leaves().size();
      repairs_.nodes += 2 * nodes.size();
    }
    if (side.rounding == unit_rounding<S>) continue;
    if (!admissible_root(side.at[0]) || !admissible_root(side.at[1])) return false;
  }
  return !lost && is_near_as_before();
}

/// Returns whether the pairs of bodies that were found near each other include all that may meet now.
template <class S>
bool LinearBounds<S>::is_near_as_before() {
  const Segment& segment = segments_[present_];
  const auto box_of = [&](std::uint32_t body) {
    const BodySegmentBounds<S>& side = segment.sides[body];
    return side.hierarchy().empty() ? Box<double>{} : to_double(swept(side));
  };
  std::uint64_t tests = 0;
  for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
    const BodyPair& pair = scene_.pairs()[i];
    const BodySegmentBounds<S>&a = segment.sides[pair.first], &b = segment.sides[pair.second];
    if (a.hierarchy().empty() || b.hierarchy().empty() || !overlap(swept(a), swept(b))) continue;
    if (a.apart || b.apart || !std::binary_search(segment.near_pairs.begin(), segment.near_pairs.end(), i))
      return false;
  }
  return true;
}

/// Returns the share of all leaves that were recomputed since the last call.
template <class S>
double LinearBounds<S>::share_remade() {
  std::uint64_t all = 1;
  for (const LinearBody<S>& body : bodies_) all += body.hierarchy.leaf_count();
  const std::uint64_t before = std::exchange(leaves_before_, repairs_.leaves);
  return double(repairs_.leaves - std::min(before, repairs_.leaves)) / double(all);
}

template <class S>
void LinearBounds<S>::clear_changed() {
  for (ChangedParts& parts : changed_) parts.clear();
}

// The header declares the instances of the whole class, so every member must be instantiated where it is
// defined.
template bool LinearBounds<float>::repair(std::span<const PlanChange<float>>);
template bool LinearBounds<float>::pass_knots();
template bool LinearBounds<float>::take_over(std::uint32_t);
template void LinearBounds<float>::follow_change(const PlanChange<float>&);
template void LinearBounds<float>::follow_pieces(std::uint32_t, std::uint32_t);
template void LinearBounds<float>::follow_line(std::uint32_t, std::uint32_t, double, const float*,
                                               const float*);
template bool LinearBounds<float>::remake_boxes();
template bool LinearBounds<float>::is_near_as_before();
template double LinearBounds<float>::share_remade();
template void LinearBounds<float>::clear_changed();
template bool LinearBounds<double>::repair(std::span<const PlanChange<double>>);
template bool LinearBounds<double>::pass_knots();
template bool LinearBounds<double>::take_over(std::uint32_t);
template void LinearBounds<double>::follow_change(const PlanChange<double>&);
template void LinearBounds<double>::follow_pieces(std::uint32_t, std::uint32_t);
template void LinearBounds<double>::follow_line(std::uint32_t, std::uint32_t, double, const double*,
                                                const double*);
template bool LinearBounds<double>::remake_boxes();
template bool LinearBounds<double>::is_near_as_before();
template double LinearBounds<double>::share_remade();
template void LinearBounds<double>::clear_changed();

}  // namespace kbvh
