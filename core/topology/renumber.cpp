#include "core/topology/renumber.hpp"

#include <limits>
#include <stdexcept>

namespace kbvh {

namespace {

template <class S>
Body<S> renumbered(const Body<S>& body, std::vector<std::uint32_t> old_primitive,
                   std::vector<std::uint32_t>& old_vertex) {
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  const std::uint32_t n = body.plans.vertex_count();
  std::vector<std::uint32_t> new_vertex(n, none);
  const auto meet = [&](std::uint32_t v) {
    if (new_vertex[v] != none) return;
    new_vertex[v] = std::uint32_t(old_vertex.size());
    old_vertex.push_back(v);
  };
  Body<S> result;
  result.name = body.name;
  result.primitives.kind = body.primitives.kind;
  std::vector<std::uint32_t> corners;
  for (std::uint32_t p : old_primitive) {
    corners.clear();
    for (std::uint32_t v : body.primitives[p]) {
      meet(v);
      corners.push_back(new_vertex[v]);
    }
    result.primitives.add(corners);
    // Keeps the cut: a new one would break ties by the new ids.
    if (const PolygonCuts& cuts = body.primitives.cuts; cuts.contains(p)) {
      const PolygonTriangles triangles = body.primitives.triangles(p);
      corners.clear();
      for (std::uint32_t i = 0; i < triangles.count(); ++i)
        for (const std::uint32_t v : triangles[i]) corners.push_back(new_vertex[v]);
      result.primitives.cuts.add(result.primitives.count() - 1, corners, cuts.times[p]);
    }
  }
  for (std::uint32_t v = 0; v < n; ++v) meet(v);
  const auto times = body.plans.keyframe_times();
  std::vector<S> positions;
  positions.reserve(times.size() * 3 * n);
  for (std::size_t k = 0; k < times.size(); ++k)
    for (std::uint32_t v : old_vertex)
      positions.insert(positions.end(), body.plans.keyframe(k) + std::size_t(3) * v,
                       body.plans.keyframe(k) + std::size_t(3) * v + 3);
  std::vector<SegmentBends<S>> bends(body.plans.curved() ? times.size() - 1 : 0);
  const auto reorder = [&](const S* values, std::vector<S>& into) {
    for (std::size_t i = 0; values != nullptr && i < old_vertex.size(); ++i) {
      const S* const of_vertex = values + std::size_t(3) * old_vertex[i];
      into.insert(into.end(), of_vertex, of_vertex + 3);
    }
  };
  for (std::size_t k = 0; k < bends.size(); ++k) {
    reorder(body.plans.bends(k), bends[k].bend);
    reorder(body.plans.twists(k), bends[k].twist);
  }
  result.plans = FlightPlans<S>(n, {times.begin(), times.end()}, std::move(positions), std::move(bends));
  return result;
}

}  // namespace

template <class S>
RenumberedScene<S> renumber_in_leaf_order(const Scene<S>& scene, const BuilderConfig& config) {
  RenumberedScene<S> result;
  result.scene.name = scene.name;
  result.scene.pairs = scene.pairs;
  const double start = overlaid_keyframes(scene).front();
  for (const Body<S>& body : scene.bodies) {
    if (body.vertex_set != own_vertices)
      throw std::invalid_argument("body '" + body.name +
                                  "' is not renumbered: it shares its vertices with other bodies");
    std::vector<S> positions(std::size_t(3) * body.plans.vertex_count());
    body.plans.evaluate(start, positions.data());
    const auto boxes = primitive_boxes(body.primitives, positions.data());
    result.old_primitive.push_back(build_topology<S>(boxes, config).primitives);
    result.old_vertex.emplace_back();
    result.scene.bodies.push_back(renumbered(body, result.old_primitive.back(), result.old_vertex.back()));
  }
  return result;
}

template RenumberedScene<float> renumber_in_leaf_order(const Scene<float>&, const BuilderConfig&);
template RenumberedScene<double> renumber_in_leaf_order(const Scene<double>&, const BuilderConfig&);

}  // namespace kbvh
