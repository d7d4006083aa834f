#include "core/families/linear/triangle_span_filter.hpp"

#include <algorithm>

namespace kbvh {

namespace {
/// An upper bound of all rounding of fractions in float.
constexpr float fraction_slack = 0x1p-21F;
/// Number of pairs that one thread attempts at once.
constexpr std::size_t attempts_at_once = 256;

bool differ(const BodyPair& a, const BodyPair& b) {
  return a.first != b.first || a.second != b.second;
}
}  // namespace

/// Enters all pairs into the lists by their start. Attempts pairs that overlap at the start ahead of time, if
/// requested.
template <class S>
void TriangleSpanFilter<S>::begin(const IntervalJoin<S>& join, When when) {
  intersecting_.clear();
  open_.clear();
  const auto pairs = join.pairs();
  next_.resize(std::max(next_.size(), pairs.size()));
  time_.resize(next_.size());
  place_.resize(next_.size());
  state_.assign(pairs.size(), State::apart);
  following_ = {};
  std::fill(std::begin(head_), std::end(head_), none);
  bucket_ = 0;
  last_ = -1;
  const bool ahead = when == When::ahead;
  const std::size_t first = ahead ? join.throughout() : 0;
  for (std::size_t i = pairs.size(); i-- > first;)
    if (!ahead || pairs[i].begin > 0) wait(std::uint32_t(i), pairs[i].begin);
}

template <class S>
void TriangleSpanFilter<S>::start(const IntervalJoin<S>& join) {
  begin(join, When::now);
}

template <class S>
void TriangleSpanFilter<S>::start_ahead(const IntervalJoin<S>& join) {
  begin(join, When::ahead);
  asked_ = 0;
}

template <class S>
bool TriangleSpanFilter<S>::step(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                 const IntervalJoin<S>& join, std::size_t pairs) {
  const std::size_t all = join.from_begin(), end = asked_ + std::min(pairs, all - asked_);
  due_.clear();
  for (; asked_ < end; ++asked_)
    if (join.pairs()[asked_].begin == 0) due_.push_back(std::uint32_t(asked_));
  attempt_all(segment, scene, join, 0);
  return end == all;
}

template <class S>
void TriangleSpanFilter<S>::repair(const IntervalJoin<S>& join) {
  const auto pairs = join.pairs();
  bool any_open = false;
  for (const std::uint32_t pair : join.removed()) {
    if (state_[pair] == State::intersecting)
      cease_to_intersect(pair);
    else if (state_[pair] == State::open)
      any_open = true;
  }
  if (any_open) {
    std::size_t kept = 0;
    for (const Item item : open_)
      if (pairs[item.pair].end >= 0)
        open_[kept++] = item;
      else
        set_state(item.pair, State::apart);
    open_.resize(kept);
  }
  if (next_.size() < pairs.size())
    for (auto* column : {&next_, &place_}) column->resize(2 * pairs.size());
  time_.resize(next_.size());
  state_.resize(pairs.size(), State::apart);
  following_.extend(pairs.size());
  for (std::uint32_t pair = join.first_added(); pair < pairs.size(); ++pair) wait(pair, pairs[pair].begin);
}

template <class S>
void TriangleSpanFilter<S>::wait(std::uint32_t pair, float until) {
  const std::uint32_t bucket = std::max(FractionBuckets::of(std::max(until, 0.0F)), bucket_);
  time_[pair] = until;
  next_[pair] = head_[bucket];
  head_[bucket] = pair;
}

template <class S>
void TriangleSpanFilter<S>::intersect(std::uint32_t pair, float until) {
  place_[pair] = std::uint32_t(intersecting_.size());
  intersecting_.push_back(pair);
  set_state(pair, State::intersecting);
  wait(pair, until);
}

template <class S>
void TriangleSpanFilter<S>::cease_to_intersect(std::uint32_t pair) {
  const std::uint32_t last = intersecting_.back();
  intersecting_[place_[pair]] = last;
  place_[last] = place_[pair];
  intersecting_.pop_back();
  set_state(pair, State::apart);
}

template <class S>
void TriangleSpanFilter<S>::leave_open(std::uint32_t pair, float until) {
  open_.push_back({pair, until});
  set_state(pair, State::open);
}

template <class S>
void TriangleSpanFilter<S>::collect_due(const IntervalJoin<S>& join, float fraction) {
  due_.clear();
  const std::uint32_t present = FractionBuckets::of(fraction);
  const auto pairs = join.pairs();
  for (std::uint32_t bucket = bucket_; bucket <= present; ++bucket) {
    std::uint32_t pair = head_[bucket];
    head_[bucket] = none;
    bucket_ = bucket;
    while (pair != none) {
      const std::uint32_t next = next_[pair];
      if (!is_due(pair, fraction)) {
        wait(pair, time_[pair]);  // later in the current bucket
      } else {
        if (state_[pair] == State::intersecting) cease_to_intersect(pair);
        if (pairs[pair].end >= fraction) due_.push_back(pair);
      }
      pair = next;
    }
  }
  std::size_t kept = 0;
  for (const Item item : open_) {
    if (fraction <= item.until) {
      open_[kept++] = item;
      continue;
    }
    set_state(item.pair, State::apart);
    if (pairs[item.pair].end >= fraction) due_.push_back(item.pair);
  }
  open_.resize(kept);
}

/// Finds the verdicts on the pairs [begin, end) of the due pairs.
template <class S>
void TriangleSpanFilter<S>::decide(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                   const IntervalJoin<S>& join, float fraction, float share, S rounding,
                                   std::size_t begin, std::size_t end) {
  BodyPair bodies = join.bodies_of(due_[begin]);
  const BodySegmentBounds<S>*a = nullptr, *b = nullptr;
  const std::uint32_t *corners_a = nullptr, *corners_b = nullptr;
  const auto take_bodies = [&](const BodyPair& next) {
    bodies = next;
    a = &segment.sides[bodies.first];
    b = &segment.sides[bodies.second];
    corners_a = scene.primitives(bodies.first).vertices.data();
    corners_b = scene.primitives(bodies.second).vertices.data();
  };
  take_bodies(bodies);
  const auto pairs = join.pairs();
  for (std::size_t k = begin; k < end; ++k) {
    const JoinedPair pair = pairs[due_[k]];
    if (const BodyPair joined = join.bodies_of(due_[k]); differ(joined, bodies)) take_bodies(joined);
    SpanPair<S>& span = tries_[k];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t va = std::size_t(3) * corners_a[std::size_t(3) * pair.primitive_a + c];
      const std::size_t vb = std::size_t(3) * corners_b[std::size_t(3) * pair.primitive_b + c];
      for (int at = 0; at < 2; ++at) {
        span.corner[at][c] = a->at[at].positions + va;
        span.corner[at][c + 3] = b->at[at].positions + vb;
      }
    }
    // Lines extend beyond the span; a slightly longer span contains the frame's time, which the fraction
    // approximates.
    span.begin = fraction - fraction_slack;
    span.end = fraction + share * (pair.end - fraction) + fraction_slack;
  }
  span_test_kernels<S>(a->hierarchy().kernels())
      .decide(tries_.data() + begin, end - begin, rounding, verdicts_.data() + begin);
}

