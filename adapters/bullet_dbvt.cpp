// Bullet's dynamic tree (Coumans) as a contestant: btDbvt with one leaf per primitive, its tree made by
// optimizeTopDown(), its queries by collideTT.
//
// - Bullet updates the tree leaf by leaf (`update=leaves`): it removes each leaf and inserts it again, which
//   also changes the tree. The default `update=refit` instead recomputes the volumes of all nodes, children
//   first, with Bullet's Merge. That loop is not part of Bullet, but ten times faster. Boxes are tight in
//   both cases.
// - collideTT of a tree with itself finds each pair of two leaves once: pairs within a body.
// - Insertions build the first tree. They make a list of identical boxes, which optimizeTopDown() divides.
#include "bullet.hpp"

#include <cmath>
#include <type_traits>

#include "core/base/heap_block.hpp"

namespace kbvh::bullet {
namespace {

template <class S>
class BulletDbvt final : public Contestant, public AnswersSelfPairs {
  static_assert(std::is_same_v<S, float>);

 public:
  BulletDbvt(const SceneView<float>& scene, const SampledMotion<float>& motion, Topologies /*none*/,
             const Params& params)
      : Contestant(scene, motion), refits_(params.word("update") == "refit"), bodies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      build(body);
      copy_built(body);
      if (refits_) bodies_[body].built.clear();  // its copy keeps its shape
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    hits_.out = &out;
    std::uint64_t tests = 0;
    const auto box_of_body = [&](std::uint32_t body) {
      const btDbvtNode* root = bodies_[body].tree.m_root;
      return root != nullptr ? box_of(*root) : Box<double>{};
    };
    for (const std::uint32_t i : this->near_bodies_.find(box_of_body, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      hits_.bodies = pair;
      hits_.within = pair.first == pair.second ? &this->scene_.primitives(pair.first) : nullptr;
      // Like collideTT, with a stack that stays allocated.
      bodies_[pair.first].tree.collideTTpersistentStack(bodies_[pair.first].tree.m_root,
                                                        bodies_[pair.second].tree.m_root, hits_);
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const btDbvtNode* root = bodies_[body].tree.m_root;
    return root == nullptr ? AuditView{} : view_of(root);
  }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const BodyState& state : bodies_) {
      const auto leaves = std::size_t(state.tree.m_leaves);
      // Bullet aligns each node to 16 bytes within a block, and keeps the block's address before it.
      constexpr std::size_t node_bytes = heap_block_bytes(sizeof(btDbvtNode) + sizeof(void*) + 16);
      total += 2 * sizeof(btDbvt) + (refits_ ? 1 : 2) * (leaves == 0 ? 0 : 2 * leaves - 1) * node_bytes +
               state.nodes.capacity() * sizeof(btDbvtNode*) +
               std::size_t(state.tree.m_stkStack.capacity()) * sizeof(state.tree.m_stkStack[0]);
    }
    return total;
  }

 private:
  struct BodyState {
    btDbvt built;  // the initial tree of each clip: updates of leaves change the shape of `tree`
    btDbvt tree;
    std::vector<btDbvtNode*> nodes;  // refit: all, children before parents; else leaves by primitive
  };

  void build(std::uint32_t body) {
    BodyState& state = bodies_[body];
    const std::uint32_t count = this->scene_.primitives(body).count();
    if (count == 0) return;
    // Insertion and optimizeTopDown() multiply extents: far from 1 they overflow, and optimizeTopDown() then
    // writes out of bounds. The shape of the tree is decided at a moderate scale; true volumes follow.
    const float scale = sane_scale(body);
    for (std::uint32_t p = 0; p < count; ++p) {
      const btDbvtVolume real = volume(body, p);
      state.built.insert(btDbvtVolume::FromMM(real.Mins() * scale, real.Maxs() * scale), nullptr)->dataAsInt =
          int(p);
    }
    state.built.optimizeTopDown();
  }

