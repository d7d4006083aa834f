// Bullet's tree of soft bodies (Coumans; cones as in Provot 1997), for pairs within a body: its nodes have
// cones around the normals below them, and btDbvt::selfCollideT skips the pairs within a node whose cone is
// narrow. Approximate: it loses pairs, which the oracle counts. `bullet_dbvt` finds all of them.
//
// - Narrow cones prove that a surface does not cut itself only together with a test of its contour. Bullet
// has
//   none: a strip that turns in its plane and cuts its own beginning is skipped as a whole. Bullet also skips
//   a node until the angle between axis and normals exceeds 180 degrees; the proof would allow 90. Its cones
//   around cones are wider than the normals are, which makes up for a part of this.
// - Pairs of two bodies are found by collideTT, without cones; none of them is lost.
// - The tree joins neighbours, then neighbouring pairs, and so on, as that of btSoftBody, whose function
//   compares all faces with each other and does not end if the mesh has several pieces. Here time is
//   near-linear, and what has no neighbours left is joined in its order.
// - btSoftBody recomputes boxes and cones at every frame, children first, by functions that it does not
//   export. The loops here do the same: the axis of a node halves the angle between the axes of its children,
//   and half of that angle is added to the larger angle of the two. Two things differ in Bullet's favour:
//   boxes have no margin, and normals are normalised in double, where Bullet takes a triangle with sides of
//   0.0003 for one without a normal.
#include "bullet.hpp"

#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <type_traits>
#include <utility>

#include "core/base/heap_block.hpp"

namespace kbvh::bullet {
namespace {

// ---- The shape of a tree

/// Two neighbours, or two children.
using Two = std::array<std::uint32_t, 2>;

/// Returns the pairs of primitives with a common side, in both orders. Of the primitives at one side, each is
/// the neighbour of the next. O(n log n).
std::vector<Two> neighbours(const Primitives& primitives) {
  std::vector<std::array<std::uint32_t, 3>> sides;  // two vertices, ascending, and the primitive
  for (std::uint32_t p = 0; p < primitives.count(); ++p) {
    const auto corners = primitives[p];
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::uint32_t from = corners[i], to = corners[(i + 1) % corners.size()];
      sides.push_back({std::min(from, to), std::max(from, to), p});
    }
  }
  std::sort(sides.begin(), sides.end());
  std::vector<Two> found;
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const auto &one = sides[i - 1], &next = sides[i];
    if (one[0] != next[0] || one[1] != next[1] || one[2] == next[2]) continue;
    found.push_back({one[2], next[2]});
    found.push_back({next[2], one[2]});
  }
  return found;
}

/// Chooses a partner for each tree that has a neighbour left, in order; returns their number.
std::size_t match(std::vector<Two>& links, std::vector<std::uint32_t>& partner) {
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  std::size_t matched = 0;
  for (const auto& [tree, other] : links) {
    if (partner[tree] != tree || partner[other] != other) continue;
    partner[tree] = other;
    partner[other] = tree;
    matched += 2;
  }
  return matched;
}

/// Makes partners of the trees without one, in their order.
void match_the_rest(std::vector<std::uint32_t>& partner) {
  const auto count = std::uint32_t(partner.size());
  std::uint32_t waiting = count;
  for (std::uint32_t tree = 0; tree < count; ++tree) {
    if (partner[tree] != tree) continue;
    if (waiting == count) {
      waiting = tree;
    } else {
      partner[tree] = waiting;
      partner[waiting] = tree;
      waiting = count;
    }
  }
}

/// Returns the children of the inner nodes of a tree over `leaves` primitives. Node i is primitive i, node
/// `leaves` + k the k-th inner node, and the last one the root. Each level has at most seven eighths of the
/// trees of the one below it, so the height is logarithmic.
std::vector<Two> join_neighbours(std::uint32_t leaves, std::vector<Two> links) {
  std::vector<Two> inner;
  std::vector<std::uint32_t> roots(leaves), partner, number, above;
  std::iota(roots.begin(), roots.end(), 0U);
  while (roots.size() > 1) {
    partner.resize(roots.size());
    std::iota(partner.begin(), partner.end(), 0U);
    if (4 * match(links, partner) < roots.size()) match_the_rest(partner);
    number.resize(roots.size());
    above.clear();
    for (std::uint32_t tree = 0; tree < roots.size(); ++tree) {
      if (partner[tree] < tree) {
        number[tree] = number[partner[tree]];
        continue;
      }
      number[tree] = std::uint32_t(above.size());
      if (partner[tree] == tree) {
        above.push_back(roots[tree]);
      } else {
        above.push_back(leaves + std::uint32_t(inner.size()));
        inner.push_back({roots[tree], roots[partner[tree]]});
      }
    }
    std::swap(roots, above);
    for (Two& link : links) link = {number[link[0]], number[link[1]]};
    links.erase(
        std::remove_if(links.begin(), links.end(), [](const Two& link) { return link[0] == link[1]; }),
        links.end());
  }
  return inner;
}

