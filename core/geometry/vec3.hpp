#pragma once
#include <Eigen/Core>

namespace kbvh {

/// A point or vector in space; 3 coordinates of scalar S (float or double), in the scene's length unit.
template <class S>
using Vec3 = Eigen::Matrix<S, 3, 1>;

}  // namespace kbvh
