#pragma once
#include <compare>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "core/geometry/ray_box.hpp"
#include "core/scene/rays.hpp"

namespace kbvh {

/// A closed ball. Sought are the primitives at a distance of at most `radius` from `centre`.
template <class S>
struct Ball {
  S centre[3];
  S radius;
};

/// A primitive within a ball, by the index of the ball in the call. Polygons are the closed triangles into
/// which they are cut, points are points; control nets are not met. The distance is compared exactly: squared
/// against the squared radius, in real arithmetic on the stored numbers.
struct BallHit {
  std::uint32_t ball, body, primitive;
  auto operator<=>(const BallHit&) const = default;
};
using BallHits = std::vector<BallHit>;

/// Tests a ball against closed boxes, conservatively: never misses a box that the ball meets.
class BallBox {
 public:
  BallBox(const double* centre, double radius);
  /// Tests whether the ball may meet the box; has the form of RaySlabs::meet, and every box is near.
  template <class S>
  bool meet(const Box<S>& box, double /*limit*/, double& near) const {
    near = 0;
    for (int axis = 0; axis < 3; ++axis)
      if (!(double(box.lower[axis]) <= upper_[axis] && double(box.upper[axis]) >= lower_[axis])) return false;
    return true;
  }

 private:
  double lower_[3], upper_[3];
};

/// The search for the primitives within one ball: compares its candidates exactly, and appends those that are
/// met.
template <class S>
class BallSearch {
 public:
  BallSearch(const Ball<S>& ball, std::uint32_t index, BallHits& found);

  /// Tests a primitive; `positions` are those of its body. Returns false: the search never ends early.
  bool offer(std::uint32_t body, std::uint32_t primitive, const PolygonTriangles& polygon, const S* positions,
             TriangleTestStats& stats);

  BallBox box_test() const { return {centre_, radius_}; }
  double limit() const { return 0; }

 private:
  /// Returns whether a triangle is certainly farther than the radius along an axis.
  bool apart(const double* corners) const;

  double centre_[3], radius_;
  std::uint32_t index_;
  BallHits* found_;
};

extern template class BallSearch<float>;
extern template class BallSearch<double>;

// What is asked of all primitives of a scene from outside it. Each kind of probe is a value that says what is
// sought and where the answers go, and makes the search of each of its items. A search has box_test(), whose
// meet(box, limit, near) is conservative, limit(), and offer(). Traversals are templates over the kind, and
// strategies pass the value on, so a further kind is added here, to `Probes`, and to the oracle.

/// Rays: hits[i] becomes the answer to rays[i].
template <class S>
struct RayProbes {
  RayQuery query = RayQuery::closest;
  std::span<const Ray<S>> rays{};
  std::span<RayHit> hits{};

  std::size_t size() const { return rays.size(); }
  RaySearch<S> search(std::size_t i) const { return {rays[i], query}; }
  void take(std::size_t i, const RaySearch<S>& search) const { hits[i] = search.hit(); }
  static bool meets(PrimitiveKind kind) { return kind == PrimitiveKind::polygons; }
};

/// Balls: what they meet is appended to `found`, each pair of a ball and a primitive once, in any order.
template <class S>
struct BallProbes {
  std::span<const Ball<S>> balls{};
  BallHits* found = nullptr;

  std::size_t size() const { return balls.size(); }
  BallSearch<S> search(std::size_t i) const { return {balls[i], std::uint32_t(i), *found}; }
  void take(std::size_t, const BallSearch<S>&) const {}
  static bool meets(PrimitiveKind kind) { return kind != PrimitiveKind::control_nets; }
};

template <class S>
using Probes = std::variant<RayProbes<S>, BallProbes<S>>;

/// Throws std::invalid_argument, naming the first item with a coordinate, direction or radius that is not
/// finite or beyond admissible_magnitude<S>, or with a length or radius that is negative or not a number; and
/// if there is no place for the answers.
template <class S>
void check_probes(const Probes<S>& probes);

}  // namespace kbvh
