#include "core/broad_phase/broad_phase.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/broad_phase/element_distance.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/geometry/box.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {
namespace {

template <class S>
bool admissible(S x) {
  return std::fabs(x) <= admissible_magnitude<S>;
}

template <class S>
[[noreturn]] void refuse_coordinate(const MatrixView<S>& v, std::size_t row, const char* what) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!admissible(v(row, axis)))
      throw std::invalid_argument(std::string(what) + ": coordinate " + "xyz"[axis] + " of vertex " +
                                  std::to_string(row) + " is " + number_text(double(v(row, axis))) +
                                  ", beyond the limit of " + admissible_text<S>());
  throw std::logic_error("no coordinate is inadmissible");
}

template <class S>
void check_shape(const MatrixView<S>& v, std::size_t vertices, const char* what) {
  if (v.rows != vertices)
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(v.rows) + " rows for " +
                                std::to_string(vertices) + " vertices");
  if (v.rows != 0 && v.columns != 3)
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(v.columns) +
                                " columns instead of 3");
}

/// Checks all coordinates; where they lie without gaps, in one loop over the memory.
template <class S>
void check_positions(const MatrixView<S>& v, std::size_t vertices, const char* what) {
  check_shape(v, vertices, what);
  const auto rows = std::ptrdiff_t(v.rows);
  unsigned wrong = 0;
  if ((v.row_step == 3 && v.column_step == 1) || (v.row_step == 1 && v.column_step == rows)) {
    for (std::size_t i = 0; i < 3 * v.rows; ++i) wrong |= admissible(v.data[i]) ? 0U : 1U;
  } else {
    for (std::size_t row = 0; row < v.rows; ++row)
      for (std::size_t axis = 0; axis < 3; ++axis) wrong |= admissible(v(row, axis)) ? 0U : 1U;
  }
  if (wrong == 0) return;
  for (std::size_t row = 0; row < v.rows; ++row)
    if (!admissible(v(row, 0)) || !admissible(v(row, 1)) || !admissible(v(row, 2)))
      refuse_coordinate(v, row, what);
}

template <class S>
StridedPoints<S> strided(const MatrixView<S>& v) {
  return {v.data, v.row_step, v.column_step};
}

/// Returns a + b of two numbers that are not negative, rounded up.
template <class S>
S sum_up(S a, S b) {
  const S sum = a + b;
  // A sum that was rounded down is smaller than one of its parts says.
  const S rest = sum - a;
  const S error = (a - (sum - rest)) + (b - rest);
  return error > 0 ? std::nextafter(sum, std::numeric_limits<S>::infinity()) : sum;
}

/// Returns a / 2, rounded up: exact but for the smallest numbers.
template <class S>
S half_up(S a) {
  const S half = a / 2;
  return half + half < a ? std::nextafter(half, std::numeric_limits<S>::infinity()) : half;
}

/// Returns the smallest S that is not less than a length. Throws std::invalid_argument unless it is one.
template <class S>
S length_up(double length, const char* what) {
  if (!(length >= 0 && length <= double(admissible_magnitude<S>)))
    throw std::invalid_argument(std::string(what) + " is " + number_text(length) +
                                ", not a number from 0 to " + admissible_text<S>());
  const S rounded = S(length);
  return double(rounded) < length ? std::nextafter(rounded, std::numeric_limits<S>::infinity()) : rounded;
}

}  // namespace

template <class S>
BroadPhase<S>::BroadPhase(const BroadPhaseSettings& settings)
    : settings_(settings), kernels_(settings.kernels.value_or(active_kernel_set())) {
  if (settings.leaf_size < 5 || settings.leaf_size > 16)
    throw std::invalid_argument("leaf size must be 5 to 16, got " + std::to_string(settings.leaf_size));
  if (!(settings.most_growth >= 1))
    throw std::invalid_argument("growth must be at least 1, got " + number_text(settings.most_growth));
}

template <class S>
BroadPhase<S>::~BroadPhase() = default;

template <class S>
const Elements& BroadPhase<S>::elements() const {
  if (!elements_) throw std::logic_error("a broad phase knows no mesh before build()");
  return *elements_;
}