  /// Copies the initial tree, with the current volumes.
  void copy_built(std::uint32_t body) {
    BodyState& state = bodies_[body];
    const std::uint32_t count = this->scene_.primitives(body).count();
    if (count == 0) return;
    // The copy has its nodes in memory in the order of a descent, which speeds up both refits and queries.
    btDbvt::IClone nothing_more;
    state.built.clone(state.tree, &nothing_more);
    state.tree.m_leaves = state.built.m_leaves;  // not copied by clone()
    state.nodes.clear();
    state.nodes.resize(refits_ ? 0 : count);
    std::vector<btDbvtNode*> stack{state.tree.m_root};
    while (!stack.empty()) {
      btDbvtNode* node = stack.back();
      stack.pop_back();
      if (refits_) state.nodes.push_back(node);
      if (node->isleaf()) {
        if (!refits_) state.nodes[std::size_t(node->dataAsInt)] = node;
        continue;
      }
      // clone() puts the node at place i of its stack into childs[i & 1]; hence this order is the memory
      // order.
      const std::size_t place = stack.size();
      stack.push_back(node->childs[place & 1]);
      stack.push_back(node->childs[(place + 1) & 1]);
    }
    // Children before parents, and true volumes in place of the scaled ones.
    std::vector<btDbvtNode*> order;
    stack = {state.tree.m_root};
    while (!stack.empty()) {
      btDbvtNode* node = stack.back();
      stack.pop_back();
      order.push_back(node);
      if (node->isleaf()) continue;
      stack.push_back(node->childs[0]);
      stack.push_back(node->childs[1]);
    }
    std::reverse(order.begin(), order.end());
    for (btDbvtNode* node : order) set_volume(body, *node);
    if (refits_) std::reverse(state.nodes.begin(), state.nodes.end());
  }

  /// Returns a power of two that scales the body's coordinates to about 1000.
  float sane_scale(std::uint32_t body) const {
    float largest = 0;
    for (std::uint32_t p = 0; p < this->scene_.primitives(body).count(); ++p) {
      const btDbvtVolume v = volume(body, p);
      for (int axis = 0; axis < 3; ++axis)
        largest = std::max({largest, std::abs(v.Mins()[axis]), std::abs(v.Maxs()[axis])});
    }
    if (largest == 0) return 1;
    return std::ldexp(1.0F, std::clamp(10 - std::ilogb(largest), -126, 126));
  }

  void set_volume(std::uint32_t body, btDbvtNode& node) const {
    if (node.isleaf())
      node.volume = volume(body, primitive_of(node));
    else
      Merge(node.childs[0]->volume, node.childs[1]->volume, node.volume);
  }

  void update(std::uint32_t body) {
    BodyState& state = bodies_[body];
    if (state.nodes.empty()) return;
    if (refits_) {
      for (btDbvtNode* node : state.nodes) set_volume(body, *node);
      this->count_refit(this->scene_.primitives(body).count());
      return;
    }
    for (std::uint32_t p = 0; p < state.nodes.size(); ++p) {
      btDbvtVolume box = volume(body, p);
      state.tree.update(state.nodes[p], box);
    }
    this->count_.add(Counter::vertex_reads, 3 * state.nodes.size());
  }
  void update_all() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (refits_)
        update(body);
      else
        copy_built(body);
  }
  void update_moving() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->moves_[body]) update(body);
  }

  bool refits_;
  std::vector<BodyState> bodies_;
  LeafHits hits_;
};

}  // namespace
}  // namespace kbvh::bullet

KBVH_STRATEGY(bullet_dbvt) {
  using namespace kbvh;
  Info info = bullet::info("bullet_dbvt", "Bullet dynamic tree");
  info.tightness = Tightness::tight;
  info.declares.restructures = true;  // with update=leaves
  info.parameters.push_back(
      {"update", "refit", {"refit", "leaves"}, "recompute all nodes, or btDbvt::update leaf by leaf", 0});
  return {make_entry<bullet::BulletDbvt, Scalars::float_only>(std::move(info))};
}
