#include "core/facade/strategy_broad_phase.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "core/broad_phase/checked_input.hpp"
#include "core/broad_phase/kernels/element_boxes.hpp"
#include "core/facade/typed_world.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// The session that searches one kind of candidates.
template <class S>
struct detail::StrategySearch {
  StrategySearch(Scene<S> bodies, const Contestant& contestant, double t)
      : scene(std::move(bodies)), session(scene, contestant, Use::timed) {
    session.reset(t);
  }
  Scene<S> scene;
  Session<S> session;
  PairBuffer pairs;
  PhaseTimes ignored;
};

namespace {

/// Doubles the vertices of primitives: vertex v becomes 2 v and 2 v + 1.
Primitives over_corners(const Primitives& primitives) {
  Primitives nets;
  nets.kind = PrimitiveKind::control_nets;
  std::vector<std::uint32_t> corners;
  for (std::uint32_t p = 0; p < primitives.count(); ++p) {
    corners.clear();
    for (const std::uint32_t v : primitives[p]) corners.insert(corners.end(), {2 * v, 2 * v + 1});
    nets.add(corners);
  }
  return nets;
}

/// Returns whether two views are the same: views of the same memory may differ in strides or sizes.
template <class S>
bool same_view(const MatrixView<S>& a, const MatrixView<S>& b) {
  return a.data == b.data && a.rows == b.rows && a.columns == b.columns && a.row_step == b.row_step &&
         a.column_step == b.column_step;
}

template <class S>
void check(const MatrixView<S>& v0, const MatrixView<S>& v1, std::uint32_t vertices) {
  const bool moves = !same_view(v0, v1);
  check_positions(v0, vertices, moves ? "V0" : "V");
  if (moves) check_positions(v1, vertices, "V1");
}

}  // namespace

template <class S>
StrategyBroadPhase<S>::StrategyBroadPhase(const std::string& strategy,
                                          std::map<std::string, std::string> params,
                                          const std::map<std::string, std::string>& topology)
    : strategy_(strategy), params_(std::move(params)), topology_(topology) {
  facade::contestant_of(strategy_, params_, topology_);
}

template <class S>
StrategyBroadPhase<S>::~StrategyBroadPhase() = default;

template <class S>
void StrategyBroadPhase<S>::start(const MatrixView<S>& v0, const MatrixView<S>& v1, Elements elements,
                                  double radius) {
  const S half = half_up(length_up<S>(radius, "the radius"));
  const std::uint32_t vertices = elements.vertex_count();
  check(v0, v1, vertices);
  for (std::unique_ptr<detail::StrategySearch<S>>& search : searches_) search.reset();
  for (std::size_t element = 0; element < element_kinds; ++element)
    nets_.lists[element] = over_corners(elements.lists[element]);
  elements_ = std::move(elements);
  filter_.clear();
  vertices_ = vertices;
  half_radius_ = half;
  time_ = 0;
  corners_.assign(std::size_t(6) * vertices + 1, S(0));
  boxes_.resize(std::size_t(8) * vertices);
  begin_points_.resize(std::size_t(4) * vertices);
  end_points_.resize(std::size_t(4) * vertices);
  built_ = true;
  write_boxes(v0, v1);
}

template <class S>
void StrategyBroadPhase<S>::take(const MatrixView<S>& v0, const MatrixView<S>& v1) {
  built();
  check(v0, v1, vertices_);
  time_ += 1;
  write_boxes(v0, v1);
}

template <class S>
void StrategyBroadPhase<S>::write_boxes(const MatrixView<S>& v0, const MatrixView<S>& v1) {
  VertexBoxesJob<S> job{};
  job.begin = {v0.data, v0.row_step, v0.column_step};
  job.end = {v1.data, v1.row_step, v1.column_step};
  job.count = vertices_;
  job.grown = half_radius_;
  job.begin_points = begin_points_.data();
  job.end_points = end_points_.data();
  job.boxes = boxes_.data();
  element_box_kernels<S>(active_kernel_set()).vertices(job);
  for (std::size_t v = 0; v < vertices_; ++v)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // No negative zero, which positions of a playback never have.
      corners_[6 * v + axis] = boxes_[8 * v + axis] + S(0);
      corners_[6 * v + 3 + axis] = boxes_[8 * v + 4 + axis] + S(0);
    }
}

