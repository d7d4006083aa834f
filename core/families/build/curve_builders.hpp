#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/build/built_tree.hpp"
#include "core/families/build/curve_order.hpp"

namespace kbvh {

/// A range of primitives in the order of a curve.
struct KeyRange {
  std::uint32_t begin, end;
};

/// Linear bounding volume hierarchy (Lauterbach et al. 2009): a range of primitives along the Morton curve is
/// split at the highest bit in which its codes differ, so that each part fills a cell of a grid. A range of
/// one code gets a grid of its own. A range that fits into the leaves of one node is cut evenly: cells would
/// leave these leaves half empty, which costs building time and gains no query time.
template <class S>
class LinearBuilder {
 public:
  /// Builds a tree over the boxes that `order` has taken: the same on any number of threads.
  void build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  /// Does the same on one thread.
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
    Workers alone;
    build(alone, tree, order, list);
  }
  std::size_t bytes() const { return room_.bytes(); }

 private:
  LayOutRoom<KeyRange> room_;
};

/// A tree whose shape depends on the number of primitives only (implicit, as in Chitalu et al. 2020): the
/// primitives along a curve are cut into leaves of equal size, and eight neighbours make a node. The shape
/// is laid out once; a build writes entries and boxes.
template <class S>
class ImplicitBuilder {
 public:
  explicit ImplicitBuilder(Curve curve) : curve_(curve) {}
  /// Builds a tree over the boxes that `order` has taken: the same on any number of threads.
  void build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  /// Does the same on one thread.
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
    Workers alone;
    build(alone, tree, order, list);
  }
  static std::size_t bytes() { return 0; }

 private:
  Curve curve_;
};

extern template class LinearBuilder<float>;
extern template class LinearBuilder<double>;
extern template class ImplicitBuilder<float>;
extern template class ImplicitBuilder<double>;

}  // namespace kbvh
