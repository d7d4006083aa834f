#include "core/families/blend/reduced_boxes.hpp"

#include <cmath>
#include <limits>

#include "core/base/median.hpp"

namespace kbvh {
namespace {

/// Returns the median side of the boxes of leaves.
template <class S>
double leaf_side(WideHierarchy<S>& hierarchy, const FieldRows<S>& rows) {
  const std::size_t width = hierarchy.width();
  const WideNode* const nodes = hierarchy.arrays().nodes;
  std::vector<double> sides;
  for (std::size_t node = 0; node < hierarchy.node_count(); ++node)
    for (std::size_t lane = 0; lane < nodes[node].leaf_count; ++lane) {
      double side = 0;
      for (std::size_t row = 0; row < 6; ++row)  // rows are lower and -upper
        side -= double(rows.child_bounds[(node * 6 + row) * width + lane]) / 3;
      sides.push_back(side);
    }
  return median(sides);
}

template <class S>
FieldRows<S> rows_of(const WideHierarchy<S>& hierarchy, const S* field) {
  FieldRows<S> rows;
  rows.fit(hierarchy, field);
  return rows;
}

}  // namespace

template <class S>
ReducedBoxes<S>::ReducedBoxes(WideHierarchy<S>& hierarchy, const FlightPlans<S>& plans,
                              std::uint32_t most_modes, double tolerance, S roundings)
    : plans_(&plans),
      roundings_(roundings),
      rows_(rows_of(hierarchy, plans.keyframe(0))),
      scalars_(lane_scalars(hierarchy.width())),
      model_(plans, {most_modes, tolerance * leaf_side(hierarchy, rows_)}) {
  const std::size_t terms = model_.mode_count + 2;
  ranges_.assign(hierarchy.node_count() * terms * scalars_, 0);
  rows_.fit(hierarchy, model_.rest.data());
  put(hierarchy, 0, {0, 6}, EmptyLanes::infinite);
  for (std::size_t m = 0; m < model_.mode_count; ++m) {
    rows_.fit(hierarchy, model_.shapes[m].data());
    put(hierarchy, 1 + m, {0, 6}, EmptyLanes::zero);
  }
  rows_.fit(hierarchy, model_.low.data());
  put(hierarchy, terms - 1, {0, 3}, EmptyLanes::zero);
  rows_.fit(hierarchy, model_.high.data());
  put(hierarchy, terms - 1, {3, 6}, EmptyLanes::zero);
  rows_ = {};
  model_.forget_fields();
  now_.modes.resize(model_.mode_count);
}

/// Copies the sides of all nodes to their places among the ranges of one term. Moves them outwards by a share
/// of themselves that covers the roundings of the term, whatever its weight. In epsilons of the scalar: half
/// for the weight and half for the product; half for each sum; half for each sum in the measured remainder,
/// and for storing it; and the rest for moving the side.
template <class S>
void ReducedBoxes<S>::put(WideHierarchy<S>& hierarchy, std::size_t term, Sides sides, EmptyLanes empty) {
  const std::size_t width = hierarchy.width(), terms = model_.mode_count + 2;
  const WideNode* const nodes = hierarchy.arrays().nodes;
  const S share = roundings_ * S(terms + 8) * std::numeric_limits<S>::epsilon(),
          least = 16 * std::numeric_limits<S>::min();
  const auto outwards = [&](S side) {
    return std::isinf(side) ? side : side - (share * std::abs(side) + least);
  };
  for (std::size_t node = 0; node < hierarchy.node_count(); ++node) {
    S* const to = &ranges_[(node * terms + term) * scalars_];
    for (std::size_t i = sides.begin * width; i < sides.end * width; ++i)
      to[i] = i % width < nodes[node].count || empty == EmptyLanes::infinite
                  ? outwards(rows_.child_bounds[node * scalars_ + i])
                  : S(0);
  }
}

template <class S>
void ReducedBoxes<S>::blend_at(double t, BlendTerms<S>& out) const {
  model_.at(*plans_, t, now_);
  const std::size_t terms = model_.mode_count + 2;
  out.stride = terms * scalars_;
  out.terms.resize(terms);
  out.terms[0] = {ranges_.data(), 1, 0};
  for (std::size_t m = 0; m < model_.mode_count; ++m)
    out.terms[1 + m] = {ranges_.data() + (1 + m) * scalars_, S(std::abs(now_.modes[m])),
                        now_.modes[m] < 0 ? 1U : 0U};
  out.terms[terms - 1] = {ranges_.data() + (terms - 1) * scalars_, S(now_.remainder), 0};
  // The terms are moved outwards by their own roundings. The offset covers the rest: half a unit for the
  // offset, half a unit of double for the translation, and the errors in double of steps, of other
  // coordinates and of the measured remainder. The last sum is rounded like the frame's position,
  // monotonically.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double margin =
        0.625 * (double(std::numeric_limits<S>::epsilon()) + 0x1p-52) * now_.translated[axis] +
        double(terms + 8) * 0x1p-52 * now_.displaced +
        64 * double(terms) * double(std::numeric_limits<S>::min());
    out.offset[axis] = S(now_.translation[axis] - margin);
    out.offset[3 + axis] = S(-now_.translation[axis] - margin);
  }
}

template <class S>
std::size_t ReducedBoxes<S>::bytes() const {
  return ranges_.capacity() * sizeof(S) + model_.bytes() + now_.modes.capacity() * sizeof(double);
}

template class ReducedBoxes<float>;
template class ReducedBoxes<double>;

}  // namespace kbvh
