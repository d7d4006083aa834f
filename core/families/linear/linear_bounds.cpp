#include "core/families/linear/linear_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/families/linear/segment_interval.hpp"
#include "core/families/linear/swept_root.hpp"
#include "core/families/linear/translated_boxes.hpp"
#include "core/families/wide/kernels/bounds.hpp"
#include "core/geometry/predicates.hpp"

namespace kbvh {

namespace {
constexpr std::uint32_t none_used = ~std::uint32_t(0);

/// Returns the primitives over two points for each vertex: v and v + vertices.
Primitives doubled(const Primitives& primitives, std::uint32_t vertices) {
  Primitives result;
  result.kind = PrimitiveKind::control_nets;
  std::vector<std::uint32_t> points;
  for (std::uint32_t p = 0; p < primitives.count(); ++p) {
    points.clear();
    for (const std::uint32_t v : primitives[p]) points.insert(points.end(), {v, v + vertices});
    result.add(points);
  }
  return result;
}
}  // namespace

template <class S>
LinearBounds<S>::LinearBounds(const SceneView<S>& scene, const SegmentMotion<S>& motion,
                              Topologies topologies, KernelSet kernels, const LinearSettings& settings)
    : scene_(scene),
      motion_(motion),
      cuts_(settings.cuts),
      near_bodies_(scene.pairs(), scene.body_count()),
      horizon_(settings.horizon),
      changed_(scene.body_count()),
      to_remake_(scene.body_count(), 0),
      bodies_(scene.body_count()),
      counts_(scene.body_count()),
      ahead_counts_(scene.body_count()),
      near_(scene.body_count(), 0) {
  for (Segment& segment : segments_) segment.sides.resize(body_count());
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    if (motion.has_curves(body))
      bodies_[body].hulls.assign(topologies[body], doubled(scene.primitives(body), scene.vertex_count(body)),
                                 kernels);
    hierarchy(body).assign(std::move(topologies[body]), scene.primitives(body), kernels);
    for (Segment& segment : segments_) segment.sides[body].body = &bodies_[body];
  }
  check_layouts(
      scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchy(body); });
}

template <class S>
void LinearBounds<S>::choose_segment(Segment& segment, const SegmentMotion<S>& motion, double t) const {
  // Plans without an end: foresees as many frames as recent segments have lasted.
  const double endless_duration = 1.01 * foreseen_ * (step_ > 0 ? step_ : 1.0 / 64);
  SegmentInterval interval = segment_interval(motion, body_count(), t, segment.pieces, endless_duration);
  if (!whole_ && segment.pieces == 1) horizon_.cut(interval, t, step_, segments_[present_].end);
  segment.begin = interval.begin;
  segment.end = interval.end;
  segment.knot = interval.knot;
  segment.endless = interval.endless;
}

