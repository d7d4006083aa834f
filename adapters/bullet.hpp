#pragma once
// The shared part of the contestants of Bullet (Coumans). They compute in float, as Debian's Bullet does, and
// accept float scenes only. btOptimizedBvh takes triangles, btDbvt boxes.
//
// Range. bullet_bvh: 1e18. Bullet initialises boxes with that value (BT_LARGE_FLOAT). With scale=none a box
// beyond it extends back to it, is quantised to a negative number of cells, and is wrong after the conversion
// to unsigned. bullet_dbvt: everything admissible. Products of extents decide how its tree is built, at a
// moderate scale; its queries, refits and insertions only add and compare. bullet_cones: everything
// admissible. Its tree is made without coordinates, and normals are computed in double.
#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <LinearMath/btVector3.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/self_pairs.hpp"
#include "instructions.hpp"

#ifdef BT_USE_DOUBLE_PRECISION
#error "these adapters are for Bullet in float"
#endif

namespace kbvh::bullet {

inline btVector3 vector(const float* p) {
  return btVector3(p[0], p[1], p[2]);
}

/// Lays a binary tree out in the form of an audit: siblings next to each other and after their parent.
/// `children(node)` is a pair of handles, `primitive(node)` a primitive id or -1 for inner nodes.
template <class Handle, class Primitive, class Children, class BoxOf>
AuditView breadth_first(Handle root, const Primitive& primitive, const Children& children, const BoxOf& box) {
  AuditView view;
  std::vector<Handle> handles{root};
  view.topology.parents.push_back(0);
  view.topology.depths.push_back(0);
  for (std::uint32_t i = 0; i < handles.size(); ++i) {
    const Handle node = handles[i];
    view.boxes.push_back(box(node));
    if (const int id = primitive(node); id >= 0) {
      view.topology.nodes.push_back(TopologyNode::leaf(std::uint32_t(view.topology.primitives.size()), 1));
      view.topology.primitives.push_back(std::uint32_t(id));
      continue;
    }
    view.topology.nodes.push_back(TopologyNode::inner(std::uint32_t(handles.size()), 2));
    const auto [left, right] = children(node);
    for (const Handle child : {left, right}) {
      handles.push_back(child);
      view.topology.parents.push_back(i);
      view.topology.depths.push_back(std::uint8_t(std::min(255, view.topology.depths[i] + 1)));
    }
  }
  return view;
}

/// Returns the primitive of a leaf of either kind of dynamic tree.
inline std::uint32_t primitive_of(const btDbvtNode& leaf) {
  return std::uint32_t(leaf.dataAsInt);
}
inline std::uint32_t primitive_of(const btDbvntNode& leaf) {
  return std::uint32_t(reinterpret_cast<std::uintptr_t>(leaf.data));
}

template <class Node>
Box<double> box_of(const Node& node) {
  Box<double> box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = double(node.volume.Mins()[axis]);
    box.upper[axis] = double(node.volume.Maxs()[axis]);
  }
  return box;
}

/// Shows the audit a dynamic tree.
template <class Node>
AuditView view_of(const Node* root) {
  return breadth_first(
      root, [](const Node* node) { return node->isleaf() ? int(primitive_of(*node)) : -1; },
      [](const Node* node) { return std::pair<const Node*, const Node*>(node->childs[0], node->childs[1]); },
      [](const Node* node) { return box_of(*node); });
}

/// Collects overlapping leaves of two dynamic trees, or of one with itself.
class LeafHits final : public btDbvt::ICollide {
 public:
  BodyPair bodies{};
  const Primitives* within = nullptr;  ///< the primitives of the body, if it is one with itself
  PairBuffer* out = nullptr;

  using btDbvt::ICollide::Process;
  void Process(const btDbvtNode* a, const btDbvtNode* b) override {
    take(primitive_of(*a), primitive_of(*b));
  }
  void Process(const btDbvntNode* a, const btDbvntNode* b) override {
    take(primitive_of(*a), primitive_of(*b));
  }

 private:
  void take(std::uint32_t a, std::uint32_t b) {
    if (within == nullptr || keep_self_pair(within, LeavesOf::two, a, b))
      out->push_back({bodies.first, a, bodies.second, b});
  }
};

/// The shared part: which bodies move, and the check that time does not run backwards.
class Contestant : public CountedStrategy<float>, public TakesPlanChanges<float> {
 public:
  static constexpr Foresight foresight = Foresight::none;

  Contestant(const SceneView<float>& scene, const SampledMotion<float>& motion)
      : CountedStrategy<float>(scene, motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        moves_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      for (std::uint32_t v = 0; v < scene.vertex_count(body); ++v) motion.position(body, v);
  }

  void reset_to(double /*t*/) final {
    for (std::uint32_t body = 0; body < moves_.size(); ++body) moves_[body] = this->scene_.moving(body);
    update_all();
  }

  void advance_to(double /*t*/) final { update_moving(); }

  void follow_plans(double /*t*/, std::span<const PlanChange<float>> changes) final {
    for (const auto& change : changes) moves_[change.body] = true;
  }

 protected:
  virtual void update_all() = 0;
  virtual void update_moving() = 0;
  btDbvtVolume volume(std::uint32_t body, std::uint32_t primitive) const {
    const Box<float> box =
        primitive_box(this->scene_.primitives(body)[primitive], this->sampled_.positions(body));
    return btDbvtVolume::FromMM(vector(box.lower), vector(box.upper));
  }
  void count_refit(std::uint64_t primitives) {
    this->count_.add(Counter::nodes_visited, 2 * primitives - 1);
    this->count_.add(Counter::values_written, 6 * (2 * primitives - 1));
    this->count_.add(Counter::vertex_reads, 3 * primitives);
  }

  NearBodies near_bodies_;
  std::vector<std::uint8_t> moves_;
};

/// Returns the Info that the registrations share.
inline Info info(const char* id, const char* title) {
  Info made;
  made.id = id;
  made.title = title;
  made.family = "bullet";
  made.citation = "Coumans, Bullet Physics";
  made.version =
      "Bullet " + std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
  made.instructions = compiled_instructions();
  made.guarantee = Guarantee::candidate_superset;
  made.positions = PositionUse::all;
  made.topology.own = true;
  made.own_scalar = "float";
  return made;
}

}  // namespace kbvh::bullet
