#pragma once
#include "core/strategy.hpp"

namespace kbvh {

/// One body's hierarchy with stored boxes, and the unique vertices of its leaves.
template <class S>
struct StoredHierarchy {
  Topology topology;
  LeafVertices leaf_vertices;
  std::vector<Box<S>> boxes;

  void assign(Topology new_topology, const Primitives& primitives) {
    topology = std::move(new_topology);
    leaf_vertices = unique_leaf_vertices(topology, primitives);
    boxes.assign(topology.size(), Box<S>{});
  }
  std::size_t bytes() const {
    return topology.bytes() + boxes.size() * sizeof(Box<S>) +
           (leaf_vertices.offsets.size() + leaf_vertices.vertices.size()) * sizeof(std::uint32_t);
  }
};

/// Box of a leaf from its unique vertices; 4 lanes, of which the last is padding.
template <class S>
inline Box<S> leaf_box(std::span<const std::uint32_t> vertices, const S* positions) {
  using Lanes = Eigen::Array<S, 4, 1>;
  const S* first = positions + std::size_t(3) * vertices[0];
  Lanes lower = Eigen::Map<const Lanes>(first), upper = lower;
  for (std::size_t i = 1; i < vertices.size(); ++i) {
    const Lanes p = Eigen::Map<const Lanes>(positions + std::size_t(3) * vertices[i]);
    lower = lower.min(p);
    upper = upper.max(p);
  }
  Box<S> box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = lower[axis];
    box.upper[axis] = upper[axis];
  }
  return box;
}

/// Recomputes every box, children before parents (refit): one reverse sweep. O(nodes + vertices of leaves).
template <class S>
void refit_bottom_up(StoredHierarchy<S>& hierarchy, const S* positions) {
  const TopologyNode* nodes = hierarchy.topology.nodes.data();
  Box<S>* boxes = hierarchy.boxes.data();
  for (std::uint32_t i = hierarchy.topology.size(); i-- > 0;) {
    const TopologyNode node = nodes[i];
    if (node.is_leaf()) {
      boxes[i] = leaf_box(hierarchy.leaf_vertices[i], positions);
    } else {
      Box<S> box = boxes[node.first()];
      for (std::uint32_t k = 1; k < node.count(); ++k) box.extend(boxes[node.first() + k]);
      boxes[i] = box;
    }
  }
}

/// Appends to an AuditView from stored boxes.
template <class S>
AuditView stored_audit_view(const Topology& topology, std::span<const Box<S>> boxes) {
  AuditView view{topology, {}, {}};
  view.boxes.reserve(boxes.size());
  for (const Box<S>& box : boxes) view.boxes.push_back(to_double(box));
  return view;
}

/// Everything that strategies with stored boxes share: `update(body)` is all that a derived class must say.
/// Bodies that cannot move are brought up to date at `reset` only.
template <class S, class Count>
class StoredHierarchyStrategy : public Strategy<S> {
 public:
  StoredHierarchyStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                          const Params& /*params*/)
      : Strategy<S>(scene, motion) {
    hierarchies_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      hierarchies_[body].assign(std::move(topologies[body]), scene.primitives(body));
  }

  void reset(double t) override {
    this->clear_triangle_stats();
    time_ = t;
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) refit(body);
    count_.table = {};
  }

  void advance(double t) override {
    if (t < time_)
      throw std::invalid_argument("cannot advance from t = " + std::to_string(time_) + " back to " +
                                  std::to_string(t));
    time_ = t;
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) update(body);
  }

  QueryStatus candidates_at(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    for (const BodyPair& pair : this->scene_.pairs()) {
      const auto &a = hierarchies_[pair.first], &b = hierarchies_[pair.second];
      LeafPairs<S, Count> leaves(this->scene_, this->sampled_, pair.first, a.topology, pair.second,
                                 b.topology, count_, out);
      status.pending += traverse(a.topology, StoredBoxes<S>{a.boxes.data()}, b.topology,
                                 StoredBoxes<S>{b.boxes.data()}, stack_, count_, budget, leaves)
                            .pending;
    }
    return status;
  }

  /// Positions are all it reads: nothing to do but to remember that no body is at rest for certain.
  void flight_plans_changed(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return stored_audit_view<S>(hierarchies_[body].topology, hierarchies_[body].boxes);
  }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
    return total;
  }

 protected:
  /// Brings one moving body's bounds to the current time.
  virtual void update(std::uint32_t body) = 0;
  void refit(std::uint32_t body) { refit_bottom_up(hierarchies_[body], this->sampled_.positions(body)); }
  Counters counted() const override { return count_.table; }

  std::vector<StoredHierarchy<S>> hierarchies_;
  std::vector<NodePair> stack_;
  Count count_;
  double time_ = 0;
  bool plans_changed_ = false;
};

}  // namespace kbvh
