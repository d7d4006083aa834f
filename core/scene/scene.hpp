#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// The kind of a body's primitives; decides how a candidate pair is confirmed.
enum class PrimitiveKind : std::uint8_t {
  polygons,      ///< k >= 1 vertices, tested exactly as a fan of triangles
  points,        ///< 1 vertex each; pairs are answered at candidate level (their boxes)
  control_nets,  ///< k control points; conservative by the convex-hull property; candidate level
};

/// Returns the kind in words: polygons, points, control_nets.
const char* name(PrimitiveKind kind);

/// Primitives of one body as CSR lists: primitive p has vertices[offsets[p] .. offsets[p + 1]). A primitive
/// that was removed at run time (geometry_change.hpp) keeps its id and its list, but no hierarchy contains it
/// and no answer names it.
struct Primitives {
  PrimitiveKind kind = PrimitiveKind::polygons;
  std::vector<std::uint32_t> offsets{0};
  std::vector<std::uint32_t> vertices;
  std::vector<std::uint8_t> removed;  ///< 1 for each removed primitive; empty as long as there is none
  std::uint32_t removed_count = 0;

  /// Returns the number of ids, those of removed primitives included.
  std::uint32_t count() const { return std::uint32_t(offsets.size() - 1); }
  std::uint32_t live_count() const { return count() - removed_count; }
  bool alive(std::uint32_t p) const { return removed.empty() || removed[p] == 0; }
  std::span<const std::uint32_t> operator[](std::uint32_t p) const {
    return {vertices.data() + offsets[p], vertices.data() + offsets[p + 1]};
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

/// One body: fixed connectivity and the flight plans of its vertices.
template <class S>
struct Body {
  std::string name;
  Primitives primitives;
  FlightPlans<S> plans;
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
    for (const auto& body : bodies) total += body.plans.vertex_count();
    return total;
  }
};

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
/// does not exist, has no vertex, or a body pair is out of range. Flight plans check themselves.
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
  /// Returns false for a body that is known to rest unless its plans are changed.
  bool moving(std::uint32_t body) const { return scene_->bodies[body].plans.moving(); }

 private:
  const Scene<S>* scene_;
};

}  // namespace kbvh