template <class S>
void StrategyBroadPhase<S>::detect(CandidateKind kind, CandidateBuffer& out) {
  built();
  const Element first = first_element(kind), second = second_element(kind);
  std::unique_ptr<detail::StrategySearch<S>>& search = searches_[std::size_t(kind)];
  if (search == nullptr) {
    Scene<S> scene;
    scene.name = name(kind);
    Body<S>& body = scene.bodies.emplace_back();
    body.name = "first";
    body.primitives = nets_.of(first);
    body.plans = FlightPlans<S>::handed_in(2 * vertices_, {corners_.begin(), corners_.end() - 1});
    const std::uint32_t other = first == second ? 0 : add_body_over(scene, 0, "second", nets_.of(second));
    scene.pairs.push_back({0, other});
    search = std::make_unique<detail::StrategySearch<S>>(
        std::move(scene), facade::contestant_of(strategy_, params_, topology_), time_);
  } else if (search->session.playback().time() != time_) {
    search->session.hand_in(0, corners_.data());
    search->session.advance(time_, search->ignored);
  }
  // `query` confirms each candidate by comparing its two boxes, also without filters and motions: a strategy
  // promises that its candidates contain the pairs, not that they are the pairs. Lazy strategies,
  // inflated or drifting boxes and volumes other than boxes list more, and no property says which do not.
  search->session.query(search->pairs, search->ignored);
  out.resize(search->pairs.size());
  std::transform(search->pairs.begin(), search->pairs.end(), out.begin(), [](const PrimitivePair& pair) {
    return Candidate{pair.primitive_a, pair.primitive_b};
  });
  if (!filter_.looks_at(kind)) return;
  filter_.prepare(elements_);
  out.resize(filter_.keep(elements_, kind, {out.data(), out.size()}));
}

template <class S>
const Elements& StrategyBroadPhase<S>::built() const {
  if (!built_) throw std::logic_error("a broad phase knows no mesh before build()");
  return elements_;
}

template <class S>
void StrategyBroadPhase<S>::set_groups(Element element, std::span<const GroupMask> groups) {
  filter_.set_groups(built(), element, groups);
}

template <class S>
void StrategyBroadPhase<S>::set_vertex_groups(std::span<const GroupMask> groups) {
  filter_.set_vertex_groups(built(), groups);
}

template <class S>
void StrategyBroadPhase<S>::exclude(CandidateKind kind, std::span<const Candidate> pairs) {
  filter_.exclude(built(), kind, pairs);
}

template <class S>
void StrategyBroadPhase<S>::exclude_rings(std::uint32_t rings) {
  built();
  filter_.exclude_rings(rings);
}

template <class S>
void StrategyBroadPhase<S>::keep_only(PairFunction function) {
  built();
  filter_.set_function(std::move(function));
}

template <class S>
void StrategyBroadPhase<S>::clear_filters() {
  filter_.clear();
}

template <class S>
std::size_t StrategyBroadPhase<S>::bytes() const {
  std::size_t total =
      (corners_.capacity() + boxes_.capacity() + begin_points_.capacity() + end_points_.capacity()) *
      sizeof(S);
  for (const Elements* elements : {&elements_, &nets_})
    for (const Primitives& list : elements->lists)
      total += (list.offsets.capacity() + list.vertices.capacity()) * sizeof(std::uint32_t);
  total += filter_.bytes();
  for (const std::unique_ptr<detail::StrategySearch<S>>& search : searches_)
    if (search != nullptr)
      total += search->session.strategy().bytes() + search->pairs.capacity() * sizeof(PrimitivePair);
  return total;
}

template class StrategyBroadPhase<float>;
template class StrategyBroadPhase<double>;

}  // namespace kbvh
