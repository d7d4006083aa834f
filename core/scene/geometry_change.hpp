#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/playback.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// Vertices and primitives that are inserted and deleted at one time. Ids are stable: inserted items get the
/// next free ids of their body in the given order, and no id is ever reused. Vertices of bodies over one
/// vertex set are inserted and deleted once, under any of these bodies.
template <class S>
struct GeometryChange {
  struct NewVertex {
    std::uint32_t body = 0;
    S position[3] = {0, 0, 0};  ///< at the change
    PlanChange<S> plan{};       ///< its motion from the change on; body and vertex in it are ignored
  };
  struct NewPrimitive {
    std::uint32_t body = 0;
    std::vector<std::uint32_t> vertices;  ///< at least one; may name vertices inserted by the same change
  };
  struct Removed {
    std::uint32_t body = 0, id = 0;
  };
  std::vector<NewVertex> vertices{};
  std::vector<NewPrimitive> primitives{};
  std::vector<Removed> removed_primitives{};  ///< must be older than the change
  std::vector<Removed> removed_vertices{};    ///< no primitive may use them after the change

  bool empty() const {
    return vertices.empty() && primitives.empty() && removed_primitives.empty() && removed_vertices.empty();
  }
};

/// Returns the changes that each body sees: what is changed on a vertex set under one body is repeated, in
/// the same order, for all bodies over that set. Other changes, and those of bodies that do not exist, stay
/// as they are.
template <class S>
std::vector<PlanChange<S>> changes_of_bodies(const Scene<S>& scene, std::span<const PlanChange<S>> changes);
template <class S>
GeometryChange<S> changes_of_bodies(const Scene<S>& scene, const GeometryChange<S>& change);

/// A scene whose geometry changes at run time: a copy of the connectivity (keyframes are shared) with
/// insertions and deletions. Removed items keep their ids: primitives are marked, vertices rest on their
/// plans.
template <class S>
class ChangingScene {
 public:
  explicit ChangingScene(const Scene<S>& original) : scene_(original), bodies_(original.bodies.size()) {}

  const Scene<S>& scene() const { return scene_; }

  /// Applies the change to the scene and to the playback, at the playback's time; polygons are cut at their
  /// positions at that time. Throws std::invalid_argument that names the first error, and changes nothing:
  /// bodies, vertices or primitives that do not exist or were removed, primitives without vertices, removed
  /// vertices that a primitive uses, items removed twice, numbers that are not finite or not admissible,
  /// vertices added to a body whose vertices move on curves or whose positions are handed in: the caller's
  /// array has no place for them.
  /// Amortised O(change), but O(body) at the first removal of vertices of a body.
  void apply(const GeometryChange<S>& change, Playback<S>& playback);

  /// Throws std::invalid_argument if a plan is given to a removed vertex.
  void check_plans(std::span<const PlanChange<S>> changes) const;

 private:
  struct BodyState {
    std::vector<std::uint32_t>
        uses;  ///< number of living primitive corners at each vertex; computed when first needed
    std::vector<std::uint8_t> removed;  ///< per vertex; may be shorter than the number of vertices
    bool is_removed(std::uint32_t vertex) const { return vertex < removed.size() && removed[vertex] != 0; }
  };
  /// Takes changes_of_bodies.
  void check(const GeometryChange<S>& change, const Playback<S>& playback);
  void count_uses(std::uint32_t body);

  Scene<S> scene_;
  std::vector<BodyState> bodies_;
};

/// The effects of a change on one body, after the change is visible in the scene.
struct BodyChange {
  std::uint32_t body = 0;
  std::uint32_t first_vertex = 0, first_primitive = 0;  ///< ids from here on are new
  std::vector<std::uint32_t> removed_primitives{};
};

/// Returns one entry for each changed body, ascending. Takes `changes_of_bodies`.
template <class S>
std::vector<BodyChange> body_changes(const SceneView<S>& scene, const GeometryChange<S>& change);

extern template class ChangingScene<float>;
extern template class ChangingScene<double>;

}  // namespace kbvh
