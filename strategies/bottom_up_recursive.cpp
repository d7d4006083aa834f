// The refit of a typical first implementation: it recurses over the nodes, computes every leaf's box from all
// corners of all its primitives, extends boxes point by point, and queries by recursion over pairs of nodes.
// It accepts any topology, so its ratio to the best refit shows the effect of the code alone
// (`bottom_up_period` also links its nodes by pointers).

#include "core/contract/registry.hpp"
#include "core/families/wide/body_by_body.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {
namespace {

template <class S>
struct RecursiveBody {
  Topology topology;
  std::vector<Box<S>> boxes;  // one per node
  const Primitives* primitives = nullptr;
  const S* positions = nullptr;

  Box<S> box_of(std::uint32_t primitive) const {
    Box<S> box;
    for (std::uint32_t v : (*primitives)[primitive]) box.extend(positions + std::size_t(3) * v);
    return box;
  }
};

/// Both recursions are as deep as the topologies: log2 n for the median.
template <class S>
class BottomUpRecursive final : public BodyByBody<S>, public AnswersProbes<S> {
  using BodyByBody<S>::near_bodies_;
  using Body = RecursiveBody<S>;

 public:
  BottomUpRecursive(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                    const Params& /*params*/)
      : BodyByBody<S>(scene, motion) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      const std::uint32_t nodes = topologies[body].size();
      bodies_.push_back({std::move(topologies[body]), std::vector<Box<S>>(nodes), &scene.primitives(body),
                         motion.positions(body)});
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) {
      return bodies_[body].topology.empty() ? Box<double>{} : to_double(bodies_[body].boxes[0]);
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      const Body &a = bodies_[pair.first], &b = bodies_[pair.second];
      if (a.topology.empty() || b.topology.empty()) continue;
      ++tests;
      check(pair, a, 0, b, 0, out);
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    const auto box_of = [&](std::uint32_t index) {
      return bodies_[index].topology.empty() ? Box<S>{} : bodies_[index].boxes[0];
    };
    const std::uint64_t all = answer_by_body(
        this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
        [&](std::uint32_t index, auto& search, std::uint64_t& tests) {
          const Body& body = bodies_[index];
          const TopologyTree tree{body.topology, [&](std::uint32_t node) { return body.boxes[node]; }};
          return follow_probe(tree, search, index, *body.primitives, body.positions, probe_stack_, tests,
                              this->triangle_stats_);
        });
    this->count_.add(Counter::box_tests, all);
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view{bodies_[body].topology, {}, {}};
    for (const Box<S>& box : bodies_[body].boxes) view.boxes.push_back(to_double(box));
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + probe_order_.bytes() +
                        probe_stack_.capacity() * sizeof(ProbeNode<std::uint32_t>);
    for (const Body& body : bodies_) total += body.topology.bytes() + body.boxes.size() * sizeof(Box<S>);
    return total;
  }

 private:
  void update(std::uint32_t body) override {
    bodies_[body].positions = this->sampled_.positions(body);
    const Body& updated = bodies_[body];
    if (updated.topology.empty()) return;
    refit(bodies_[body], 0);
    count_boxes(this->count_, updated.topology.size(), updated.primitives->vertices.size());
  }

  void refit(Body& body, std::uint32_t id) {
    const TopologyNode node = body.topology.nodes[id];
    // Written in place: naive, but not unlucky. GCC 12 copies a local box by vector loads of sides that were
    // just stored one by one, which stalls at every node (measured separately: 1.7 times the time).
    Box<S>& box = body.boxes[id];
    box = Box<S>{};
    if (node.is_leaf()) {
      for (std::uint32_t i = 0; i < node.count(); ++i) {
        const std::uint32_t primitive = body.topology.primitives[node.first() + i];
        for (std::uint32_t v : (*body.primitives)[primitive]) box.extend(body.positions + std::size_t(3) * v);
      }
    } else {
      for (std::uint32_t child = node.first(); child < node.first() + node.count(); ++child) {
        refit(body, child);
        box.extend(body.boxes[child]);
      }
    }
  }

  /// Implements Z&W Algorithm 2 for any width, with the missing case of a leaf against an inner node.
  void check(const BodyPair& pair, const Body& a, std::uint32_t id_a, const Body& b, std::uint32_t id_b,
             PairBuffer& out) {
    if (!overlap(a.boxes[id_a], b.boxes[id_b])) return;
    const TopologyNode node_a = a.topology.nodes[id_a], node_b = b.topology.nodes[id_b];
    if (node_a.is_leaf() && node_b.is_leaf()) {
      compare(pair, a, node_a, b, node_b, out);
    } else if (node_a.is_leaf()) {
      this->count_.add(Counter::box_tests, node_b.count());
      for (std::uint32_t j = 0; j < node_b.count(); ++j) check(pair, a, id_a, b, node_b.first() + j, out);
    } else if (node_b.is_leaf()) {
      this->count_.add(Counter::box_tests, node_a.count());
      for (std::uint32_t i = 0; i < node_a.count(); ++i) check(pair, a, node_a.first() + i, b, id_b, out);
    } else {
      this->count_.add(Counter::box_tests, std::uint64_t(node_a.count()) * node_b.count());
      for (std::uint32_t i = 0; i < node_a.count(); ++i)
        for (std::uint32_t j = 0; j < node_b.count(); ++j)
          check(pair, a, node_a.first() + i, b, node_b.first() + j, out);
    }
  }

  /// Compares all primitives of two leaves; single ones have been compared as leaves.
  void compare(const BodyPair& pair, const Body& a, TopologyNode leaf_a, const Body& b, TopologyNode leaf_b,
               PairBuffer& out) {
    const bool single = leaf_a.count() == 1 && leaf_b.count() == 1;
    if (!single) this->count_.add(Counter::box_tests, std::uint64_t(leaf_a.count()) * leaf_b.count());
    for (std::uint32_t i = 0; i < leaf_a.count(); ++i)
      for (std::uint32_t j = 0; j < leaf_b.count(); ++j) {
        const std::uint32_t primitive_a = a.topology.primitives[leaf_a.first() + i];
        const std::uint32_t primitive_b = b.topology.primitives[leaf_b.first() + j];
        if (!single && !overlap(a.box_of(primitive_a), b.box_of(primitive_b))) continue;
        out.push_back({pair.first, primitive_a, pair.second, primitive_b});
      }
  }

  std::vector<Body> bodies_;
  std::vector<ProbeNode<std::uint32_t>> probe_stack_;
  BodyOrder probe_order_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_recursive) {
  using namespace kbvh;
  return {make_entry<BottomUpRecursive>({
      .id = "bottom_up_recursive",
      .title = "recursive refit, naive",
      .family = "refit",
      .citation = "van den Bergen 1997; Z&W 2006, s.2 and Algorithm 2",
      .baseline = true,
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
  })};
}
