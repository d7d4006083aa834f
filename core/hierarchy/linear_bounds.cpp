#include "core/hierarchy/linear_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/kernels/bounds.hpp"

namespace kbvh {

namespace {
/// The end of no segment.
constexpr double none = -std::numeric_limits<double>::infinity();
}  // namespace

template <class S>
LinearBounds<S>::LinearBounds(const SceneView<S>& scene, const SegmentMotion<S>& motion,
                              Topologies topologies, KernelSet kernels, const SegmentCuts& cuts)
    : scene_(scene),
      motion_(motion),
      cuts_(cuts),
      pieces_(cuts.pieces),
      sides_(scene.body_count()),
      refits_(scene.body_count(), 0),
      skipped_(scene.body_count()),
      near_(scene.body_count(), 0) {
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    Side& side = sides_[body];
    side.hierarchy.assign(std::move(topologies[body]), scene.primitives(body), kernels);
    const std::size_t nodes = side.hierarchy.node_count();
    for (int end = 0; end < 2; ++end) {
      side.lanes[end].assign(nodes * lane_scalars(side.hierarchy.topology().width),
                             std::numeric_limits<S>::infinity());
      side.own[end].assign(nodes * 8, S(0));
    }
  }
  for (const BodyPair& pair : scene.pairs())
    if (!sides_[pair.first].hierarchy.suits(sides_[pair.second].hierarchy))
      throw std::invalid_argument("topologies of all bodies need one width and leaf size");
}

template <class S>
void LinearBounds<S>::choose_segment(double t) {
  double begin = -std::numeric_limits<double>::infinity(), end = std::numeric_limits<double>::infinity();
  bool rest = true;
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    begin = std::max(begin, motion_.lines_begin(body));
    end = std::min(end, motion_.lines_end(body));
    rest = rest && motion_.at_rest(body);
  }
  if (rest || begin == -std::numeric_limits<double>::infinity()) begin = t;
  // Plans without an end: as many frames ahead as they have lasted lately, as far as can be told.
  if (!rest && end == std::numeric_limits<double>::infinity()) {
    begin = std::max(begin, t);
    end = t + 1.01 * foreseen_ * (step_ > 0 ? step_ : 1.0 / 64);
    begin_ = begin;
    end_ = knot_ = end;
    return;
  }
  begin_ = begin;
  end_ = knot_ = end;
  if (pieces_ == 1 || rest) return;
  const auto cut = [&](std::uint32_t k) {
    return k == pieces_ ? end : begin + (end - begin) * (double(k) / double(pieces_));
  };
  std::uint32_t k = 0;
  while (k + 1 < pieces_ && t >= cut(k + 1)) ++k;
  if (!(cut(k) < cut(k + 1))) return;  // so short that the doubles between are all used up
  begin_ = cut(k);
  end_ = cut(k + 1);
}

template <class S>
bool LinearBounds<S>::make_end(std::uint32_t body, std::uint32_t end, double t) {
  Side& side = sides_[body];
  const std::uint32_t array = side.array(end);
  side.positions[end] = motion_.positions_on_lines(body, t, side.room[array]);
  side.made[array] = std::max(side.made[0], side.made[1]) + 1;
  if (side.hierarchy.empty()) return true;
  S* own = side.own[array].data();
  if (side.apart) {
    const VertexRun all{0, scene_.vertex_count(body)};
    bounds_kernels<S>(side.hierarchy.kernels()).of_runs(&all, 1, side.positions[end], own);
    ++skipped_[body].apart;
  } else {
    side.hierarchy.refit_into(side.lanes[array].data(), own, side.positions[end]);
    ++refits_[body];
  }
  return std::all_of(own, own + 3, [](S x) { return std::isfinite(x); }) &&
         std::all_of(own + 4, own + 7, [](S x) { return std::isfinite(x); });
}

template <class S>
void LinearBounds<S>::make_margin(Side& side) const {
  S largest = 0;
  if (!side.hierarchy.empty())
    for (std::uint32_t end = 0; end < 2; ++end)
      for (std::size_t i = 0; i < 8; ++i)
        if (i % 4 != 3) largest = std::max(largest, std::abs(side.own[side.array(end)][i]));
  side.margin = 8 * std::numeric_limits<S>::epsilon() * largest + 8 * std::numeric_limits<S>::denorm_min();
}

template <class S>
void LinearBounds<S>::start() {
  whole_ = false;
  last_ = motion_.time();
  step_ = 0;
  foreseen_ = 1;
  std::fill(refits_.begin(), refits_.end(), 0);
  std::fill(skipped_.begin(), skipped_.end(), Skipped{});
  restart();
}

template <class S>
void LinearBounds<S>::plans_changed() {
  foreseen_ = std::max(1.0, foreseen_ / 2);
  restart();
}