/// Starts to make the boxes of one end, whose slot is assigned; returns the remaining work.
template <class S>
auto LinearBounds<S>::begin_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t index,
                                std::uint32_t end, double t) -> Refit {
  LinearBody<S>& body = bodies_[index];
  BodySegmentBounds<S>& side = segment.sides[index];
  EndpointBounds<S>& at = side.at[end];
  const std::size_t nodes = body.hierarchy.node_count();
  UnfilledArray<S>&child_bounds = body.child_bounds[at.slot], &node_bounds = body.node_bounds[at.slot];
  if (node_bounds.size() != 8 * nodes) {
    child_bounds.resize(nodes * lane_scalars(body.hierarchy.topology().width));
    node_bounds.resize(8 * nodes);
    make_empty(index, child_bounds.data(), node_bounds.data());
  }
  at.child_bounds = child_bounds.data();
  at.node_bounds = node_bounds.data();
  at.positions = side.on_curves
                     ? motion.hull_on_curves(index, segment.begin, segment.end, t, body.room[at.slot])
                     : motion.positions_on_lines(index, t, body.room[at.slot]);
  at.made = ++body.made;
  if (body.hierarchy.empty()) return {};
  at.excess = 0;
  // Over an uncut segment a body's boxes may be translated, as long as they are not much larger than tight
  // boxes.
  const bool whole =
      end == 1 && segment.begin == motion.lines_begin(index) && segment.end == motion.lines_end(index);
  const auto step = whole ? motion.translation(index) : std::optional<Translation<S>>{};
  std::optional<TranslatedBoxes<S>> moved;
  if (step) moved.emplace(side.at[0], *step);
  if (moved && moved->excess > 4 * std::numeric_limits<S>::epsilon()) moved.reset();
  if (side.apart) {
    if (moved) {
      moved->move_own(side.at[0].node_bounds, node_bounds.data());
      at.excess = moved->excess;
      ++counts_[index].translated_apart;
      return {};
    }
    const VertexRun all{0, scene_.vertex_count(index) * (side.on_curves ? 2 : 1)};
    bounds_kernels<S>(body.hierarchy.kernels()).of_runs(&all, 1, at.positions, node_bounds.data());
    ++counts_[index].apart;
    return {};
  }
  if (moved) {
    moved->move(side.at[0].child_bounds, side.at[0].node_bounds, body.hierarchy.topology().width, nodes,
                child_bounds.data(), node_bounds.data());
    at.excess = moved->excess;
    ++counts_[index].translated;
    return {};
  }
  return {side.on_curves ? &body.hulls : &body.hierarchy, child_bounds.data(), node_bounds.data(),
          at.positions, std::uint32_t(nodes)};
}

template <class S>
void LinearBounds<S>::step_refit(std::uint32_t body, Refit& refit, std::uint64_t nodes) {
  if (refit.left == 0) return;
  const WideHierarchy<S>& hierarchy = *refit.hierarchy;
  const std::uint32_t begin = refit.left - std::uint32_t(std::min<std::uint64_t>(refit.left, nodes));
  Workers& workers = motion_.workers();
  if (workers.several() && begin == 0 && refit.left == hierarchy.node_count()) {
    shared_refit_.start();
    shared_refit_.add(hierarchy, refit.positions, refit.child_bounds, refit.node_bounds);
    shared_refit_.run(workers);
  } else {
    hierarchy.refit_into(refit.child_bounds, refit.node_bounds, refit.positions, begin, refit.left);
  }
  counts_[body].refitted += refit.left - begin;
  refit.left = begin;
}

/// Returns whether the boxes are finite: a line without end may leave the range of numbers.
template <class S>
bool LinearBounds<S>::make_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t body,
                               std::uint32_t end, double t) {
  Refit refit = begin_end(segment, motion, body, end, t);
  step_refit(body, refit, refit.left);
  if (hierarchy(body).empty()) return true;
  return admissible_root(segment.sides[body].at[end]);
}

template <class S>
void LinearBounds<S>::start() {
  whole_ = false;
  last_ = motion_.time();
  step_ = 0;
  foreseen_ = 1;
  came_ahead_ = false;
  horizon_.start_over();
  repairs_ = {};
  near_bodies_.start_over();
  std::fill(counts_.begin(), counts_.end(), Counts{});
  restart();
}

template <class S>
void LinearBounds<S>::plans_changed() {
  foreseen_ = std::max(1.0, foreseen_ / 2);
  horizon_.restarted();
  ++repairs_.restarted;
  restart();
}

template <class S>
void LinearBounds<S>::restart() {
  for (Segment& segment : segments_)
    for (BodySegmentBounds<S>& side : segment.sides) side.current = side.apart = false;
  segments_[present_].end = none;
  forget_ahead();
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
  came_ahead_ = false;
  if (end() != none && motion_.time() <= end()) {
    if (pass_knots()) return false;
    restart();
    return true;
  }
  if (ahead_exists_ && motion_.time() <= ahead().end) {
    came_ahead_ = step_ahead(std::numeric_limits<std::uint64_t>::max());
  }
  if (came_ahead_) {
    horizon_.next_segment(share_remade());
    present_ = 1 - present_;
    for (std::uint32_t body = 0; body < body_count(); ++body)
      counts_[body].at_rest += ahead_counts_[body].at_rest;
    forget_ahead();
  } else {
    next_segment();
  }
  return true;
}

