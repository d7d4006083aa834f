#pragma once
#include <cstddef>
#include <vector>

#include "core/families/blend/kernels/blend_rows.hpp"

namespace kbvh {

/// The blend of one body at one time; keeps its memory from frame to frame.
template <class S>
struct BlendTerms {
  std::vector<BlendTerm<S>> terms;
  std::size_t stride = 0;
  S offset[6] = {}, rounding = 0;  ///< as in Blend

  Blend<S> view() const {
    Blend<S> blend{terms.data(), std::uint32_t(terms.size()), stride, {}, rounding};
    for (std::size_t side = 0; side < 6; ++side) blend.offset[side] = offset[side];
    return blend;
  }
};

/// The data about one body for the whole clip, from which its boxes at any time are blended.
template <class S>
class BlendSource {
 public:
  virtual ~BlendSource() = default;
  /// Describes the blend at time t, such that every box contains the positions of its vertices, truth B. The
  /// body must follow its keyframes. Allocates only if `out` has less memory than it needs.
  virtual void blend_at(double t, BlendTerms<S>& out) const = 0;
  virtual std::size_t bytes() const = 0;
};

}  // namespace kbvh
