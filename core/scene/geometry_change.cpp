#include "core/scene/geometry_change.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>

#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"

namespace kbvh {

namespace {
[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument("geometry change: " + what);
}
std::string text(const char* what, std::uint32_t id, std::uint32_t body) {
  return std::string(what) + " " + std::to_string(id) + " of body " + std::to_string(body);
}

/// Appends an item for each body over the vertex set of its body.
template <class S, class Item>
void repeat_for_bodies(const Scene<S>& scene, const Item& item, std::vector<Item>& out) {
  if (item.body >= scene.bodies.size() || scene.bodies[item.body].vertex_set == own_vertices) {
    out.push_back(item);
    return;
  }
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
    if (!scene.same_vertices(item.body, body)) continue;
    out.push_back(item);
    out.back().body = body;
  }
}
}  // namespace

template <class S>
std::vector<PlanChange<S>> changes_of_bodies(const Scene<S>& scene, std::span<const PlanChange<S>> changes) {
  std::vector<PlanChange<S>> all;
  for (const PlanChange<S>& change : changes) repeat_for_bodies(scene, change, all);
  return all;
}

template <class S>
GeometryChange<S> changes_of_bodies(const Scene<S>& scene, const GeometryChange<S>& change) {
  GeometryChange<S> all;
  all.primitives = change.primitives;
  all.removed_primitives = change.removed_primitives;
  for (const auto& vertex : change.vertices) repeat_for_bodies(scene, vertex, all.vertices);
  for (const auto& removed : change.removed_vertices) repeat_for_bodies(scene, removed, all.removed_vertices);
  return all;
}

template <class S>
void ChangingScene<S>::count_uses(std::uint32_t body) {
  const Primitives& primitives = scene_.bodies[body].primitives;
  std::vector<std::uint32_t>& uses = bodies_[body].uses;
  if (!uses.empty()) return;
  uses.assign(scene_.bodies[body].plans.vertex_count(), 0);
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.alive(p))
      for (std::uint32_t v : primitives[p]) ++uses[v];
}

template <class S>
void ChangingScene<S>::check(const GeometryChange<S>& change, const Playback<S>& playback) {
  const auto body_count = std::uint32_t(scene_.bodies.size());
  const auto known_body = [&](std::uint32_t body) {
    if (body >= body_count)
      refuse("body " + std::to_string(body) + " of " + std::to_string(body_count) + " does not exist");
  };
  std::vector<std::uint32_t> vertex_counts(body_count);
  for (std::uint32_t body = 0; body < body_count; ++body)
    vertex_counts[body] = scene_.bodies[body].plans.vertex_count();
  for (const auto& vertex : change.vertices) {
    known_body(vertex.body);
    if (scene_.bodies[vertex.body].plans.curved())
      refuse("a vertex is added to body " + std::to_string(vertex.body) + ", whose vertices move on curves");
    if (scene_.bodies[vertex.body].plans.is_handed_in())
      refuse("a vertex is added to body " + std::to_string(vertex.body) + ", whose positions are handed in");
    FlightPlans<S>::check_new_vertex(playback.time(), vertex.plan, vertex.position,
                                     vertex_counts[vertex.body]++);
  }

  using Item = std::pair<std::uint32_t, std::uint32_t>;  // body, id
  const auto sorted_once = [](const auto& removed, const char* what) {
    std::vector<Item> items;
    for (const auto& item : removed) items.emplace_back(item.body, item.id);
    std::sort(items.begin(), items.end());
    const auto twice = std::adjacent_find(items.begin(), items.end());
    if (twice != items.end()) refuse(text(what, twice->second, twice->first) + " is removed twice");
    return items;
  };
  for (const auto& removed : change.removed_primitives) {
    known_body(removed.body);
    const Primitives& primitives = scene_.bodies[removed.body].primitives;
    if (removed.id >= primitives.count())
      refuse(text("primitive", removed.id, removed.body) + " does not exist");
    if (!primitives.alive(removed.id))
      refuse(text("primitive", removed.id, removed.body) + " was removed before");
  }
  sorted_once(change.removed_primitives, "primitive");
  for (const auto& removed : change.removed_vertices) {
    known_body(removed.body);
    if (removed.id >= scene_.bodies[removed.body].plans.vertex_count())
      refuse(text("vertex", removed.id, removed.body) + " does not exist");
    if (bodies_[removed.body].is_removed(removed.id))
      refuse(text("vertex", removed.id, removed.body) + " was removed before");
  }
  const std::vector<Item> removed_vertices = sorted_once(change.removed_vertices, "vertex");
  for (const auto& primitive : change.primitives) {
    known_body(primitive.body);
    const std::string name = "a new primitive of body " + std::to_string(primitive.body);
    if (primitive.vertices.empty()) refuse(name + " has no vertex");
    if (primitive.vertices.size() > most_corners)
      refuse(name + " has " + std::to_string(primitive.vertices.size()) + " corners; at most " +
             std::to_string(most_corners) + " are possible");
    for (std::uint32_t v : primitive.vertices) {
      if (v >= vertex_counts[primitive.body])
        refuse(name + " refers to vertex " + std::to_string(v) + ", but there are " +
               std::to_string(vertex_counts[primitive.body]));
      if (bodies_[primitive.body].is_removed(v) ||
          std::binary_search(removed_vertices.begin(), removed_vertices.end(), Item{primitive.body, v}))
        refuse(name + " refers to vertex " + std::to_string(v) + ", which is removed");
    }
  }
  if (removed_vertices.empty()) return;
  std::vector<Item> freed;  // corners of primitives removed by the same change
  for (const auto& removed : change.removed_primitives)
    for (std::uint32_t v : scene_.bodies[removed.body].primitives[removed.id])
      freed.emplace_back(removed.body, v);
  std::sort(freed.begin(), freed.end());
  for (const Item& item : removed_vertices) {
    count_uses(item.first);
    const auto range = std::equal_range(freed.begin(), freed.end(), item);
    const auto left = bodies_[item.first].uses[item.second] - std::uint32_t(range.second - range.first);
    if (left != 0)
      refuse(text("vertex", item.second, item.first) + " is still used by " + std::to_string(left) +
             " corners of primitives");
  }
}

