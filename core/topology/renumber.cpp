#include "core/topology/renumber.hpp"

#include <limits>
#include <utility>
#include <vector>

namespace kbvh {

namespace {

/// The new order of the vertices of a body, or of a vertex set: that in which they are met.
class VertexOrder {
 public:
  explicit VertexOrder(std::uint32_t vertices) : new_vertex_(vertices, none) {}
  /// Returns the new id of a vertex, which is the next one if it is met for the first time.
  std::uint32_t meet(std::uint32_t v) {
    if (new_vertex_[v] == none) {
      new_vertex_[v] = std::uint32_t(old_vertex_.size());
      old_vertex_.push_back(v);
    }
    return new_vertex_[v];
  }
  void meet_all() {
    for (std::uint32_t v = 0; v < new_vertex_.size(); ++v) meet(v);
  }
  const std::vector<std::uint32_t>& old_vertex() const { return old_vertex_; }

 private:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> new_vertex_, old_vertex_;
};

Primitives renumbered(const Primitives& primitives, const std::vector<std::uint32_t>& old_primitive,
                      VertexOrder& order) {
  Primitives result;
  result.kind = primitives.kind;
  std::vector<std::uint32_t> corners;
  for (const std::uint32_t p : old_primitive) {
    corners.clear();
    for (const std::uint32_t v : primitives[p]) corners.push_back(order.meet(v));
    result.add(corners);
    // Keeps the cut: a new one would break ties by the new ids.
    if (const PolygonCuts& cuts = primitives.cuts; cuts.contains(p)) {
      const PolygonTriangles triangles = primitives.triangles(p);
      corners.clear();
      for (std::uint32_t i = 0; i < triangles.count(); ++i)
        for (const std::uint32_t v : triangles[i]) corners.push_back(order.meet(v));
      result.cuts.add(result.count() - 1, corners, cuts.times[p]);
    }
  }
  return result;
}

template <class S>
FlightPlans<S> renumbered(const FlightPlans<S>& plans, const std::vector<std::uint32_t>& old_vertex) {
  const auto times = plans.keyframe_times();
  const auto reorder = [&](const S* values, std::vector<S>& into) {
    for (std::size_t i = 0; values != nullptr && i < old_vertex.size(); ++i) {
      const S* const of_vertex = values + std::size_t(3) * old_vertex[i];
      into.insert(into.end(), of_vertex, of_vertex + 3);
    }
  };
  std::vector<S> positions;
  positions.reserve(times.size() * 3 * old_vertex.size());
  for (std::size_t k = 0; k < times.size(); ++k) reorder(plans.keyframe(k), positions);
  std::vector<SegmentBends<S>> bends(plans.curved() ? times.size() - 1 : 0);
  for (std::size_t k = 0; k < bends.size(); ++k) {
    reorder(plans.bends(k), bends[k].bend);
    reorder(plans.twists(k), bends[k].twist);
  }
  return FlightPlans<S>(plans.vertex_count(), {times.begin(), times.end()}, std::move(positions),
                        std::move(bends));
}

}  // namespace

template <class S>
RenumberedScene<S> renumber_in_leaf_order(const Scene<S>& scene, const BuilderConfig& config) {
  RenumberedScene<S> result;
  result.scene.name = scene.name;
  result.scene.pairs = scene.pairs;
  const double start = overlaid_keyframes(scene).front();
  std::vector<VertexOrder> orders;  // [body]: that of the first body over its vertices counts
  for (const Body<S>& body : scene.bodies) orders.emplace_back(body.plans.vertex_count());
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b) {
    const Body<S>& body = scene.bodies[b];
    std::vector<S> positions(std::size_t(3) * body.plans.vertex_count());
    body.plans.evaluate(start, positions.data());
    const auto boxes = primitive_boxes(body.primitives, positions.data());
    result.old_primitive.push_back(build_topology<S>(boxes, config).primitives);
    Body<S>& made = result.scene.bodies.emplace_back();
    made.name = body.name;
    made.primitives = renumbered(body.primitives, result.old_primitive.back(), orders[scene.first_of_set(b)]);
    made.vertex_set = body.vertex_set;
  }
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b) {
    const std::uint32_t first = scene.first_of_set(b);
    if (first == b) orders[b].meet_all();
    result.old_vertex.push_back(orders[first].old_vertex());
    result.scene.bodies[b].plans = first == b ? renumbered(scene.bodies[b].plans, orders[b].old_vertex())
                                              : result.scene.bodies[first].plans;
  }
  return result;
}

template RenumberedScene<float> renumber_in_leaf_order(const Scene<float>&, const BuilderConfig&);
template RenumberedScene<double> renumber_in_leaf_order(const Scene<double>&, const BuilderConfig&);

}  // namespace kbvh