template <class S>
void BroadPhase<S>::start(const MatrixView<S>& v0, const MatrixView<S>& v1, Elements elements, double radius,
                          Motion motion) {
  const S rounded = length_up<S>(radius, "the radius");
  check_positions(v0, elements.vertex_count(), motion == Motion::none ? "V" : "V0");
  if (motion == Motion::straight) check_positions(v1, elements.vertex_count(), "V1");
  elements_ = std::move(elements);
  radius_ = rounded;
  half_radius_ = half_up(rounded);
  const std::size_t vertices = elements_->vertex_count();
  points_.resize(4 * vertices);
  end_points_.clear();
  boxes_.resize(8 * vertices);
  displacement_ = left_ = 0;
  displacements_.clear();
  grown_each_.clear();
  for (std::size_t kind = 0; kind < element_kinds; ++kind)
    trees_[kind].start(elements_->lists[kind], settings_.leaf_size, kernels_);
  detections_ = references_ = 0;
  motion_ = motion;
  if (motion == Motion::straight) end_points_.resize(4 * vertices);
  VertexBoxesJob<S> job = vertex_job(v0, v1);
  element_box_kernels<S>(kernels_).vertices(job);
  forget_found();
  ++references_;
}

template <class S>
VertexBoxesJob<S> BroadPhase<S>::vertex_job(const MatrixView<S>& v0, const MatrixView<S>& v1) {
  VertexBoxesJob<S> job{};
  job.begin = strided(v0);
  job.end = strided(v1);
  job.count = elements_->vertex_count();
  job.grown = half_radius_;
  job.begin_points = points_.data();
  job.end_points = motion_ == Motion::straight ? end_points_.data() : nullptr;
  job.boxes = boxes_.data();
  return job;
}

template <class S>
VertexBoxesJob<S> BroadPhase<S>::packed_job() {
  VertexBoxesJob<S> job = vertex_job(MatrixView<S>(), MatrixView<S>());
  job.begin = {points_.data(), 4, 1};
  job.end = {end_points_.data(), 4, 1};
  return job;
}

template <class S>
void BroadPhase<S>::refer_to_present() {
  VertexBoxesJob<S> job = packed_job();
  job.grown = sum_up(half_radius_, displacement_);
  job.grown_each = grown_each_.empty() ? nullptr : grown_each_.data();
  element_box_kernels<S>(kernels_).vertices(job);
  for (ElementTree<S>& tree : trees_) tree.outdate();
  forget_found();
  ++references_;
  left_ = displacement_;
  if (!displacements_.empty()) left_ = *std::min_element(displacements_.begin(), displacements_.end());
}

template <class S>
void BroadPhase<S>::update(const MatrixView<S>& v) {
  take(v, v, Motion::none);
}

template <class S>
void BroadPhase<S>::update(const MatrixView<S>& v0, const MatrixView<S>& v1) {
  take(v0, v1, Motion::straight);
}

template <class S>
void BroadPhase<S>::take(const MatrixView<S>& v0, const MatrixView<S>& v1, Motion motion) {
  check_positions(v0, elements().vertex_count(), motion == Motion::none ? "V" : "V0");
  if (motion == Motion::straight) check_positions(v1, elements_->vertex_count(), "V1");
  motion_ = motion;
  if (motion == Motion::straight) end_points_.resize(points_.size());
  VertexBoxesJob<S> job = vertex_job(v0, v1);
  if (bounded()) {
    job.allowed = boxes_.data();
    element_box_kernels<S>(kernels_).vertices(job);
    if (!job.inside) return refer_to_present();
    left_ = job.count == 0 ? left_ : job.room;
    return;
  }
  element_box_kernels<S>(kernels_).vertices(job);
  for (ElementTree<S>& tree : trees_) tree.outdate();
  forget_found();
  ++references_;
}

