#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/broad_phase/face_contours.hpp"
#include "core/broad_phase/kernels/element_boxes.hpp"
#include "core/broad_phase/kernels/element_pairs.hpp"
#include "core/broad_phase/kernels/group_traversal.hpp"
#include "core/broad_phase/pair_filter.hpp"
#include "core/families/build/curve_builders.hpp"

namespace kbvh {

/// The tree over all elements of one kind, whose boxes are made from those of the vertices: built along a
/// Morton curve, then refitted, whole or below the vertices that moved. Keeps its memory.
template <class S>
class ElementTree {
 public:
  /// Takes the elements, whose lists must outlive the tree. `leaf_size` is 5 to 16.
  void start(const Primitives& elements, std::uint32_t leaf_size, KernelSet kernels);

  /// What a search would find: nothing yet, boxes of another time, or current boxes.
  enum class State : std::uint8_t { unbuilt, outdated, current };
  State state() const { return state_; }
  /// Marks the boxes as those of another time.
  void outdate() {
    if (state_ == State::current) state_ = State::outdated;
  }
  /// Makes the tree current from the vertices' boxes [vertex][8]: builds it where there is none, or where the
  /// surface of a refitted one has grown beyond `most_growth` times what it was when built. O(elements).
  void refresh(const S* vertex_boxes, double most_growth);
  /// Forgets the shape of the tree, so that the next `refresh` builds another.
  void forget() { state_ = State::unbuilt; }
  /// Updates a current tree whose boxes of `moved` vertices changed: leaves of their elements, and the nodes
  /// above as far as boxes change. O(elements at the vertices x height). The first call makes lists of the
  /// elements at each vertex, O(corners). Once partial refits have recomputed as many nodes as the tree has,
  /// the surface is compared as in `refresh`; if it has grown too much, the tree counts as outdated, and the
  /// next `refresh` builds it again.
  void refit_moved(const S* vertex_boxes, std::uint32_t vertices, std::span<const std::uint32_t> moved,
                   double most_growth);

  /// Takes further elements, whose list has grown: the next `refresh` builds another tree.
  void elements_inserted();
  /// Takes further vertices: elements are still the same.
  void vertices_inserted() { first_of_vertex_.clear(); }
  /// Takes elements that have just been removed from their list out of their leaves. In a current tree, the
  /// boxes of these leaves and of the nodes above shrink; otherwise boxes stay as they are. O(elements x
  /// height).
  void elements_removed(const S* vertex_boxes, std::span<const std::uint32_t> ids);

  /// Returns what searches read; the tree must be current and not empty.
  ElementLeaves<S> leaves();
  /// Returns the groups of the elements, or-ed up the tree, which must be current and not empty; an empty
  /// list: all have the default. O(elements) after a build or `forget_groups`, else O(1).
  GroupArrays groups(std::span<const GroupMask> of_elements);
  void forget_groups() { groups_listed_ = false; }
  /// Returns the contours of the patches below the nodes of a tree over faces, which must be current and not
  /// empty. The first call after a build or a removal costs as much as a build, others O(1).
  const FaceContours& contours(std::uint32_t vertices);
  bool empty() const { return tree_.empty(); }
  std::uint32_t padded_leaf_size() const { return tree_.padded_leaf_size(); }
  Box<S> root_box() const { return tree_.root_box(); }

  /// Counts of work since `start`.
  struct Work {
    std::uint64_t builds = 0, refits = 0, partial_refits = 0;
    std::uint64_t leaves_remade = 0, nodes_remade = 0;  ///< by partial refits
  };
  const Work& work() const { return work_; }
  std::size_t bytes() const;

 private:
  /// Returns the job that makes all leaves' boxes.
  ElementLeafBoxesJob<S> leaf_job(const S* vertex_boxes);
  void build(const S* vertex_boxes);
  void list_corners();
  void list_incidence(std::uint32_t vertices);
  void list_places();
  std::span<const std::uint32_t> leaf_elements(std::uint32_t leaf) const {
    return {tree_.leaf_lists().primitives + tree_.leaf_lists().first_entry[leaf],
            tree_.leaf_lists().primitives + leaf_ends_[leaf]};
  }
  /// Computes marked leaves and the nodes above as far as boxes change.
  void remake_marked(const S* vertex_boxes);
  /// Computes the boxes of one leaf and its elements; returns whether the leaf's box changed.
  bool remake_leaf(ElementLeafBoxesJob<S>& job, std::uint32_t leaf);
  double surface();

  const Primitives* elements_ = nullptr;
  std::uint32_t corners_each_ = 1;
  KernelSet kernels_ = KernelSet::portable;
  State state_ = State::unbuilt;
  std::optional<PrimitiveList> list_;
  CurveOrder<S> order_;
  LinearBuilder<S> builder_;
  BuiltTree<S> tree_;
  UnfilledArray<std::uint32_t> leaf_corners_;  // [leaf][corner][padded]
  UnfilledArray<std::uint32_t> leaf_ends_;     // [leaf]: as in the tree, less what was removed since
  std::uint32_t built_count_ = 0;              // elements when built
  double surface_when_built_ = 0;
  std::uint64_t remade_since_measured_ = 0;  // nodes, by partial refits
  // For partial refits. Incidence is listed at the first one, places in the tree at the first one after a
  // build.
  std::vector<std::uint32_t> first_of_vertex_, elements_of_vertex_;
  std::vector<std::uint32_t> leaf_of_element_, node_of_leaf_, parents_;
  std::vector<std::uint64_t> dirty_leaves_, dirty_nodes_;
  bool places_listed_ = false;
  UnfilledArray<std::uint32_t> group_children_, group_nodes_;
  bool groups_listed_ = false;
  FaceContours contours_;
  bool contours_listed_ = false;
  Work work_;
};

extern template class ElementTree<float>;
extern template class ElementTree<double>;

}  // namespace kbvh