template <class S>
void LinearBounds<S>::restart() {
  for (Side& side : sides_) side.current = side.apart = false;
  end_ = none;
  advance();
}

template <class S>
void LinearBounds<S>::note_time() {
  if (motion_.time() > last_) step_ = motion_.time() - last_;
  last_ = motion_.time();
}

template <class S>
bool LinearBounds<S>::advance() {
  note_time();
  if (end_ != none && motion_.time() <= end_) return false;
  go_on();
  return true;
}

template <class S>
void LinearBounds<S>::enter() {
  note_time();
  const bool cut = pieces_ != 1;
  whole_ = true;
  if (cut) {
    restart();
  } else if (end_ == none || motion_.time() >= end_) {
    go_on();
  }
}

template <class S>
void LinearBounds<S>::go_on() {
  const double t = motion_.time(), before = end_;
  const bool anew = end_ == none;
  if (!anew) foreseen_ = std::min(16.0, 2 * foreseen_);
  const bool next = anew || before >= knot_;
  if (next) pieces_ = whole_ ? 1 : cuts_.pieces;
  choose_segment(t);
  const bool goes_on = !anew && begin_ == before;
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    Side& side = sides_[body];
    const bool rests = motion_.at_rest(body);
    if (rests && side.current && side.at_rest) {  // where it was
      ++skipped_[body].at_rest;
      continue;
    }
    if (goes_on && !side.at_rest) {
      side.first = 1 - side.first;
      side.positions[0] = side.positions[1];
      side.at_rest = rests;
    } else {
      side.at_rest = rests;
      make_end(body, 0, rests ? t : begin_);
    }
    side.current = true;
    if (rests) {
      side.positions[1] = side.positions[0];
    } else {
      // A line without end may leave the range of numbers: then less of it.
      while (!make_end(body, 1, end_) && end_ > begin_) {
        end_ = begin_ + (end_ - begin_) / 2;
        for (std::uint32_t other = 0; other < body; ++other)
          if (!sides_[other].at_rest) make_end(other, 1, end_);
      }
    }
  }
  if (next && cuts_.max_looseness > 0 && !whole_) cut_while_loose(t);
  for (Side& side : sides_) make_margin(side);
  part_bodies();
}

/// Cuts the segment that has just begun into twice as many pieces until the present one is tight enough.
template <class S>
void LinearBounds<S>::cut_while_loose(double t) {
  while (pieces_ < SegmentCuts::most && std::isfinite(end_) && end_ > begin_ &&
         looseness_in_the_middle() > cuts_.max_looseness) {
    pieces_ *= 2;
    const double begin = begin_, end = end_;
    choose_segment(t);
    if (begin_ == begin && end_ == end) return;  // as short as doubles can be
    for (std::uint32_t body = 0; body < body_count(); ++body) {
      if (sides_[body].at_rest) continue;
      if (begin_ != begin) make_end(body, 0, begin_);
      make_end(body, 1, end_);
    }
  }
}

template <class S>
double LinearBounds<S>::looseness_in_the_middle() {
  const auto area = [](const Box<S>& box) {
    const double x = double(box.upper[0]) - double(box.lower[0]);
    const double y = double(box.upper[1]) - double(box.lower[1]);
    const double z = double(box.upper[2]) - double(box.lower[2]);
    return x * y + y * z + z * x;
  };
  const double t = begin_ + (end_ - begin_) / 2;
  double tight = 0, linear = 0;
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    const Side& side = sides_[body];
    if (side.at_rest || side.apart || side.hierarchy.empty()) continue;
    middle_lanes_.resize(std::max(middle_lanes_.size(), side.lanes[0].size()));
    middle_own_.resize(std::max(middle_own_.size(), side.own[0].size()));
    std::copy_n(side.lanes[0].data(), side.lanes[0].size(), middle_lanes_.data());  // empty lanes
    side.hierarchy.refit_into(middle_lanes_.data(), middle_own_.data(),
                              motion_.positions_on_lines(body, t, middle_room_));
    ++refits_[body];
    for (std::uint32_t node = 0; node < side.hierarchy.topology().size(); ++node) {
      const Box<S> middle = side.hierarchy.box_in(middle_lanes_.data(), middle_own_.data(), node);
      const Box<S> first =
          side.hierarchy.box_in(side.lanes[side.array(0)].data(), side.own[side.array(0)].data(), node);
      const Box<S> last =
          side.hierarchy.box_in(side.lanes[side.array(1)].data(), side.own[side.array(1)].data(), node);
      Box<S> between;
      for (int axis = 0; axis < 3; ++axis) {
        between.lower[axis] = first.lower[axis] / 2 + last.lower[axis] / 2;
        between.upper[axis] = first.upper[axis] / 2 + last.upper[axis] / 2;
      }
      tight += area(middle);
      linear += area(between);
    }
  }
  return tight > 0 ? linear / tight - 1 : 0;
}

