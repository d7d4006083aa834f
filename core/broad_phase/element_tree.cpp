#include "core/broad_phase/element_tree.hpp"

#include <algorithm>
#include <bit>

#include "core/base/assert.hpp"
#include "core/geometry/box.hpp"

namespace kbvh {

template <class S>
void ElementTree<S>::start(const Primitives& elements, std::uint32_t leaf_size, KernelSet kernels) {
  KBVH_ASSERT(leaf_size >= 5 && leaf_size <= 16);
  elements_ = &elements;
  kernels_ = kernels;
  list_.emplace(elements);
  corners_each_ = elements.count() == 0 ? 1 : list_->corners_each;
  KBVH_ASSERT(corners_each_ >= 1 && corners_each_ <= 3);
  tree_.start(leaf_size, kernels);
  state_ = State::unbuilt;
  first_of_vertex_.clear();
  elements_of_vertex_.clear();
  places_listed_ = groups_listed_ = contours_listed_ = false;
  work_ = {};
}

template <class S>
void ElementTree<S>::elements_inserted() {
  list_.emplace(*elements_);
  corners_each_ = elements_->count() == 0 ? 1 : list_->corners_each;
  first_of_vertex_.clear();
  state_ = State::unbuilt;
}

template <class S>
ElementLeafBoxesJob<S> ElementTree<S>::leaf_job(const S* vertex_boxes) {
  const WideLeafLists lists = tree_.leaf_lists();
  return {vertex_boxes,
          leaf_corners_.data(),
          corners_each_,
          tree_.padded_leaf_size(),
          lists.first_entry,
          leaf_ends_.data(),
          0,
          tree_.leaf_count(),
          tree_.leaves(nullptr).rows,
          tree_.leaf_boxes()};
}

template <class S>
void ElementTree<S>::refresh(const S* vertex_boxes, double most_growth) {
  if (state_ == State::current) return;
  if (state_ == State::outdated && !tree_.empty()) {
    element_box_kernels<S>(kernels_).leaves(leaf_job(vertex_boxes));
    build_kernels<S>(kernels_).nodes(tree_.arrays(), tree_.leaf_boxes(), 0, tree_.node_count());
    ++work_.refits;
    remade_since_measured_ = 0;
    if (!(surface() > most_growth * surface_when_built_)) {
      state_ = State::current;
      return;
    }
  }
  build(vertex_boxes);
}

template <class S>
void ElementTree<S>::build(const S* vertex_boxes) {
  if (list_->count != elements_->live_count()) list_.emplace(*elements_);
  const std::uint32_t count = list_->count;
  const typename CurveOrder<S>::Room room = order_.room(elements_->count(), count, kernels_);
  if (count != 0)
    element_box_kernels<S>(kernels_).elements({vertex_boxes, elements_->vertices.data(), corners_each_,
                                               list_->ids(), count, room.boxes, room.centres, room.stride,
                                               room.extent});
  builder_.build(tree_, order_, *list_);
  list_corners();
  surface_when_built_ = surface();
  built_count_ = count;
  remade_since_measured_ = 0;
  places_listed_ = groups_listed_ = contours_listed_ = false;
  state_ = State::current;
  ++work_.builds;
}

template <class S>
void ElementTree<S>::list_corners() {
  const std::uint32_t padded = tree_.padded_leaf_size(), leaves = tree_.leaf_count();
  const std::size_t size = std::size_t(leaves) * corners_each_ * padded;
  if (leaf_corners_.size() < size) leaf_corners_.resize(size);
  if (leaf_ends_.size() < leaves) leaf_ends_.resize(leaves);
  std::copy_n(tree_.leaf_lists().end_entry, leaves, leaf_ends_.begin());
  const std::uint32_t* const corners = elements_->vertices.data();
  for (std::uint32_t leaf = 0; leaf < leaves; ++leaf) {
    std::uint32_t* const to = leaf_corners_.data() + std::size_t(leaf) * corners_each_ * padded;
    const std::span<const std::uint32_t> ids = tree_.leaf_primitives(leaf);
    for (std::uint32_t c = 0; c < corners_each_; ++c)
      for (std::uint32_t lane = 0; lane < padded; ++lane)
        to[c * padded + lane] =
            corners[std::size_t(corners_each_) * ids[std::min<std::size_t>(lane, ids.size() - 1)] + c];
  }
}

template <class S>
double ElementTree<S>::surface() {
  if (tree_.empty()) return 0;
  const S* const bounds = tree_.arrays().node_bounds;
  double sum = 0;
  for (std::uint32_t n = 0; n < tree_.node_count(); ++n) {
    const S* const box = bounds + std::size_t(8) * n;
    const double x = double(box[4]) - double(box[0]), y = double(box[5]) - double(box[1]),
                 z = double(box[6]) - double(box[2]);
    sum += x * y + y * z + z * x;
  }
  return sum;
}

template <class S>
void ElementTree<S>::list_incidence(std::uint32_t vertices) {
  first_of_vertex_.assign(std::size_t(vertices) + 1, 0);
  for (const std::uint32_t v : elements_->vertices) ++first_of_vertex_[v + 1];
  for (std::size_t v = 1; v < first_of_vertex_.size(); ++v) first_of_vertex_[v] += first_of_vertex_[v - 1];
  elements_of_vertex_.resize(elements_->vertices.size());
  std::vector<std::uint32_t> next(first_of_vertex_.begin(), first_of_vertex_.end() - 1);
  for (std::uint32_t e = 0; e < elements_->count(); ++e)
    for (const std::uint32_t v : (*elements_)[e]) elements_of_vertex_[next[v]++] = e;
}

template <class S>
void ElementTree<S>::list_places() {
  const WideArrays<S> arrays = tree_.arrays();
  leaf_of_element_.assign(elements_->count(), 0);  // of removed elements: any
  node_of_leaf_.resize(tree_.leaf_count());
  parents_.resize(tree_.node_count());
  parents_[0] = 0;
  for (std::uint32_t n = 0; n < tree_.node_count(); ++n) {
    const WideNode& node = arrays.nodes[n];
    for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane) node_of_leaf_[node.first_leaf + lane] = n;
    for (std::uint32_t lane = node.leaf_count; lane < node.count; ++lane)
      parents_[node.first_child + lane - node.leaf_count] = n;
  }
  for (std::uint32_t leaf = 0; leaf < tree_.leaf_count(); ++leaf)
    for (const std::uint32_t e : leaf_elements(leaf)) leaf_of_element_[e] = leaf;
  dirty_leaves_.assign((std::size_t(tree_.leaf_count()) + 63) / 64, 0);
  dirty_nodes_.assign((std::size_t(tree_.node_count()) + 63) / 64, 0);
  places_listed_ = true;
}