template <class S>
void LinearBounds<S>::enter() {
  note_time();
  forget_ahead();
  const bool cut = segments_[present_].pieces != 1;
  whole_ = true;
  if (cut) {
    restart();
  } else if (end() == none || motion_.time() >= end()) {
    next_segment();
  }
}

/// Assigns slots to a body's ends over a segment, and makes the boxes at its start. Returns whether the other
/// end remains to be made. `before` is the preceding segment.
template <class S>
bool LinearBounds<S>::begin_side(Segment& segment, const Segment& before, const SegmentMotion<S>& motion,
                                 std::uint32_t body, double t, Before what) {
  BodySegmentBounds<S>& side = segment.sides[body];
  const BodySegmentBounds<S>& old = before.sides[body];
  side.apart = old.apart;
  side.rounding = unit_rounding<S>;  // positions are rounded correctly
  side.at_rest = motion.at_rest(body);
  side.on_curves = motion.on_curves(body);
  side.current = true;
  std::array<std::uint32_t, 3> used{none_used, none_used, none_used};
  if (what == Before::stays) used = {old.at[0].slot, old.at[1].slot, none_used};
  const auto free_slot = [&used] {
    std::uint32_t slot = 0;
    while (std::find(used.begin(), used.end(), slot) != used.end()) ++slot;
    return slot;
  };
  // The body rests at the same place; a rest after the clip does not continue the rest before it.
  if (old.current && old.at_rest && side.at_rest &&
      old.at[1].positions == motion.positions_on_lines(body, t, bodies_[body].room[old.at[1].slot])) {
    side.at[0] = side.at[1] = old.at[1];
    ++skip_counts(body).at_rest;
    return false;
  }
  if (old.current && !old.at_rest && before.end == segment.begin && !old.on_curves && !side.on_curves) {
    side.at[0] = old.at[1];
  } else {
    side.at[0].slot = free_slot();
    make_end(segment, motion, body, 0, side.at_rest ? t : segment.begin);
  }
  if (side.at_rest) {
    side.at[1] = side.at[0];
    return false;
  }
  used[2] = side.at[0].slot;
  side.at[1].slot = free_slot();
  return true;
}

template <class S>
void LinearBounds<S>::next_segment() {
  forget_ahead();
  knots_.clear();
  clear_changed();
  horizon_.next_segment(share_remade());
  const double t = motion_.time();
  const Segment& before = segments_[present_];
  Segment& segment = segments_[1 - present_];
  const bool first = before.end == none, new_knot = first || t >= before.knot || before.end >= before.knot;
  if (!first) foreseen_ = std::min(16.0, 2 * foreseen_);
  segment.pieces = whole_ ? 1 : new_knot ? cuts_.pieces : before.pieces;
  choose_segment(segment, motion_, t);
  const double chosen_end = segment.end;
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    if (!begin_side(segment, before, motion_, body, t, Before::ends)) continue;
    // A line without end may leave the admissible range: shorten the segment.
    while (!make_end(segment, motion_, body, 1, segment.end) && segment.end > segment.begin) {
      segment.end = segment.begin + (segment.end - segment.begin) / 2;
      for (std::uint32_t other = 0; other < body; ++other)
        if (!segment.sides[other].at_rest) make_end(segment, motion_, other, 1, segment.end);
    }
  }
  // The bounds of curves are for the segment as it is now.
  if (segment.end != chosen_end)
    for (std::uint32_t body = 0; body < body_count(); ++body)
      if (segment.sides[body].on_curves) make_end(segment, motion_, body, 0, segment.begin);
  present_ = 1 - present_;
  if (new_knot && cuts_.max_looseness > 0 && !whole_ && !segment.endless) cut_while_loose(t);
  finish(segment, motion_);
}

template <class S>
void LinearBounds<S>::forget_ahead() {
  ahead_exists_ = false;
  ahead_ = {};
  std::fill(ahead_counts_.begin(), ahead_counts_.end(), Counts{});
}

