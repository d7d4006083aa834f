#pragma once
#include "core/families/blend/blend_source.hpp"
#include "core/families/blend/field_rows.hpp"
#include "core/families/blend/reduced_model.hpp"

namespace kbvh {

/// The boxes of one body by its reduced model (James & Pai 2004, s.3, with boxes instead of spheres): each
/// node stores the ranges, below it, of the rest shape, of each mode's displacements, and of the remainder.
/// The box at any time is the sum of these ranges times the coordinates (interval arithmetic: lower and upper
/// sides change places where a coordinate is negative), translated. Memory: 6 scalars for each node and term;
/// it does not grow with the number of keyframes.
template <class S>
class ReducedBoxes : public BlendSource<S> {
 public:
  /// `tolerance` is a share of the median side of the leaves' boxes at the first keyframe
  /// (ReducedModel::Settings).
  /// `roundings`: 1, or less as a fault.
  ReducedBoxes(WideHierarchy<S>& hierarchy, const FlightPlans<S>& plans, std::uint32_t most_modes,
               double tolerance, S roundings = 1);

  /// The terms are the rest shape, the modes, and the remainder. O(modes).
  void blend_at(double t, BlendTerms<S>& out) const override;
  std::size_t bytes() const override;

  const ReducedModel<S>& model() const { return model_; }

 private:
  enum class EmptyLanes : std::uint8_t { zero, infinite };
  struct Sides {
    std::size_t begin, end;
  };
  void put(WideHierarchy<S>& hierarchy, std::size_t term, Sides sides, EmptyLanes empty);

  const FlightPlans<S>* plans_;
  S roundings_;
  FieldRows<S> rows_;  ///< for temporary use
  std::size_t scalars_;
  ReducedModel<S> model_;
  AlignedArray<S> ranges_;  ///< [node][term][6][width]
  mutable typename ReducedModel<S>::Coordinates now_;
};

extern template class ReducedBoxes<float>;
extern template class ReducedBoxes<double>;

}  // namespace kbvh
