#pragma once
#include "core/motion/algebraic_time.hpp"

namespace kbvh {

/// A vector that moves along polynomials of time, one for each axis: a linear motion, differences, and
/// products of two. P is Polynomial or LongPolynomial, whichever is long enough for the products.
template <class P>
struct MovingVector {
  P axis[3];

  friend MovingVector operator-(const MovingVector& a, const MovingVector& b) {
    return {{a.axis[0] - b.axis[0], a.axis[1] - b.axis[1], a.axis[2] - b.axis[2]}};
  }
  friend MovingVector cross(const MovingVector& a, const MovingVector& b) {
    MovingVector result;
    for (int k = 0; k < 3; ++k) {
      const int u = (k + 1) % 3, v = (k + 2) % 3;
      result.axis[k] = a.axis[u] * b.axis[v] - a.axis[v] * b.axis[u];
    }
    return result;
  }
  friend P dot(const MovingVector& a, const MovingVector& b) {
    return a.axis[0] * b.axis[0] + a.axis[1] * b.axis[1] + a.axis[2] * b.axis[2];
  }
};

}  // namespace kbvh