template <class S>
bool LinearBounds<S>::start_ahead(const SegmentMotion<S>& motion) {
  forget_ahead();
  const Segment& before = segments_[present_];
  Segment& segment = segments_[1 - present_];
  // Such a segment's cuts are decided only when it begins, and a change of plans would discard the work.
  if (whole_ || cuts_.max_looseness > 0 || horizon_.frames() > 0 || motion.time() != before.end) return false;
  bool ends = false;
  for (std::uint32_t body = 0; body < body_count(); ++body)
    if (motion_.on_curves(body) || motion.on_curves(body)) return false;  // ends are not shared
  for (std::uint32_t body = 0; body < body_count(); ++body)
    ends = ends || motion.lines_end(body) != std::numeric_limits<double>::infinity();
  if (!ends) return false;
  segment.pieces = before.end >= before.knot ? cuts_.pieces : before.pieces;
  choose_segment(segment, motion, before.end);
  if (segment.begin != before.end) return false;
  ahead_.motion = motion;
  ahead_exists_ = true;
  return true;
}

template <class S>
bool LinearBounds<S>::step_ahead(std::uint64_t nodes) {
  constexpr std::uint64_t step = 64;
  const Segment& before = segments_[present_];
  Segment& segment = segments_[1 - present_];
  for (std::uint64_t done = 0; done < nodes;) {
    if (ahead_.refit.left > 0) {
      step_refit(ahead_.body - 1, ahead_.refit, step);
      done += step;
    } else if (ahead_.body < body_count()) {
      const std::uint32_t body = ahead_.body++;
      if (begin_side(segment, before, *ahead_.motion, body, before.end, Before::stays))
        ahead_.refit = begin_end(segment, *ahead_.motion, body, 1, segment.end);
      // Work done immediately counts as a part of a refit.
      if (ahead_.refit.left == 0) done += hierarchy(body).node_count() / 4;
    } else if (ahead_.finished) {
      return true;
    } else {
      ahead_.finished = true;
      const auto is_admissible = [&](const BodySegmentBounds<S>& side) {
        return side.hierarchy().empty() || admissible_root(side.at[1]);
      };
      if (!std::all_of(segment.sides.begin(), segment.sides.end(), is_admissible)) {
        forget_ahead();  // the segment must be shortened, as in `next_segment`
        return false;
      }
      finish(segment, *ahead_.motion);
    }
  }
  return false;
}

template <class S>
std::uint64_t LinearBounds<S>::nodes_of_segment() const {
  std::uint64_t nodes = 0;
  for (const BodySegmentBounds<S>& side : segment().sides)
    if (!side.at_rest) nodes += side.hierarchy().node_count();
  return nodes;
}

/// Cuts the segment that has just begun into twice as many pieces until the current one is tight enough.
template <class S>
void LinearBounds<S>::cut_while_loose(double t) {
  Segment& segment = segments_[present_];
  while (segment.pieces < SegmentCuts::most && std::isfinite(segment.end) && segment.end > segment.begin &&
         looseness_in_the_middle() > cuts_.max_looseness) {
    segment.pieces *= 2;
    const double begin = segment.begin, end = segment.end;
    choose_segment(segment, motion_, t);
    if (segment.begin == begin && segment.end == end) return;  // as short as doubles allow
    for (std::uint32_t body = 0; body < body_count(); ++body) {
      if (segment.sides[body].at_rest) continue;
      if (segment.begin != begin || segment.sides[body].on_curves)
        make_end(segment, motion_, body, 0, segment.begin);
      make_end(segment, motion_, body, 1, segment.end);
    }
  }
}