template <class S>
Box<S> LinearBounds<S>::swept(const Side& side) const {
  Box<S> box;
  for (std::uint32_t end = 0; end < 2; ++end) {
    const S* own = side.own[side.array(end)].data();
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = std::min(box.lower[axis], own[axis] - 2 * side.margin);
      box.upper[axis] = std::max(box.upper[axis], own[axis + 4] + 2 * side.margin);
    }
  }
  return box;
}

/// Which bodies meet another's box over the segment. Those that come near again get all their boxes; those
/// that are apart get one from the next segment on, and keep those they have until then.
template <class S>
void LinearBounds<S>::part_bodies() {
  for (std::uint32_t body = 0; body < body_count(); ++body) near_[body] = 0;
  for (const BodyPair& pair : scene_.pairs()) {
    const Side &a = sides_[pair.first], &b = sides_[pair.second];
    if (a.hierarchy.empty() || b.hierarchy.empty() || !overlap(swept(a), swept(b))) continue;
    near_[pair.first] = near_[pair.second] = 1;
  }
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    Side& side = sides_[body];
    if (near_[body] == 0) {
      // What rests has its boxes already; a root that is a leaf lies where those of others do.
      side.apart = side.apart || (!side.at_rest && side.hierarchy.topology().size() > 1);
    } else if (side.apart) {
      side.apart = false;
      make_end(body, 0, side.at_rest ? motion_.time() : begin_);
      if (!side.at_rest) make_end(body, 1, end_);
    }
  }
}

template <class S>
S LinearBounds<S>::fraction(double t) const {
  if (!(end_ > begin_) || end_ == std::numeric_limits<double>::infinity()) return 0;
  return std::clamp(S((t - begin_) / (end_ - begin_)), S(0), S(1));
}

template <class S>
std::vector<Box<double>> LinearBounds<S>::boxes_at(std::uint32_t body, double t) const {
  const Side& side = sides_[body];
  const double s = double(fraction(t)), margin = double(side.margin);
  std::vector<Box<double>> boxes;
  for (std::uint32_t node = 0; node < side.hierarchy.topology().size(); ++node) {
    const Box<S> first =
        side.hierarchy.box_in(side.lanes[side.array(0)].data(), side.own[side.array(0)].data(), node);
    const Box<S> last =
        side.hierarchy.box_in(side.lanes[side.array(1)].data(), side.own[side.array(1)].data(), node);
    Box<double> box;
    for (int axis = 0; axis < 3; ++axis) {
      const double low = double(first.lower[axis]), high = double(first.upper[axis]);
      box.lower[axis] = low + s * (double(last.lower[axis]) - low) - margin;
      box.upper[axis] = high + s * (double(last.upper[axis]) - high) + margin;
    }
    boxes.push_back(box);
  }
  return boxes;
}

template <class S>
AuditView LinearBounds<S>::audit_view(std::uint32_t body, double t) const {
  const Side& side = sides_[body];
  AuditView view{side.hierarchy.topology(), boxes_at(body, t), {}};
  if (!side.apart || view.boxes.empty()) return view;
  view.stale.assign(view.boxes.size(), 1);
  view.stale[0] = 0;
  return view;
}

template <class S>
std::size_t LinearBounds<S>::bytes() const {
  std::size_t total = (middle_lanes_.size() + middle_own_.size() + middle_room_.capacity()) * sizeof(S);
  for (const Side& side : sides_) {
    total += side.hierarchy.bytes();
    for (int end = 0; end < 2; ++end)
      total += (side.lanes[end].size() + side.own[end].size() + side.room[end].capacity()) * sizeof(S);
  }
  return total;
}

std::vector<Parameter> segment_cut_parameters() {
  return {
      {"pieces",
       "1",
       {},
       "each segment between keyframes is cut into so many, for tighter boxes; 1 to 64",
       1},
      {"max_looseness",
       "0",
       {},
       "a segment is cut into twice as many pieces while boxes in the middle of its first have more surface "
       "than tight ones by this share; 0: nobody looks",
       0}};
}

SegmentCuts segment_cuts(const Params& params) {
  const double wanted = params.number("pieces"), looseness = params.number("max_looseness");
  if (!(wanted >= 1 && wanted <= SegmentCuts::most) || wanted != std::floor(wanted))
    throw ConfigError("pieces must be a whole number from 1 to 64, got " + params.word("pieces"));
  if (!(looseness >= 0))
    throw ConfigError("max_looseness must not be negative, got " + params.word("max_looseness"));
  return {std::uint32_t(wanted), looseness};
}

template class LinearBounds<float>;
template class LinearBounds<double>;

}  // namespace kbvh
