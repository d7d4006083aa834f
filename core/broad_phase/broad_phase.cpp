#include "core/broad_phase/broad_phase.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "core/broad_phase/checked_input.hpp"
#include "core/broad_phase/element_distance.hpp"
#include "core/geometry/box.hpp"

namespace kbvh {
namespace {

template <class S>
StridedPoints<S> strided(const MatrixView<S>& v) {
  return {v.data, v.row_step, v.column_step};
}

}  // namespace

template <class S>
BroadPhase<S>::BroadPhase(const BroadPhaseSettings& settings)
    : settings_(settings),
      kernels_(settings.kernels.value_or(active_kernel_set())),
      workers_(settings.threads),
      face_tests_(settings.threads) {
  if (settings.leaf_size < 5 || settings.leaf_size > 16)
    throw std::invalid_argument("leaf size must be 5 to 16, got " + std::to_string(settings.leaf_size));
  if (!(settings.most_growth >= 1))
    throw std::invalid_argument("growth must be at least 1, got " + number_text(settings.most_growth));
  const std::vector<KernelSet>& sets = supported_kernel_sets();
  if (std::find(sets.begin(), sets.end(), kernels_) == sets.end())
    throw std::invalid_argument("kernels for '" + std::string(name(kernels_)) +
                                "' cannot run on this machine");
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
  filter_.clear();
  patch_members_.forget_sides();
  for (std::size_t kind = 0; kind < candidate_kinds.size(); ++kind) {
    candidate_changes_[kind].clear();
    near_changes_[kind].clear();
  }
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
    if (!is_admissible(v(vertex, 0)) || !is_admissible(v(vertex, 1)) || !is_admissible(v(vertex, 2)))
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
      tree.refit_moved(boxes_.data(), elements_->vertex_count(), moved, settings_.most_growth);
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
void BroadPhase<S>::forget_found(Element element) {
  for (const CandidateKind kind : candidate_kinds)
    if (first_element(kind) == element || second_element(kind) == element)
      found_valid_[std::size_t(kind)] = false;
}

template <class S>
InsertedElements BroadPhase<S>::add(const MatrixView<S>& v, const Primitives& edges,
                                    const Primitives& faces) {
  constexpr std::size_t limit = std::size_t(1) << 30;
  const Primitives* const added[] = {&edges, &faces};
  if (v.rows != 0) check_positions(v, v.rows, "V");
  if (elements_->vertex_count() + v.rows >= limit)
    throw std::length_error("2^30 vertices or more; fewer are possible");
  for (const std::size_t kind : {std::size_t(1), std::size_t(2)})
    if (std::size_t(elements_->lists[kind].count()) + added[kind - 1]->count() >= limit)
      throw std::length_error("2^30 elements of one kind or more; fewer are possible");
  const InsertedElements first{elements_->vertex_count(), elements_->count(Element::edge),
                               elements_->count(Element::face)};
  for (const std::size_t kind : {std::size_t(1), std::size_t(2)}) {
    if (added[kind - 1]->count() == 0) continue;
    for (std::uint32_t i = 0; i < added[kind - 1]->count(); ++i)
      elements_->lists[kind].add((*added[kind - 1])[i]);
    trees_[kind].elements_inserted();
    forget_found(Element(kind));
  }
  if (v.rows != 0) add_vertices(v);
  filter_.elements_inserted(*elements_);
  groups_changed();
  connections_changed();
  return first;
}

template <class S>
void BroadPhase<S>::add_vertices(const MatrixView<S>& v) {
  const std::size_t first = elements_->vertex_count(), count = first + v.rows;
  for (std::uint32_t id = std::uint32_t(first); id < count; ++id)
    elements_->lists[0].add(std::span<const std::uint32_t>(&id, 1));
  points_.resize(4 * count);
  if (motion_ == Motion::straight) end_points_.resize(4 * count);
  boxes_.resize(8 * count);
  for (std::size_t row = 0; row < v.rows; ++row)
    for (std::size_t axis = 0; axis < 4; ++axis) {
      const std::size_t at = 4 * (first + row) + axis;
      points_[at] = axis < 3 ? v(row, axis) : S(0);
      if (motion_ == Motion::straight) end_points_[at] = points_[at];
    }
  if (!displacements_.empty()) {
    displacements_.resize(count, *std::min_element(displacements_.begin(), displacements_.end()));
    grown_each_.resize(count, sum_up(half_radius_, displacements_.back()));
  }
  trees_[0].elements_inserted();
  for (ElementTree<S>& tree : trees_) tree.vertices_inserted();
  forget_found(Element::vertex);
  VertexBoxesJob<S> job = packed_job();
  std::vector<std::uint32_t> added(v.rows);
  std::iota(added.begin(), added.end(), std::uint32_t(first));
  job.vertices = added.data();
  job.count = std::uint32_t(added.size());
  job.grown = sum_up(half_radius_, displacement_);
  job.grown_each = grown_each_.empty() ? nullptr : grown_each_.data();
  element_box_kernels<S>(kernels_).vertices(job);
}

template <class S>
void BroadPhase<S>::remove(Element element, std::span<const std::uint32_t> ids) {
  elements();
  Primitives& list = elements_->lists[std::size_t(element)];
  const char* const word = element == Element::vertex ? "vertex "
                           : element == Element::edge ? "edge "
                                                      : "face ";
  UnfilledArray<std::uint32_t> sorted(ids.begin(), ids.end());  // GCC 12 warns wrongly about std::allocator's
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const std::uint32_t id = sorted[i];
    const char* const wrong = id >= list.count()             ? " does not exist"
                              : !list.alive(id)              ? " has been removed before"
                              : i > 0 && sorted[i - 1] == id ? " is to be removed twice"
                                                             : nullptr;
    if (wrong != nullptr) throw std::invalid_argument(word + std::to_string(id) + wrong);
  }
  if (sorted.empty()) return;
  for (const std::uint32_t id : sorted) list.remove(id);
  if (element != Element::vertex) connections_changed();
  trees_[std::size_t(element)].elements_removed(boxes_.data(), {sorted.data(), sorted.size()});
  for (const CandidateKind kind : candidate_kinds) {
    CandidateBuffer& found = found_[std::size_t(kind)];
    if (!found_valid_[std::size_t(kind)]) continue;
    const bool first = first_element(kind) == element, second = second_element(kind) == element;
    if (first || second)
      std::erase_if(found, [&](const Candidate& pair) {
        return (first && !list.alive(pair.first)) || (second && !list.alive(pair.second));
      });
  }
}

template <class S>
void BroadPhase<S>::connections_changed() {
  patch_members_.forget_sides();
  if (filter_.rings() == 0) return;
  filter_.connections_changed();
  forget_found();
}

template <class S>
void BroadPhase<S>::groups_changed() {
  for (ElementTree<S>& tree : trees_) tree.forget_groups();
}

template <class S>
void BroadPhase<S>::set_groups(Element element, std::span<const GroupMask> groups) {
  filter_.set_groups(elements(), element, groups);
  groups_changed();
  forget_found();
}

template <class S>
void BroadPhase<S>::set_vertex_groups(std::span<const GroupMask> groups) {
  filter_.set_vertex_groups(elements(), groups);
  groups_changed();
  forget_found();
}

template <class S>
void BroadPhase<S>::exclude(CandidateKind kind, std::span<const Candidate> pairs) {
  filter_.exclude(elements(), kind, pairs);
  found_valid_[std::size_t(kind)] = false;
}

template <class S>
void BroadPhase<S>::exclude_rings(std::uint32_t rings) {
  elements();
  filter_.exclude_rings(rings);
  forget_found();
}

template <class S>
void BroadPhase<S>::keep_only(PairFunction function) {
  elements();
  filter_.set_function(std::move(function));
  forget_found();
}

template <class S>
void BroadPhase<S>::clear_filters() {
  filter_.clear();
  groups_changed();
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
ElementSearchJob<S> BroadPhase<S>::search_job(CandidateKind kind) {
  const Element first = first_element(kind), second = second_element(kind);
  filter_.prepare(*elements_);
  ElementTree<S>& a = current_tree(first);
  ElementTree<S>& b = current_tree(second);
  ElementSearchJob<S> job{};
  job.kind = kind;
  if (a.empty() || b.empty() || !overlap(a.root_box(), b.root_box())) return job;
  job.a = a.leaves();
  job.b = b.leaves();
  job.padded = settings_.leaf_size <= 8 ? 8 : 16;
  job.kernels = kernels_;
  job.grouped = filter_.has_groups(kind);
  if (job.grouped) {
    job.groups_a = a.groups(filter_.groups(first));
    job.groups_b = b.groups(filter_.groups(second));
  }
  job.usual = std::size_t(4) * (elements_->count(first) + elements_->count(second));
  static constexpr WidePair roots{0, 0};
  job.starts = {&roots, 1};
  return job;
}

template <class S>
void BroadPhase<S>::search(CandidateKind kind, CandidateBuffer& out) {
  ++detections_;
  out.clear();
  last_box_tests_ = 0;
  const ElementSearchJob<S> job = search_job(kind);
  if (job.starts.empty()) return;
  const bool filtered = filter_.looks_at(kind);
  last_box_tests_ = 1 + run_search(job, out, [&](Candidate* pairs, std::size_t count, std::uint32_t) {
                      return filtered ? filter_.keep(*elements_, kind, {pairs, count}) : count;
                    });
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
  return span_of(kept(kind));
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
  out.resize(found.size());
  out.resize(keep_within<S>(kind, *elements_, present_points(), distance, span_of(found), out.data()));
}

template <class S>
CandidateChanges BroadPhase<S>::changes(CandidateKind kind) {
  return candidate_changes_[std::size_t(kind)].take(candidates(kind), elements_->count(first_element(kind)));
}

template <class S>
CandidateChanges BroadPhase<S>::changes_within(CandidateKind kind, double distance) {
  within(kind, distance, near_);
  return near_changes_[std::size_t(kind)].take(span_of(near_), elements_->count(first_element(kind)));
}

template <class S>
std::size_t BroadPhase<S>::bytes() const {
  std::size_t total = (points_.capacity() + end_points_.capacity() + boxes_.capacity() +
                       displacements_.capacity() + grown_each_.capacity()) *
                          sizeof(S) +
                      search_.bytes() + patches_.bytes() + patch_members_.bytes();
  for (const FaceTests<S>& tests : face_tests_) total += tests.bytes();
  for (const ElementTree<S>& tree : trees_) total += tree.bytes();
  for (const CandidateBuffer& found : found_) total += found.capacity() * sizeof(Candidate);
  for (const auto* const trackers : {&candidate_changes_, &near_changes_})
    for (const ChangeTracker& tracker : *trackers) total += tracker.bytes();
  total += near_.capacity() * sizeof(Candidate) + filter_.bytes();
  if (elements_)
    for (const Primitives& list : elements_->lists)
      total += (list.offsets.capacity() + list.vertices.capacity()) * sizeof(std::uint32_t) +
               list.removed.capacity();
  return total;
}

template class BroadPhase<float>;
template class BroadPhase<double>;

}  // namespace kbvh
