#include "core/scene/moved_vertices.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace kbvh {
namespace {

/// The motion of a body's keyframed vertices on the segment that begins at or before t; empty where they
/// rest.
template <class S>
class SegmentMoves {
 public:
  SegmentMoves(const FlightPlans<S>& plans, double t) {
    const std::span<const double> times = plans.keyframe_times();
    const std::size_t k = plans.segment_at(t);
    if (t < times.front() || k + 1 >= times.size()) return;
    from_ = plans.keyframe(k);
    to_ = plans.keyframe(k + 1);
    if (!plans.curved_in(k)) return;
    bend_ = plans.bends(k);
    twist_ = plans.twists(k);
  }
  bool empty() const { return from_ == nullptr; }
  bool moves(std::uint32_t vertex) const {
    const std::size_t at = std::size_t(3) * vertex;
    return differ(from_ + at, to_ + at) || bent(bend_, at) || bent(twist_, at);
  }

 private:
  static bool differ(const S* a, const S* b) { return a[0] != b[0] || a[1] != b[1] || a[2] != b[2]; }
  static bool bent(const S* coefficients, std::size_t at) {
    static constexpr S none[3] = {0, 0, 0};
    return coefficients != nullptr && differ(coefficients + at, none);
  }

  const S *from_ = nullptr, *to_ = nullptr, *bend_ = nullptr, *twist_ = nullptr;
};

/// Returns whether a vertex with its own plan moves on the piece that begins at or before t.
template <class S>
bool moves_by_itself(const FlightPlans<S>& plans, std::uint32_t vertex, double t) {
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> piece = plans.piece_after(vertex, axis, t);
    if (piece.kind == PieceKind::ray ? piece.x1 != S(0) : piece.x0 != piece.x1) return true;
  }
  return false;
}

}  // namespace

template <class S>
MovedVertices<S>::MovedVertices(const SampledMotion<S>& motion) : SampledMotion<S>(motion) {
  start_over();
}

template <class S>
void MovedVertices<S>::start_over() {
  bodies_.resize(this->playback_->body_count());
  std::size_t largest = 0;
  for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
    forget(body);
    bodies_[body].vertices.reserve(most(vertex_count(body)) + 1);
    largest = std::max<std::size_t>(largest, vertex_count(body));
  }
  seen_.assign((largest + 63) / 64, 0);
}

template <class S>
void MovedVertices<S>::forget(std::uint32_t body) {
  bodies_[body].told = false;
  bodies_[body].end = -std::numeric_limits<double>::infinity();
}

template <class S>
void MovedVertices<S>::end_frame() {
  for (std::uint32_t body = 0; body < bodies_.size(); ++body)
    if (bodies_[body].told) forget(body);
}

template <class S>
void MovedVertices<S>::tell(std::uint32_t body, std::optional<std::span<const std::uint32_t>> vertices) {
  if (body >= bodies_.size())
    throw std::invalid_argument("moved vertices of body " + std::to_string(body) + " of " +
                                std::to_string(bodies_.size()));
  if (!vertices) {
    if (bodies_[body].told) forget(body);
    return;
  }
  const std::uint32_t count = vertex_count(body);
  for (const std::uint32_t vertex : *vertices)
    if (vertex >= count)
      throw std::invalid_argument("vertex " + std::to_string(vertex) + " moved, but body " +
                                  std::to_string(body) + " has " + std::to_string(count) + " vertices");
  Body& known = bodies_[body];
  known.told = true;
  known.end = -std::numeric_limits<double>::infinity();
  known.too_many = vertices->size() > most(count);
  known.vertices.clear();
  if (!known.too_many) known.vertices.assign(vertices->begin(), vertices->end());
}

template <class S>
std::optional<std::span<const std::uint32_t>> MovedVertices<S>::since(std::uint32_t body, double from) {
  Body& known = bodies_[body];
  const FlightPlans<S>& plans = this->playback_->plans(body);
  const double to = this->time();
  if (known.told) {
    known.told = false;
  } else {
    if (plans.is_handed_in()) return {};
    if (!(from < to)) return std::span<const std::uint32_t>();
    if (!(from >= known.begin && to <= known.end)) list(known, plans, from, to);
  }
  if (known.too_many) return {};
  return std::span<const std::uint32_t>(known.vertices);
}

template <class S>
void MovedVertices<S>::list(Body& body, const FlightPlans<S>& plans, double from, double to) {
  body.vertices.clear();
  body.too_many = false;
  double t = from;
  bool one_piece = true;
  for (;;) {
    add_moving(body, plans, t);
    t = plans.lines_end(t);
    if (!(t < to) || body.too_many) break;
    one_piece = false;
  }
  for (const std::uint32_t vertex : body.vertices) seen_[vertex / 64] = 0;
  body.begin = from;
  body.end = one_piece ? std::max(t, to) : to;
}

template <class S>
void MovedVertices<S>::add_moving(Body& body, const FlightPlans<S>& plans, double t) {
  const std::size_t room = most(plans.vertex_count());
  const std::uint32_t keyframed = plans.keyframed_count();
  const SegmentMoves<S> segment(plans, t);
  const bool own = plans.has_own_plans();
  if (segment.empty() && !own) return;
  if (!segment.empty() && !own) {
    // Mostly everything moves; a sample says so before a quarter of the vertices is listed for nothing.
    constexpr std::uint32_t sample = 64;
    std::uint32_t moving = 0;
    for (std::uint32_t i = 0; keyframed >= 4 * sample && i < sample; ++i)
      moving += segment.moves(std::uint32_t(std::uint64_t(keyframed) * i / sample)) ? 1 : 0;
    if (2 * moving > sample) {
      body.too_many = true;
      return;
    }
  }
  for (std::uint32_t v = 0; v < plans.vertex_count(); ++v) {
    const bool moves = v >= keyframed || (own && plans.has_own_plan(v))
                           ? moves_by_itself(plans, v, t)
                           : !segment.empty() && segment.moves(v);
    if (moves && !add(body, v, room)) return;
  }
}

template <class S>
bool MovedVertices<S>::add(Body& body, std::uint32_t vertex, std::size_t room) {
  std::uint64_t& word = seen_[vertex / 64];
  const std::uint64_t bit = std::uint64_t(1) << vertex % 64;
  if ((word & bit) != 0) return true;
  if (body.vertices.size() == room) {
    body.too_many = true;
    return false;
  }
  word |= bit;
  body.vertices.push_back(vertex);
  return true;
}

template <class S>
std::size_t MovedVertices<S>::bytes() const {
  std::size_t total = seen_.capacity() * sizeof(std::uint64_t) + bodies_.capacity() * sizeof(Body);
  for (const Body& body : bodies_) total += body.vertices.capacity() * sizeof(std::uint32_t);
  return total;
}

template class MovedVertices<float>;
template class MovedVertices<double>;

}  // namespace kbvh