// ---- Nodes of Bullet

btDbvtNode* new_node(const btDbvtNode* /*kind*/) {
  return new (btAlignedAlloc(sizeof(btDbvtNode), 16)) btDbvtNode();
}
btDbvntNode* new_node(const btDbvntNode* /*kind*/) {
  btDbvtNode none{};
  none.volume = btDbvtVolume::FromMM(btVector3(0, 0, 0), btVector3(0, 0, 0));
  return new btDbvntNode(&none);
}
void take_primitive(btDbvtNode& leaf, std::uint32_t primitive) {
  leaf.data = nullptr;
  leaf.dataAsInt = int(primitive);
}
void take_primitive(btDbvntNode& leaf, std::uint32_t primitive) {
  leaf.data = reinterpret_cast<void*>(std::uintptr_t(primitive));
}
void set_parent(btDbvtNode& node, btDbvtNode* parent) {
  node.parent = parent;
}
void set_parent(btDbvntNode& /*node*/, btDbvntNode* /*parent*/) {}

/// Makes the nodes below one of a shape, in the order of a descent, and lists them, children before parents.
template <class Node>
Node* plant(std::uint32_t leaves, const std::vector<Two>& inner, std::uint32_t index, Node* parent,
            std::vector<Node*>& nodes) {
  Node* const node = new_node(parent);
  set_parent(*node, parent);
  if (index < leaves) {
    node->childs[1] = nullptr;
    take_primitive(*node, index);
  } else {
    node->childs[0] = plant(leaves, inner, inner[index - leaves][0], node, nodes);
    node->childs[1] = plant(leaves, inner, inner[index - leaves][1], node, nodes);
  }
  nodes.push_back(node);
  return node;
}

/// Returns the unit normal of a polygon, or (1, 0, 0) if it has none, as Bullet does.
btVector3 normal_of(std::span<const std::uint32_t> corners, const float* positions) {
  const auto side = [&](std::size_t i, int axis) {
    return double(positions[std::size_t(3) * corners[i] + std::size_t(axis)]) -
           double(positions[std::size_t(3) * corners[0] + std::size_t(axis)]);
  };
  double sum[3] = {};
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const int y = (axis + 1) % 3, z = (axis + 2) % 3;
      sum[axis] += side(i, y) * side(i + 1, z) - side(i, z) * side(i + 1, y);
    }
  const double length = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
  if (!(length > 0)) return btVector3(1, 0, 0);
  return btVector3(float(sum[0] / length), float(sum[1] / length), float(sum[2] / length));
}

template <class S>
class BulletCones final : public Contestant, public AnswersSelfPairs {
  static_assert(std::is_same_v<S, float>);