template <class S>
void TriangleSpanFilter<S>::attempt(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                    const IntervalJoin<S>& join, float fraction, float share) {
  if (due_.empty()) return;
  // The largest rounding of any body: a larger one leaves more pairs open, but makes no wrong verdict.
  S rounding = 0;
  BodyPair last = join.bodies_of(due_[0]);
  const auto take_rounding = [&](const BodyPair& bodies) {
    rounding =
        std::max({rounding, segment.sides[bodies.first].rounding, segment.sides[bodies.second].rounding});
  };
  take_rounding(last);
  for (const std::uint32_t pair : due_)
    if (const BodyPair bodies = join.bodies_of(pair); differ(bodies, last)) take_rounding(last = bodies);
  rounding = span_rounding(rounding);
  tries_.resize(due_.size());
  verdicts_.resize(due_.size());
  const auto attempt_part = [&](std::size_t begin, std::size_t end) {
    decide(segment, scene, join, fraction, share, rounding, begin, end);
  };
  const Parts cut{due_.size(), attempts_at_once};
  if (workers_ != nullptr && workers_->several())
    workers_->for_each(
        cut.parts(), [&](std::size_t part, std::uint32_t) { attempt_part(cut.begin(part), cut.end(part)); });
  else
    attempt_part(0, due_.size());
  attempts_ += tries_.size();
  const auto pairs = join.pairs();
  std::size_t left = 0;
  for (std::size_t k = 0; k < due_.size(); ++k) {
    const std::uint32_t pair = due_[k];
    const float until = fraction + share * (pairs[pair].end - fraction);
    if (verdicts_[k] == SpanVerdict::open)
      due_[left++] = pair;
    else if (verdicts_[k] == SpanVerdict::intersect)
      intersect(pair, until);
    else if (until < pairs[pair].end)
      wait(pair, until);
  }
  due_.resize(left);
}