template <class S>
void BroadPhase<S>::update(const MatrixView<S>& v, std::span<const std::uint32_t> moved) {
  check_shape(v, elements().vertex_count(), "V");
  if (motion_ == Motion::straight)
    throw std::logic_error("vertices that moved are told to positions, not to a motion between V0 and V1");
  for (const std::uint32_t vertex : moved) {
    if (vertex >= v.rows)
      throw std::invalid_argument("vertex " + std::to_string(vertex) + " moved, but there are " +
                                  std::to_string(v.rows));
    if (!admissible(v(vertex, 0)) || !admissible(v(vertex, 1)) || !admissible(v(vertex, 2)))
      refuse_coordinate(v, vertex, "V");
  }
  if (moved.empty()) return;
  VertexBoxesJob<S> job = vertex_job(v, v);
  job.vertices = moved.data();
  job.count = std::uint32_t(moved.size());
  if (bounded()) {
    job.allowed = boxes_.data();
    element_box_kernels<S>(kernels_).vertices(job);
    if (!job.inside) return refer_to_present();
    left_ = std::min(left_, job.room);
    return;
  }
  element_box_kernels<S>(kernels_).vertices(job);
  const bool few = moved.size() <= v.rows / 4;
  for (ElementTree<S>& tree : trees_) {
    if (few && tree.state() == ElementTree<S>::State::current)
      tree.refit_moved(boxes_.data(), elements_->vertex_count(), moved);
    else
      tree.outdate();
  }
  forget_found();
  ++references_;
}

template <class S>
void BroadPhase<S>::valid_for(double displacement) {
  elements();
  displacement_ = length_up<S>(displacement, "the displacement");
  displacements_.clear();
  grown_each_.clear();
  refer_to_present();
}

template <class S>
void BroadPhase<S>::valid_for(std::span<const S> displacements) {
  if (displacements.size() != elements().vertex_count())
    throw std::invalid_argument("there are " + std::to_string(displacements.size()) + " displacements for " +
                                std::to_string(elements_->vertex_count()) + " vertices");
  for (const S displacement : displacements) length_up<S>(double(displacement), "a displacement");
  displacement_ = 0;
  displacements_.assign(displacements.begin(), displacements.end());
  grown_each_.resize(displacements.size());
  for (std::size_t v = 0; v < displacements.size(); ++v)
    grown_each_[v] = sum_up(half_radius_, displacements[v]);
  refer_to_present();
}

template <class S>
void BroadPhase<S>::forget_trees() {
  for (ElementTree<S>& tree : trees_) tree.forget();
  forget_found();
}

template <class S>
void BroadPhase<S>::refresh() {
  elements();
  for (ElementTree<S>& tree : trees_)
    if (tree.state() == ElementTree<S>::State::outdated) tree.refresh(boxes_.data(), settings_.most_growth);
}

template <class S>
ElementTree<S>& BroadPhase<S>::current_tree(Element element) {
  ElementTree<S>& tree = trees_[std::size_t(element)];
  tree.refresh(boxes_.data(), settings_.most_growth);
  return tree;
}

template <class S>
void BroadPhase<S>::search(CandidateKind kind, CandidateBuffer& out) {
  ++detections_;
  last_box_tests_ = 0;
  out.clear();
  const Element first = first_element(kind), second = second_element(kind);
  ElementTree<S>& a = current_tree(first);
  ElementTree<S>& b = current_tree(second);
  if (a.empty() || b.empty() || !overlap(a.root_box(), b.root_box())) return;
  const ElementLeaves<S> leaves_a = a.leaves(), leaves_b = b.leaves();
  const auto& kernels = wide_overlap_kernels<S>(kernels_);
  const auto traverse = first == second ? kernels.self(8) : kernels.traverse(8);
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(2 * leaf_pair_room);
  WideTraversal state{stack_.data(),  0, stack_.size(),    leaf_pairs_.data(), 0,
                      leaf_pair_room, 1, ~std::uint64_t(0)};
  state.stack[state.depth++] = {0, 0};
  while (state.depth > 0) {
    traverse(leaves_a.tree, leaves_b.tree, state);
    take_leaf_pairs(kind, leaves_a, leaves_b, state.found, out);
    state.found = 0;
    if (state.depth + max_pairs_per_step < state.stack_room) continue;
    stack_.resize(2 * stack_.size());
    state.stack = stack_.data();
    state.stack_room = stack_.size();
  }
  last_box_tests_ += state.tests;
}