template <class S>
bool ElementTree<S>::remake_leaf(ElementLeafBoxesJob<S>& job, std::uint32_t leaf) {
  const S* const own = job.leaf_boxes + std::size_t(8) * leaf;
  S before[8];
  std::copy_n(own, 8, before);
  job.begin = leaf;
  job.end = leaf + 1;
  element_box_kernels<S>(kernels_).leaves(job);
  return !std::equal(before, before + 3, own) || !std::equal(before + 4, before + 7, own + 4);
}

template <class S>
void ElementTree<S>::refit_moved(const S* vertex_boxes, std::uint32_t vertices,
                                 std::span<const std::uint32_t> moved, double most_growth) {
  KBVH_ASSERT(state_ == State::current);
  if (tree_.empty()) return;
  if (first_of_vertex_.empty()) list_incidence(vertices);
  if (!places_listed_) list_places();
  for (const std::uint32_t v : moved)
    for (std::uint32_t i = first_of_vertex_[v]; i < first_of_vertex_[v + 1]; ++i) {
      const std::uint32_t leaf = leaf_of_element_[elements_of_vertex_[i]];
      dirty_leaves_[leaf / 64] |= std::uint64_t(1) << leaf % 64;
    }
  const std::uint64_t before = work_.nodes_remade;
  remake_marked(vertex_boxes);
  ++work_.partial_refits;
  remade_since_measured_ += work_.nodes_remade - before;
  if (remade_since_measured_ < tree_.node_count()) return;
  remade_since_measured_ = 0;
  if (surface() > most_growth * surface_when_built_) outdate();
}

template <class S>
void ElementTree<S>::remake_marked(const S* vertex_boxes) {
  ElementLeafBoxesJob<S> job = leaf_job(vertex_boxes);
  for (std::size_t word = 0; word < dirty_leaves_.size(); ++word)
    for (; dirty_leaves_[word] != 0; dirty_leaves_[word] &= dirty_leaves_[word] - 1) {
      const auto leaf = std::uint32_t(64 * word) + std::uint32_t(std::countr_zero(dirty_leaves_[word]));
      ++work_.leaves_remade;
      if (!remake_leaf(job, leaf)) continue;
      const std::uint32_t node = node_of_leaf_[leaf];
      dirty_nodes_[node / 64] |= std::uint64_t(1) << node % 64;
    }
  DirtyNodesJob<S> nodes{tree_.arrays(),      tree_.leaf_boxes(),  parents_.data(),
                         dirty_nodes_.data(), dirty_nodes_.size(), 0};
  element_box_kernels<S>(kernels_).nodes(nodes);
  work_.nodes_remade += nodes.remade;
}

