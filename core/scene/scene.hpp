#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/assert.hpp"
#include "core/geometry/box.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// The kind of a body's primitives; decides how a candidate pair is confirmed.
enum class PrimitiveKind : std::uint8_t {
  polygons,      ///< k >= 1 vertices, tested exactly as the triangles into which each one is cut once
  points,        ///< 1 vertex each; pairs are answered at candidate level (their boxes)
  control_nets,  ///< k control points; conservative by the convex-hull property; candidate level
};

/// Returns the kind in words: polygons, points, control_nets.
const char* name(PrimitiveKind kind);

/// A polygon as the triangles whose union it is. Polygons of up to three corners are one triangle; fewer than
/// three make it a segment or a point. Larger ones have been cut (cut_polygons.hpp).
class PolygonTriangles {
 public:
  /// Takes a polygon of at most three corners.
  explicit PolygonTriangles(std::span<const std::uint32_t> corners)
      : corners_(corners.data()), last_(std::uint32_t(corners.size()) - 1), count_(1) {
    KBVH_ASSERT(!corners.empty() && corners.size() <= 3);
  }
  /// Takes the triangles [count][3] into which a polygon was cut.
  PolygonTriangles(const std::uint32_t* triangles, std::uint32_t count)
      : corners_(triangles), last_(2), count_(count) {}

  std::uint32_t count() const { return count_; }
  /// Returns the vertices of triangle i.
  std::array<std::uint32_t, 3> operator[](std::uint32_t i) const {
    const std::uint32_t* const corners = corners_ + std::size_t(3) * i;
    return {corners[0], corners[std::min(1U, last_)], corners[last_]};
  }
  /// Returns the first triangle alone.
  PolygonTriangles first() const { return {corners_, last_, 1}; }

 private:
  PolygonTriangles(const std::uint32_t* corners, std::uint32_t last, std::uint32_t count)
      : corners_(corners), last_(last), count_(count) {}
  const std::uint32_t* corners_;
  std::uint32_t last_, count_;
};

/// The triangles of a body's polygons of more than three corners, each cut once.
struct PolygonCuts {
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> first;    ///< [primitive], of its triangles; none: not cut. May be shorter
  std::vector<double> times;           ///< [primitive], of the positions by which it was cut
  std::vector<std::uint32_t> corners;  ///< [triangle][3], vertex ids

  bool contains(std::uint32_t p) const { return p < first.size() && first[p] != none; }
  void add(std::uint32_t p, std::span<const std::uint32_t> triangles, double time) {
    first.resize(std::max<std::size_t>(first.size(), p + 1), none);
    times.resize(first.size());
    first[p] = std::uint32_t(corners.size() / 3);
    times[p] = time;
    corners.insert(corners.end(), triangles.begin(), triangles.end());
  }
};

/// Primitives of one body as CSR lists: primitive p has vertices[offsets[p] .. offsets[p + 1]). A primitive
/// that was removed at run time (geometry_change.hpp) keeps its id and its list, but no hierarchy contains it
/// and no answer names it. A scene is played after `cut_polygons` (cut_polygons.hpp).
struct Primitives {
  PrimitiveKind kind = PrimitiveKind::polygons;
  std::vector<std::uint32_t> offsets{0};
  std::vector<std::uint32_t> vertices;
  std::vector<std::uint8_t> removed;  ///< 1 for each removed primitive; empty as long as there is none
  std::uint32_t removed_count = 0;
  PolygonCuts cuts;

  /// Returns the number of ids, including those of removed primitives.
  std::uint32_t count() const { return std::uint32_t(offsets.size() - 1); }
  std::uint32_t live_count() const { return count() - removed_count; }
  bool alive(std::uint32_t p) const { return removed.empty() || removed[p] == 0; }
  std::span<const std::uint32_t> operator[](std::uint32_t p) const {
    return {vertices.data() + offsets[p], vertices.data() + offsets[p + 1]};
  }
  /// Returns the triangles of a polygon. More than three corners must have been cut.
  PolygonTriangles triangles(std::uint32_t p) const {
    const std::uint32_t corners = offsets[p + 1] - offsets[p];
    if (corners <= 3) return PolygonTriangles((*this)[p]);
    KBVH_ASSERT(cuts.contains(p));
    return {cuts.corners.data() + std::size_t(3) * cuts.first[p], corners - 2};
  }
  void add(std::span<const std::uint32_t> primitive) {
    vertices.insert(vertices.end(), primitive.begin(), primitive.end());
    offsets.push_back(std::uint32_t(vertices.size()));
    if (!removed.empty()) removed.push_back(0);
  }
  /// Removes a living primitive from the body; its id is never reused.
  void remove(std::uint32_t p) {
    removed.resize(count(), 0);
    removed[p] = 1;
    ++removed_count;
  }
};

/// The vertex set of a body that shares no vertices.
inline constexpr std::uint32_t own_vertices = std::numeric_limits<std::uint32_t>::max();

/// One body: fixed connectivity and the flight plans of its vertices.
template <class S>
struct Body {
  std::string name;
  Primitives primitives;
  FlightPlans<S> plans;
  /// The vertex set that the body names, by any number. Bodies that name one set consist of the same
  /// vertices, as the vertices, edges and faces of a mesh do: ids, plans and positions are those of the set,
  /// and `plans` are copies of one object, which share its keyframes (`add_body_over`). Changes of plans and
  /// vertices at run time are made once, for any body of the set, and reach all of them. Primitives with a
  /// common vertex are no pair, in one body or in two.
  std::uint32_t vertex_set = own_vertices;
};

