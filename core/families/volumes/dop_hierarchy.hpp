#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "core/families/volumes/kernels/dop.hpp"
#include "core/families/volumes/volume_hierarchy.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// The k-DOPs of one body's hierarchy. The sides of a node lie next to each other, so a refit and a
/// comparison process several sides at once. Works with any topology.
///
/// Rounding: n . p is summed in S, and the sides of leaves are moved outwards by a margin that covers all
/// roundings, including its own: 4 or 6 units of rounding (2^-23 in float, 2^-52 in double) of the body's
/// largest coordinate for directions of 2 or 3 terms. Sides along the axes are exact. The bounds are
/// therefore conservative, and looser than `Dop`'s by that margin.
template <class S, int K>
class DopHierarchy {
 public:
  using Scalar = S;
  using Volume = Dop<S, K>;
  /// The memory of searches; one serves all bodies.
  struct Scratch {
    std::vector<DopPair> stack = std::vector<DopPair>(1024), found = std::vector<DopPair>(4096);
    std::size_t bytes() const { return (stack.capacity() + found.capacity()) * sizeof(DopPair); }
  };

  DopHierarchy(Topology topology, const Primitives& primitives, Cover cover,
               KernelSet kernels = active_kernel_set());

  /// Takes a topology over primitives that must outlive this object; volumes are empty until the next refit.
  void assign(Topology topology, const Primitives& primitives);
  /// Computes all volumes from positions [vertex][3], readable up to one scalar past the end. O(nodes + leaf
  /// points).
  void refit(const S* positions);

  const Topology& topology() const { return topology_; }
  bool empty() const { return topology_.empty(); }
  Volume volume(std::uint32_t node) const;
  std::vector<Volume> volumes() const;
  std::size_t leaf_vertex_count() const { return points_.size(); }
  std::size_t bytes() const;

  /// Calls on_leaves(leaf a, leaf b) for each two leaves whose k-DOPs, and those of all nodes above them,
  /// overlap; within one body, for each two leaves once and for each leaf with itself. Counts the tests.
  /// Returns the number of pairs of nodes that the budget left undone.
  template <class OnLeaves>
  static std::size_t search(const DopHierarchy& a, const DopHierarchy& b, Scratch& scratch,
                            std::uint64_t& tests, const Budget& budget, OnLeaves&& on_leaves) {
    if (a.empty() || b.empty()) return 0;
    DopSearch<S> job{a.nodes_.data(),
                     b.nodes_.data(),
                     a.sides_.data(),
                     b.sides_.data(),
                     &a == &b,
                     scratch.stack.data(),
                     0,
                     scratch.stack.size(),
                     scratch.found.data(),
                     0,
                     scratch.found.size(),
                     tests + 1,
                     budget.box_tests};
    if (&a == &b || a.kernels_->overlap(K)(job.sides_a, job.sides_b)) job.stack[job.depth++] = {0, 0};
    while (job.depth > 0 && job.tests < job.most_tests) {
      if (job.depth + dop_search_step > scratch.stack.size()) {
        scratch.stack.resize(2 * scratch.stack.size());
        job.stack = scratch.stack.data();
        job.stack_room = scratch.stack.size();
      }
      a.kernels_->search(K)(job);
      tests = job.tests;  // `on_leaves` adds its own tests
      for (std::size_t i = 0; i < job.found_count; ++i) on_leaves(job.found[i].a, job.found[i].b);
      job.found_count = 0;
      job.tests = tests;
    }
    tests = job.tests;
    return job.depth;
  }

 private:
  static constexpr std::size_t padded = padded_sides(K), half = padded / 2;

  const DopKernels<S>* kernels_;
  Topology topology_;
  const Primitives* primitives_ = nullptr;
  Cover cover_;
  std::vector<DopNode> nodes_;
  std::uint32_t point_count_ = 0;      ///< one past the last point of a leaf
  std::vector<std::uint32_t> points_;  ///< of the leaves: vertices, or corners of boxes
  std::vector<S> sides_;               ///< [node][padded]
  std::vector<S> corners_;             ///< of the primitives' boxes, [primitive][8][3], if boxes are covered
};

extern template class DopHierarchy<float, 14>;
extern template class DopHierarchy<float, 18>;
extern template class DopHierarchy<float, 26>;
extern template class DopHierarchy<double, 14>;
extern template class DopHierarchy<double, 18>;
extern template class DopHierarchy<double, 26>;

}  // namespace kbvh