template <class S>
double LinearBounds<S>::looseness_in_the_middle() {
  const auto area = [](const auto& box) {
    const double x = double(box.upper[0]) - double(box.lower[0]);
    const double y = double(box.upper[1]) - double(box.lower[1]);
    const double z = double(box.upper[2]) - double(box.lower[2]);
    return x * y + y * z + z * x;
  };
  const double t = begin() + (end() - begin()) / 2;
  double tight = 0, linear = 0;
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    const BodySegmentBounds<S>& one = side(body);
    if (one.at_rest || one.apart || hierarchy(body).empty()) continue;
    const std::size_t nodes = hierarchy(body).node_count(),
                      scalars = nodes * lane_scalars(hierarchy(body).topology().width);
    middle_lanes_.resize(std::max(middle_lanes_.size(), scalars));
    middle_own_.resize(std::max(middle_own_.size(), 8 * nodes));
    std::copy_n(one.at[0].child_bounds, scalars, middle_lanes_.data());  // empty lanes
    hierarchy(body).refit_into(middle_lanes_.data(), middle_own_.data(),
                               motion_.positions_on_lines(body, t, middle_room_));
    counts_[body].refitted += nodes;
    for (std::uint32_t node = 0; node < hierarchy(body).topology().size(); ++node) {
      tight += area(hierarchy(body).box_in(middle_lanes_.data(), middle_own_.data(), node));
      linear += area(one.box_between(node, 0.5));
    }
  }
  return tight > 0 ? linear / tight - 1 : 0;
}

/// Finds the bodies whose box meets another body's box over the segment. Bodies that come near again get all
/// their boxes. Bodies that are apart get only one box from the next segment on, and keep their boxes until
/// then.
template <class S>
void LinearBounds<S>::finish(Segment& segment, const SegmentMotion<S>& motion) {
  std::fill(near_.begin(), near_.end(), 0);
  const auto box_of = [&](std::uint32_t body) {
    const BodySegmentBounds<S>& side = segment.sides[body];
    return side.hierarchy().empty() ? Box<double>{} : to_double(swept(side));
  };
  std::uint64_t tests = 0;
  const auto near = near_bodies_.find(box_of, tests);
  segment.near_pairs.assign(near.begin(), near.end());
  for (const std::uint32_t i : near) {
    const BodyPair& pair = scene_.pairs()[i];
    const BodySegmentBounds<S>&a = segment.sides[pair.first], &b = segment.sides[pair.second];
    if (a.hierarchy().empty() || b.hierarchy().empty() || !overlap(swept(a), swept(b))) continue;
    near_[pair.first] = near_[pair.second] = 1;
  }
  for (std::uint32_t body = 0; body < body_count(); ++body) {
    BodySegmentBounds<S>& side = segment.sides[body];
    if (near_[body] == 0) {
      // A resting body already has its boxes; a root that is a leaf lies in the lanes of a node.
      side.apart = side.apart || (!side.at_rest && side.hierarchy().topology().size() > 1);
    } else if (side.apart) {
      side.apart = false;
      make_end(segment, motion, body, 0, side.at_rest ? motion.time() : segment.begin);
      if (side.at_rest)
        side.at[1] = side.at[0];
      else
        make_end(segment, motion, body, 1, segment.end);
    }
  }
}

template <class S>
std::vector<Box<double>> LinearBounds<S>::boxes_at(std::uint32_t body, double t) const {
  const BodySegmentBounds<S>& one = side(body);
  std::vector<Box<double>> boxes;
  for (std::uint32_t node = 0; node < one.hierarchy().topology().size(); ++node)
    boxes.push_back(one.widened_between(node, double(fraction(t))));
  return boxes;
}

template <class S>
AuditView LinearBounds<S>::audit_view(std::uint32_t body, double t) const {
  AuditView view{side(body).hierarchy().topology(), boxes_at(body, t), {}};
  if (!side(body).apart || view.boxes.empty()) return view;
  view.stale.assign(view.boxes.size(), 1);
  view.stale[0] = 0;
  return view;
}

template <class S>
std::size_t LinearBounds<S>::bytes() const {
  std::size_t total = near_bodies_.bytes() + shared_refit_.bytes() + to_remake_.capacity() +
                      knots_.capacity() * sizeof(Knot) +
                      (middle_lanes_.size() + middle_own_.size() + middle_room_.capacity()) * sizeof(S);
  for (const LinearBody<S>& body : bodies_) total += body.bytes();
  for (const ChangedParts& parts : changed_) total += parts.bytes();
  for (const Segment& segment : segments_)
    total += segment.near_pairs.capacity() * sizeof(std::uint32_t) +
             segment.sides.size() * sizeof(BodySegmentBounds<S>);
  return total;
}

template class LinearBounds<float>;
template class LinearBounds<double>;

}  // namespace kbvh