template <class S>
void ChangingScene<S>::apply(const GeometryChange<S>& given, Playback<S>& playback) {
  std::optional<GeometryChange<S>> repeated;
  if (scene_.has_vertex_sets()) repeated = changes_of_bodies(scene_, given);
  const GeometryChange<S>& change = repeated ? *repeated : given;
  check(change, playback);
  for (const auto& removed : change.removed_primitives) {
    Primitives& primitives = scene_.bodies[removed.body].primitives;
    primitives.remove(removed.id);
    auto& uses = bodies_[removed.body].uses;
    if (!uses.empty())
      for (std::uint32_t v : primitives[removed.id]) --uses[v];
  }
  for (const auto& removed : change.removed_vertices) {
    auto& marks = bodies_[removed.body].removed;
    marks.resize(scene_.bodies[removed.body].plans.vertex_count(), 0);
    marks[removed.id] = 1;
  }
  for (const auto& vertex : change.vertices) {
    scene_.bodies[vertex.body].plans.add_vertex(playback.time(), vertex.plan, vertex.position);
    auto& uses = bodies_[vertex.body].uses;
    if (!uses.empty()) uses.push_back(0);
  }
  for (const auto& vertex : given.vertices) playback.add_vertex(vertex.body, vertex.plan, vertex.position);
  for (const auto& primitive : change.primitives) {
    Primitives& primitives = scene_.bodies[primitive.body].primitives;
    primitives.add(primitive.vertices);
    if (primitives.kind == PrimitiveKind::polygons && primitive.vertices.size() > 3) {
      playback.fetch(primitive.body, primitive.vertices);
      cut_polygon(primitives, primitives.count() - 1, playback.positions(primitive.body), playback.time());
    }
    auto& uses = bodies_[primitive.body].uses;
    if (!uses.empty())
      for (std::uint32_t v : primitive.vertices) ++uses[v];
  }
}

template <class S>
void ChangingScene<S>::check_plans(std::span<const PlanChange<S>> changes) const {
  for (const PlanChange<S>& change : changes)
    if (change.body < bodies_.size() && bodies_[change.body].is_removed(change.vertex))
      throw std::invalid_argument("plan change for " + text("vertex", change.vertex, change.body) +
                                  ", which was removed");
}

template <class S>
std::vector<BodyChange> body_changes(const SceneView<S>& scene, const GeometryChange<S>& change) {
  std::vector<BodyChange> result;
  for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
    const auto in_body = [body](const auto& item) { return item.body == body; };
    const auto count = [&](const auto& list) {
      return std::uint32_t(std::count_if(list.begin(), list.end(), in_body));
    };
    BodyChange body_change;
    body_change.body = body;
    body_change.first_vertex = scene.vertex_count(body) - count(change.vertices);
    body_change.first_primitive = scene.primitives(body).count() - count(change.primitives);
    for (const auto& removed : change.removed_primitives)
      if (in_body(removed)) body_change.removed_primitives.push_back(removed.id);
    if (body_change.first_vertex != scene.vertex_count(body) ||
        body_change.first_primitive != scene.primitives(body).count() ||
        !body_change.removed_primitives.empty())
      result.push_back(std::move(body_change));
  }
  return result;
}

template class ChangingScene<float>;
template class ChangingScene<double>;
#define KBVH_INSTANTIATE(S)                                                                               \
  template std::vector<BodyChange> body_changes(const SceneView<S>&, const GeometryChange<S>&);           \
  template std::vector<PlanChange<S>> changes_of_bodies(const Scene<S>&, std::span<const PlanChange<S>>); \
  template GeometryChange<S> changes_of_bodies(const Scene<S>&, const GeometryChange<S>&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
