// The likely baseline of the paper's authors in 2006: a pointer-linked binary tree, one polygon per leaf,
// updated and traversed by recursion (Z&W 2006, s.2 and Algorithm 2). It is deliberately not optimised: the
// ratio between this strategy and the best refit puts the paper's speed-ups into perspective.

#include <memory>

#include "core/base/heap_block.hpp"
#include "core/contract/registry.hpp"
#include "core/families/wide/body_by_body.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {
namespace {

template <class S>
struct PeriodNode {
  Box<S> box;
  PeriodNode* left = nullptr;
  PeriodNode* right = nullptr;
  std::uint32_t primitive = 0;
  std::uint32_t id = 0;  // in the original topology

  bool is_leaf() const { return left == nullptr; }
};

/// The nodes as a tree for `follow_probe`.
template <class S>
struct PeriodTree {
  using Node = const PeriodNode<S>*;
  Node top;

  Node root() const { return top; }
  const Box<S>& box(Node node) const { return node->box; }
  template <class Visit>
  void children(Node node, Visit&& visit) const {
    visit(node->left);
    visit(node->right);
  }
  template <class Test>
  bool leaf(Node node, Test&& test) const {
    if (node->is_leaf()) test(node->primitive);
    return node->is_leaf();
  }
};

template <class S>
class BottomUpPeriod final : public BodyByBody<S>, public AnswersProbes<S> {
  using BodyByBody<S>::near_bodies_;
  using Node = PeriodNode<S>;

 public:
  BottomUpPeriod(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                 const Params& /*params*/)
      : BodyByBody<S>(scene, motion), topologies_(std::move(topologies)) {
    for (const Topology& topology : topologies_)
      roots_.push_back(topology.empty() ? nullptr : link(topology, 0));
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) {
      return roots_[body] == nullptr ? Box<double>{} : to_double(roots_[body]->box);
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (roots_[pair.first] == nullptr || roots_[pair.second] == nullptr) continue;
      ++tests;
      check(*roots_[pair.first], *roots_[pair.second], pair, out);
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    const auto box_of = [&](std::uint32_t body) {
      return roots_[body] == nullptr ? Box<S>{} : roots_[body]->box;
    };
    const std::uint64_t all = answer_by_body(
        this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
        [&](std::uint32_t body, auto& search, std::uint64_t& tests) {
          return follow_probe(PeriodTree<S>{roots_[body]}, search, body, this->scene_.primitives(body),
                              this->sampled_.positions(body), probe_stack_, tests, this->triangle_stats_);
        });
    this->count_.add(Counter::box_tests, all);
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view{topologies_[body], std::vector<Box<double>>(topologies_[body].size()), {}};
    for (const auto& node : nodes_of(body)) view.boxes[node->id] = to_double(node->box);
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + nodes_.size() * heap_block_bytes(sizeof(Node)) +
                        nodes_.capacity() * sizeof(nodes_[0]) + probe_order_.bytes() +
                        probe_stack_.capacity() * sizeof(probe_stack_[0]);
    for (const Topology& topology : topologies_) total += topology.bytes();
    return total;
  }

 private:
  /// Allocates nodes one by one in the order of the recursion, as `new Node` in a recursive build does.
  Node* link(const Topology& topology, std::uint32_t id) {
    nodes_.push_back(std::make_unique<Node>());
    Node* node = nodes_.back().get();
    node->id = id;
    const TopologyNode source = topology.nodes[id];
    if (source.is_leaf()) {
      node->primitive = topology.primitives[source.first()];
    } else {
      node->left = link(topology, source.first());
      node->right = link(topology, source.first() + 1);
    }
    return node;
  }

  std::span<const std::unique_ptr<Node>> nodes_of(std::uint32_t body) const {
    std::size_t begin = 0;
    for (std::uint32_t before = 0; before < body; ++before) begin += topologies_[before].size();
    return {nodes_.data() + begin, topologies_[body].size()};
  }

  void update(std::uint32_t body) override {
    if (roots_[body] == nullptr) return;
    const Primitives& primitives = this->scene_.primitives(body);
    refit(*roots_[body], primitives, this->sampled_.positions(body));
    count_boxes(this->count_, topologies_[body].size(), primitives.vertices.size());
  }

  void refit(Node& node, const Primitives& primitives, const S* positions) {
    node.box = Box<S>{};
    if (node.is_leaf()) {
      for (std::uint32_t v : primitives[node.primitive]) node.box.extend(positions + std::size_t(3) * v);
      return;
    }
    refit(*node.left, primitives, positions);
    refit(*node.right, primitives, positions);
    node.box.extend(node.left->box);
    node.box.extend(node.right->box);
  }

  /// Implements Algorithm 2 of the paper, with the missing case of a leaf against an inner node.
  void check(const Node& a, const Node& b, const BodyPair& pair, PairBuffer& out) {
    if (!overlap(a.box, b.box)) return;
    if (a.is_leaf() && b.is_leaf()) {
      out.push_back({pair.first, a.primitive, pair.second, b.primitive});
    } else if (a.is_leaf()) {
      this->count_.add(Counter::box_tests, 2);
      check(a, *b.left, pair, out);
      check(a, *b.right, pair, out);
    } else if (b.is_leaf()) {
      this->count_.add(Counter::box_tests, 2);
      check(*a.left, b, pair, out);
      check(*a.right, b, pair, out);
    } else {
      this->count_.add(Counter::box_tests, 4);
      check(*a.left, *b.left, pair, out);
      check(*a.left, *b.right, pair, out);
      check(*a.right, *b.left, pair, out);
      check(*a.right, *b.right, pair, out);
    }
  }

  Topologies topologies_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::vector<Node*> roots_;
  std::vector<ProbeNode<const Node*>> probe_stack_;
  BodyOrder probe_order_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_period) {
  using namespace kbvh;
  return {make_entry<BottomUpPeriod>({
      .id = "bottom_up_period",
      .title = "bottom-up refit, 2006 style",
      .family = "period",
      .citation = "Z&W 2006, s.2 and Algorithm 2",
      .topology = {.widths = {2},
                   .max_leaf_size = 1,
                   .preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
  })};
}