/// When a proof expires, retries the remaining span, then its first quarter, then that quarter's first
/// quarter, as long as several frames lie in it. An attempt costs as much as the tests of several frames, so
/// a pair stays open to its end if no other frame lies in the quarter.
template <class S>
void TriangleSpanFilter<S>::attempt_all(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                        const IntervalJoin<S>& join, float fraction) {
  attempt(segment, scene, join, fraction, 1);
  std::size_t longer = 0;
  for (const std::uint32_t pair : due_) {
    const float end = join.pairs()[pair].end;
    if (end - fraction < 4 * step_)
      leave_open(pair, end);
    else
      due_[longer++] = pair;
  }
  due_.resize(longer);
  for (float share = 0.25F; !due_.empty(); share /= 4) {
    attempt(segment, scene, join, fraction, share);
    std::size_t left = 0;
    for (const std::uint32_t pair : due_) {
      const float rest = share * (join.pairs()[pair].end - fraction);
      if (step_ > 0 && rest >= 8 * step_)
        due_[left++] = pair;
      else
        leave_open(pair, fraction + rest);
    }
    due_.resize(left);
  }
}

template <class S>
void TriangleSpanFilter<S>::move_to(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                    const IntervalJoin<S>& join, float fraction) {
  if (fraction > last_) step_ = fraction - std::max(last_, 0.0F);
  last_ = fraction;
  collect_due(join, fraction);
  const auto pairs = join.pairs();
  // No frame follows within the span, so a proof would gain nothing.
  std::size_t worth = 0;
  for (const std::uint32_t pair : due_)
    if (pairs[pair].end >= fraction + step_)
      due_[worth++] = pair;
    else
      leave_open(pair, fraction);
  due_.resize(worth);
  decided_ += intersecting_.size();
  attempt_all(segment, scene, join, fraction);
}

template <class S>
std::size_t TriangleSpanFilter<S>::read(const LinearSegment<S>& segment, const SceneView<S>& scene,
                                        const IntervalJoin<S>& join, float fraction, PairBuffer& out) {
  move_to(segment, scene, join, fraction);
  const std::size_t before = out.size();
  out.resize(before + intersecting_.size() + open_.size());
  PrimitivePair* to = out.data() + before;
  for (const std::uint32_t pair : intersecting_) *to++ = join.primitives_of(pair);
  for (const Item item : open_) *to++ = join.primitives_of(item.pair);
  return open_.size();
}

template <class S>
std::size_t TriangleSpanFilter<S>::bytes() const {
  return open_.capacity() * sizeof(Item) + state_.capacity() +
         (intersecting_.capacity() + place_.capacity() + next_.capacity() + due_.capacity()) *
             sizeof(std::uint32_t) +
         time_.capacity() * sizeof(float) + tries_.capacity() * sizeof(SpanPair<S>) + verdicts_.capacity();
}

bool all_triangles(const Primitives& primitives) {
  if (primitives.kind != PrimitiveKind::polygons) return false;
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.offsets[p] != 3 * p || primitives.offsets[p + 1] != 3 * p + 3) return false;
  return true;
}

template class TriangleSpanFilter<float>;
template class TriangleSpanFilter<double>;

}  // namespace kbvh