/// Two bodies that are tested against each other, first < second; or one body twice: pairs within the body.
struct BodyPair {
  std::uint32_t first, second;
};

/// All bodies of one experiment in one scalar.
template <class S>
struct Scene {
  std::string name;
  std::vector<Body<S>> bodies;
  std::vector<BodyPair> pairs;  ///< body pairs a query answers; `all_pairs` by default

  std::uint64_t primitive_count() const {
    std::uint64_t total = 0;
    for (const auto& body : bodies) total += body.primitives.count();
    return total;
  }
  std::uint64_t vertex_count() const {
    std::uint64_t total = 0;
    for (std::uint32_t body = 0; body < bodies.size(); ++body)
      if (first_of_set(body) == body) total += bodies[body].plans.vertex_count();
    return total;
  }
  /// Returns whether two bodies consist of the same vertices: one body, or two that name one vertex set.
  bool same_vertices(std::uint32_t a, std::uint32_t b) const {
    return a == b || (bodies[a].vertex_set != own_vertices && bodies[a].vertex_set == bodies[b].vertex_set);
  }
  /// Returns the first body that consists of the vertices of this one.
  std::uint32_t first_of_set(std::uint32_t body) const {
    if (bodies[body].vertex_set == own_vertices) return body;
    std::uint32_t first = 0;
    while (!same_vertices(first, body)) ++first;
    return first;
  }
  /// Returns whether some body names a vertex set.
  bool has_vertex_sets() const {
    return std::any_of(bodies.begin(), bodies.end(),
                       [](const Body<S>& body) { return body.vertex_set != own_vertices; });
  }
};

/// Adds a body over the vertices of another body; both then name one vertex set. Returns its id. `body` must
/// exist.
template <class S>
std::uint32_t add_body_over(Scene<S>& scene, std::uint32_t body, std::string name, Primitives primitives) {
  std::uint32_t& set = scene.bodies[body].vertex_set;
  if (set == own_vertices) {
    std::uint32_t unused = 0;  // bodies may name sets by any number, the largest one included
    while (std::any_of(scene.bodies.begin(), scene.bodies.end(),
                       [unused](const Body<S>& other) { return other.vertex_set == unused; }))
      ++unused;
    set = unused;
  }
  scene.bodies.push_back(
      {std::move(name), std::move(primitives), scene.bodies[body].plans, scene.bodies[body].vertex_set});
  return std::uint32_t(scene.bodies.size() - 1);
}

/// Returns every unordered pair of different bodies with at least one moving body.
template <class S>
std::vector<BodyPair> all_pairs(const std::vector<Body<S>>& bodies) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t a = 0; a < bodies.size(); ++a)
    for (std::uint32_t b = a + 1; b < bodies.size(); ++b)
      if (bodies[a].plans.moving() || bodies[b].plans.moving()) pairs.push_back({a, b});
  if (pairs.empty())
    for (std::uint32_t a = 0; a < bodies.size(); ++a)
      for (std::uint32_t b = a + 1; b < bodies.size(); ++b) pairs.push_back({a, b});
  return pairs;
}

/// Throws std::invalid_argument, naming body, primitive and value, if a primitive refers to a vertex that
/// does not exist, has no vertex, a body pair is out of range, or the plans of two bodies over one vertex set
/// are not copies of one object. Flight plans check themselves.
template <class S>
void validate(const Scene<S>& scene);

/// Computes a 64-bit hash of everything that affects results: connectivity, keyframes, scalar, pairs; not
/// names.
template <class S>
std::uint64_t hash(const Scene<S>& scene);

/// Computes the times of a clip with `per_keyframe` (l >= 1) frames per segment of the overlaid keyframe
/// times of all bodies: t = T_i + (T_{i+1} - T_i) * j / l for j = 0..l-1, and the last keyframe. A scene
/// without motion has one time. Computes only the first `most` times.
template <class S>
std::vector<double> frame_times(const Scene<S>& scene, std::uint32_t per_keyframe,
                                std::size_t most = std::numeric_limits<std::size_t>::max());

/// Returns the overlaid keyframe times of all bodies, strictly increasing.
template <class S>
std::vector<double> overlaid_keyframes(const Scene<S>& scene);

/// The connectivity of a scene without its motion, which every strategy may know.
template <class S>
class SceneView {
 public:
  explicit SceneView(const Scene<S>& scene) : scene_(&scene) {}
  std::uint32_t body_count() const { return std::uint32_t(scene_->bodies.size()); }
  const Primitives& primitives(std::uint32_t body) const { return scene_->bodies[body].primitives; }
  std::uint32_t vertex_count(std::uint32_t body) const { return scene_->bodies[body].plans.vertex_count(); }
  std::span<const BodyPair> pairs() const { return scene_->pairs; }
  /// Returns whether two bodies consist of the same vertices (Scene::same_vertices).
  bool same_vertices(std::uint32_t a, std::uint32_t b) const { return scene_->same_vertices(a, b); }
  /// Returns false for a body that is known to rest unless its plans are changed.
  bool moving(std::uint32_t body) const { return scene_->bodies[body].plans.moving(); }

 private:
  const Scene<S>* scene_;
};

}  // namespace kbvh