template <class S>
void BroadPhase<S>::take_leaf_pairs(CandidateKind kind, const ElementLeaves<S>& a, const ElementLeaves<S>& b,
                                    std::size_t count, CandidateBuffer& out) {
  const auto pairs =
      element_pair_kernels<S>(kernels_).of[settings_.leaf_size <= 8 ? 0 : 1][std::size_t(kind)];
  // Memory that is reserved and not written costs next to nothing; copies of long lists are expensive.
  const std::size_t room_at_first =
      element_pairs_step +
      std::size_t(4) * (elements_->count(first_element(kind)) + elements_->count(second_element(kind)));
  ElementPairsJob<S> job{a, b, leaf_pairs_.data(), 0, count, nullptr, 0, 0, 0};
  while (job.next < job.count) {
    // The kernel writes into the list itself, as far as its memory reaches.
    const std::size_t before = out.size();
    if (out.capacity() - before < element_pairs_step)
      out.reserve(std::max<std::size_t>(4 * out.capacity(), before + room_at_first));
    out.resize(out.capacity());
    job.out = &out[before].first;
    job.found = 0;
    job.out_room = out.size() - before;
    pairs(job);
    out.resize(before + job.found);
  }
  last_box_tests_ += job.tests;
}

template <class S>
const CandidateBuffer& BroadPhase<S>::kept(CandidateKind kind) {
  elements();
  CandidateBuffer& found = found_[std::size_t(kind)];
  bool& valid = found_valid_[std::size_t(kind)];
  if (!valid) {
    search(kind, found);
    valid = true;
  }
  return found;
}

template <class S>
std::span<const Candidate> BroadPhase<S>::candidates(CandidateKind kind) {
  return kept(kind);
}

template <class S>
void BroadPhase<S>::detect(CandidateKind kind, CandidateBuffer& out) {
  elements();
  if (!bounded() && !found_valid_[std::size_t(kind)]) return search(kind, out);
  const CandidateBuffer& found = kept(kind);
  out.resize(found.size());
  std::copy(found.begin(), found.end(), out.begin());
}

template <class S>
void BroadPhase<S>::within(CandidateKind kind, double distance, CandidateBuffer& out) {
  elements();
  if (!(distance >= 0 && distance <= double(radius_)))
    throw std::invalid_argument("within() takes a distance from 0 to the radius " +
                                number_text(double(radius_)) + ", not " + number_text(distance));
  const CandidateBuffer& found = kept(kind);
  const S* const points = motion_ == Motion::straight ? end_points_.data() : points_.data();
  out.resize(found.size());
  out.resize(keep_within<S>(kind, *elements_, points, distance, found, out.data()));
}

template <class S>
EarliestImpact BroadPhase<S>::earliest_impact(EarliestImpactStats* stats) {
  elements();
  if (motion_ != Motion::straight)
    throw std::logic_error("an impact is asked for without a motion from V0 to V1");
  EarliestImpact earliest;
  for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge})
    take_earlier_impacts<S>(kind, *elements_, points_.data(), end_points_.data(), kept(kind), earliest,
                            stats);
  return earliest;
}

template <class S>
std::size_t BroadPhase<S>::bytes() const {
  std::size_t total = (points_.capacity() + end_points_.capacity() + boxes_.capacity() +
                       displacements_.capacity() + grown_each_.capacity()) *
                          sizeof(S) +
                      stack_.capacity() * sizeof(WidePair) + leaf_pairs_.capacity() * sizeof(LeafSlot);
  for (const ElementTree<S>& tree : trees_) total += tree.bytes();
  for (const CandidateBuffer& found : found_) total += found.capacity() * sizeof(Candidate);
  if (elements_)
    for (const Primitives& list : elements_->lists)
      total += (list.offsets.capacity() + list.vertices.capacity()) * sizeof(std::uint32_t);
  return total;
}

template class BroadPhase<float>;
template class BroadPhase<double>;

}  // namespace kbvh