template <class S>
void ElementTree<S>::elements_removed(const S* vertex_boxes, std::span<const std::uint32_t> ids) {
  if (state_ == State::unbuilt || tree_.empty()) return;
  if (2 * elements_->live_count() < built_count_) return forget();
  if (!places_listed_) list_places();
  const std::uint32_t padded = tree_.padded_leaf_size();
  for (const std::uint32_t id : ids) {
    const std::uint32_t leaf = leaf_of_element_[id], begin = tree_.leaf_lists().first_entry[leaf];
    std::uint32_t* const entries = tree_.entries();
    const std::uint32_t* const found = std::find(entries + begin, entries + leaf_ends_[leaf], id);
    KBVH_ASSERT(found != entries + leaf_ends_[leaf]);
    // The last element of the leaf takes the place; unused lanes repeat the first one.
    const auto lane = std::uint32_t(found - entries) - begin, last = --leaf_ends_[leaf] - begin;
    entries[begin + lane] = entries[begin + last];
    std::uint32_t* const corners = leaf_corners_.data() + std::size_t(leaf) * corners_each_ * padded;
    for (std::uint32_t row = 0; row < corners_each_; ++row) {
      corners[row * padded + lane] = corners[row * padded + last];
      for (std::uint32_t unused = last; unused < padded; ++unused)
        corners[row * padded + unused] = corners[row * padded];
    }
    dirty_leaves_[leaf / 64] |= std::uint64_t(1) << leaf % 64;
  }
  groups_listed_ = contours_listed_ = false;
  if (state_ == State::current)
    remake_marked(vertex_boxes);
  else
    std::fill(dirty_leaves_.begin(), dirty_leaves_.end(), 0);
}

template <class S>
GroupArrays ElementTree<S>::groups(std::span<const GroupMask> of_elements) {
  KBVH_ASSERT(state_ == State::current && !tree_.empty());
  if (!groups_listed_) {
    const WideArrays<S> arrays = tree_.arrays();
    const std::uint32_t nodes = tree_.node_count();
    group_children_.resize(std::size_t(16) * nodes);
    group_nodes_.resize(std::size_t(2) * nodes);
    for (std::uint32_t n = nodes; n-- > 0;) {
      const WideNode& node = arrays.nodes[n];
      std::uint32_t* const rows = group_children_.data() + std::size_t(16) * n;
      GroupMask all{0, 0};
      for (std::uint32_t lane = 0; lane < 8; ++lane) {
        GroupMask child{0, 0};
        if (lane < node.leaf_count) {
          for (const std::uint32_t e : leaf_elements(node.first_leaf + lane))
            child |= of_elements.empty() ? GroupMask{} : of_elements[e];
        } else if (lane < node.count) {
          const std::size_t at = std::size_t(2) * (node.first_child + lane - node.leaf_count);
          child = {group_nodes_[at], group_nodes_[at + 1]};
        }
        rows[lane] = child.groups;
        rows[8 + lane] = child.mask;
        all |= child;
      }
      group_nodes_[std::size_t(2) * n] = all.groups;
      group_nodes_[std::size_t(2) * n + 1] = all.mask;
    }
    groups_listed_ = true;
  }
  return {group_children_.data(), group_nodes_.data()};
}

template <class S>
const FaceContours& ElementTree<S>::contours(std::uint32_t vertices) {
  KBVH_ASSERT(corners_each_ == 3);
  if (!contours_listed_) contours_.build(leaves(), tree_.node_count(), tree_.padded_leaf_size(), vertices);
  contours_listed_ = true;
  return contours_;
}

template <class S>
ElementLeaves<S> ElementTree<S>::leaves() {
  KBVH_ASSERT(state_ == State::current && !tree_.empty());
  const WideLeafLists lists = tree_.leaf_lists();
  return {tree_.arrays(),   lists.first_entry,          leaf_ends_.data(),
          lists.primitives, tree_.leaves(nullptr).rows, leaf_corners_.data()};
}

template <class S>
std::size_t ElementTree<S>::bytes() const {
  return order_.bytes() + builder_.bytes() + tree_.bytes() + contours_.bytes() +
         (leaf_corners_.capacity() + leaf_ends_.capacity() + group_children_.capacity() +
          group_nodes_.capacity() + first_of_vertex_.capacity() + elements_of_vertex_.capacity() +
          leaf_of_element_.capacity() + node_of_leaf_.capacity() + parents_.capacity()) *
             sizeof(std::uint32_t) +
         (dirty_leaves_.capacity() + dirty_nodes_.capacity()) * sizeof(std::uint64_t);
}

template class ElementTree<float>;
template class ElementTree<double>;

}  // namespace kbvh