 public:
  BulletCones(const SceneView<float>& scene, const SampledMotion<float>& motion, Topologies /*none*/,
              const Params& /*none*/)
      : Contestant(scene, motion), bodies_(scene.body_count()) {
    std::vector<std::uint8_t> with_others(scene.body_count(), 0), with_itself(scene.body_count(), 0);
    for (const BodyPair& pair : scene.pairs())
      if (pair.first == pair.second)
        with_itself[pair.first] = 1;
      else
        with_others[pair.first] = with_others[pair.second] = 1;
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      build(body, with_others[body] != 0, with_itself[body] != 0);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    hits_.out = &out;
    std::uint64_t tests = 0;
    const auto box_of_body = [&](std::uint32_t body) {
      const BodyState& state = bodies_[body];
      return state.tree.m_root != nullptr ? box_of(*state.tree.m_root)
             : state.cones != nullptr     ? box_of(*state.cones)
                                          : Box<double>{};
    };
    for (const std::uint32_t i : this->near_bodies_.find(box_of_body, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      BodyState& first = bodies_[pair.first];
      hits_.bodies = pair;
      hits_.within = pair.first == pair.second ? &this->scene_.primitives(pair.first) : nullptr;
      if (pair.first == pair.second)
        first.tree.selfCollideT(first.cones.get(), hits_);
      else  // like collideTT, with a stack that stays allocated
        first.tree.collideTTpersistentStack(first.tree.m_root, bodies_[pair.second].tree.m_root, hits_);
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const BodyState& state = bodies_[body];
    if (state.cones != nullptr) return view_of<btDbvntNode>(state.cones.get());
    if (state.tree.m_root != nullptr) return view_of<btDbvtNode>(state.tree.m_root);
    if (this->scene_.primitives(body).count() == 0) return AuditView{};
    return {};
  }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const BodyState& state : bodies_) {
      // Bullet aligns a node of a btDbvt to 16 bytes within a block, and keeps the block's address before it.
      total +=
          sizeof(BodyState) + state.nodes.size() * heap_block_bytes(sizeof(btDbvtNode) + sizeof(void*) + 16) +
          state.cone_nodes.size() * heap_block_bytes(sizeof(btDbvntNode)) +
          state.nodes.capacity() * sizeof(btDbvtNode*) + state.cone_nodes.capacity() * sizeof(btDbvntNode*) +
          std::size_t(state.tree.m_stkStack.capacity()) * sizeof(state.tree.m_stkStack[0]);
    }
    return total;
  }

 private:
  struct BodyState {
    btDbvt tree;                           // for pairs with other bodies; else empty
    std::unique_ptr<btDbvntNode> cones;    // the same tree for pairs within the body; else null
    std::vector<btDbvtNode*> nodes;        // children before parents
    std::vector<btDbvntNode*> cone_nodes;  // the same
  };

  void build(std::uint32_t body, bool with_others, bool with_itself) {
    const Primitives& primitives = this->scene_.primitives(body);
    const std::uint32_t leaves = primitives.count();
    if (leaves == 0 || (!with_others && !with_itself)) return;
    const std::vector<Two> inner = join_neighbours(leaves, neighbours(primitives));
    const std::uint32_t root = leaves + std::uint32_t(inner.size()) - 1;
    BodyState& state = bodies_[body];
    if (with_others) {
      state.tree.m_root = plant<btDbvtNode>(leaves, inner, root, nullptr, state.nodes);
      state.tree.m_leaves = int(leaves);
    }
    if (with_itself) state.cones.reset(plant<btDbvntNode>(leaves, inner, root, nullptr, state.cone_nodes));
  }

  void update(std::uint32_t body) {
    BodyState& state = bodies_[body];
    for (btDbvtNode* const node : state.nodes)
      if (node->isleaf())
        node->volume = volume(body, primitive_of(*node));
      else
        Merge(node->childs[0]->volume, node->childs[1]->volume, node->volume);
    for (btDbvntNode* const node : state.cone_nodes) update_cone(body, *node);
    for (const std::size_t nodes : {state.nodes.size(), state.cone_nodes.size()})
      if (nodes != 0) this->count_refit(this->scene_.primitives(body).count());
  }
  void update_cone(std::uint32_t body, btDbvntNode& node) const {
    if (node.isleaf()) {
      const std::uint32_t primitive = primitive_of(node);
      node.volume = volume(body, primitive);
      node.normal = normal_of(this->scene_.primitives(body)[primitive], this->sampled_.positions(body));
      node.angle = 0;
      return;
    }
    const btDbvntNode &first = *node.childs[0], &second = *node.childs[1];
    Merge(first.volume, second.volume, node.volume);
    node.normal = (first.normal + second.normal).safeNormalize();
    node.angle = std::max(first.angle, second.angle) + btAngle(first.normal, second.normal) / 2;
  }

  void update_all() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) update(body);
  }
  void update_moving() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->moves_[body] != 0) update(body);
  }

  std::vector<BodyState> bodies_;
  LeafHits hits_;
};

}  // namespace
}  // namespace kbvh::bullet

KBVH_STRATEGY(bullet_cones) {
  using namespace kbvh;
  Info info = bullet::info("bullet_cones", "Bullet soft-body tree, normal cones");
  info.tightness = Tightness::tight;
  info.guarantee = Guarantee::approximate;
  info.primitives = {PrimitiveKind::polygons};
  info.remark = "its cones of normals have no test of the contour, so it misses pairs within a body";
  return {make_entry<bullet::BulletCones, Scalars::float_only>(std::move(info))};
}
