// The tree of game engines: every primitive has a box that is larger than needed. When it leaves that box, it
// is removed from the tree and inserted again; rotations keep the tree good. The work follows the motion: a
// body at rest costs one check per box, a body that moves as a whole costs an insertion per primitive.

#include "core/families/restructure/dynamic_tree.hpp"
#include "core/base/median.hpp"
#include "core/contract/registry.hpp"
#include "core/families/build/built_each_frame.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {
namespace {

/// One body: the tree over enlarged boxes, and the tight boxes of the current frame.
template <class S>
struct DynamicBody {
  DynamicTree<S> tree;
  std::vector<Box<S>> tight;  // by primitive
  S margin = 0;
  std::size_t bytes() const { return tree.bytes() + tight.capacity() * sizeof(Box<S>); }
};

/// A DynamicTree for `follow_probe`.
template <class S>
struct DynamicProbes {
  using Node = std::uint32_t;
  const DynamicTree<S>& tree;

  Node root() const { return tree.root(); }
  const Box<S>& box(Node node) const { return tree.node(node).box; }
  template <class Visit>
  void children(Node node, Visit&& visit) const {
    visit(tree.node(node).first);
    visit(tree.node(node).second);
  }
  template <class Test>
  bool leaf(Node node, Test&& test) const {
    const bool is_leaf = tree.node(node).is_leaf();
    if (is_leaf) test(tree.node(node).first);
    return is_leaf;
  }
};

template <class S>
class Dynamic final : public BuiltEachFrame<S, DynamicBody<S>>, public AnswersProbes<S> {
  using Base = BuiltEachFrame<S, DynamicBody<S>>;
  using Base::bodies_;
  using Base::lists_;

 public:
  Dynamic(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies& /*topologies*/,
          const Params& params)
      : Base(scene, motion), margin_(params.number("margin")), ahead_(params.number("ahead")) {}

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) {
      const DynamicTree<S>& tree = bodies_[body].tree;
      return tree.empty() ? Box<double>{} : to_double(tree.node(tree.root()).box);
    };
    for (const std::uint32_t i : this->near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      const DynamicBody<S>&a = bodies_[pair.first], &b = bodies_[pair.second];
      const bool within = pair.first == pair.second;
      DynamicTree<S>::search(a.tree, b.tree, stack_, tests, [&](std::uint32_t p, std::uint32_t q) {
        ++tests;
        if (!overlap(a.tight[p], b.tight[q])) return;
        if (!within || keep_self_pair(&this->scene_.primitives(pair.first), LeavesOf::two, p, q))
          out.push_back({pair.first, p, pair.second, q});
      });
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view;
    view.topology = bodies_[body].tree.topology(view.boxes);
    return view;
  }
  std::size_t bytes() const override {
    return Base::bytes() + stack_.capacity() * sizeof(NodePair) + probe_order_.bytes() +
           probe_stack_.capacity() * sizeof(ProbeNode<std::uint32_t>);
  }

 protected:
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    const auto box_of = [&](std::uint32_t body) {
      const DynamicTree<S>& tree = bodies_[body].tree;
      return tree.empty() ? Box<S>{} : tree.node(tree.root()).box;
    };
    const std::uint64_t all =
        answer_by_body(this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
                       [&](std::uint32_t body, auto& search, std::uint64_t& tests) {
                         return follow_probe(DynamicProbes<S>{bodies_[body].tree}, search, body,
                                             this->scene_.primitives(body), this->sampled_.positions(body),
                                             probe_stack_, tests, this->triangle_stats_);
                       });
    this->count_.add(Counter::box_tests, all);
  }

 private:
  void start() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      bodies_[body].tree.clear(this->scene_.primitives(body).count());
  }
  void list_changed(std::uint32_t index) override {
    const Primitives& primitives = this->scene_.primitives(index);
    DynamicBody<S>& body = bodies_[index];
    body.tree.grow(primitives.count());
    body.tight.resize(primitives.count());
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      if (!primitives.alive(p) && body.tree.contains(p)) body.tree.remove(p);
    std::vector<double> sides;
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      if (!primitives.alive(p)) continue;
      const Box<S> box = primitive_box(primitives[p], this->sampled_.positions(index));
      double side = 0;
      for (int axis = 0; axis < 3; ++axis) side += (double(box.upper[axis]) - double(box.lower[axis])) / 3;
      sides.push_back(side);
    }
    body.margin = S(std::min(margin_ * median(sides), double(admissible_magnitude<S>)));
  }

  void build(std::uint32_t index) override {
    DynamicBody<S>& body = bodies_[index];
    const Primitives& primitives = this->scene_.primitives(index);
    const S* const positions = this->sampled_.positions(index);
    const std::uint64_t before = body.tree.visited();
    for (std::uint32_t k = 0; k < lists_[index].count; ++k) {
      const std::uint32_t p = lists_[index].ids() == nullptr ? k : lists_[index].ids()[k];
      const Box<S> now = primitive_box(primitives[p], positions), last = body.tight[p];
      body.tight[p] = now;
      if (!body.tree.contains(p)) {
        body.tree.insert(p, enlarged(now, now, body.margin));
      } else if (!body.tree.leaf_box(p).contains(now)) {
        body.tree.remove(p);
        body.tree.insert(p, enlarged(now, last, body.margin));
        ++reinserted_;
      }
    }
    this->count_build(index);
    this->count_.add(Counter::nodes_visited, body.tree.visited() - before);
  }
  /// Returns a box with a margin on every side, and with room for some more steps like the last one.
  Box<S> enlarged(const Box<S>& now, const Box<S>& last, S margin) const {
    Box<S> box;
    for (int axis = 0; axis < 3; ++axis) {
      const double step = ahead_ *
                          (double(now.lower[axis]) - double(last.lower[axis]) + double(now.upper[axis]) -
                           double(last.upper[axis])) /
                          2;
      const double most = double(admissible_magnitude<S>);
      box.lower[axis] = now.lower[axis] - margin + S(std::max(-most, std::min(step, 0.0)));
      box.upper[axis] = now.upper[axis] + margin + S(std::min(most, std::max(step, 0.0)));
    }
    return box;
  }

  void counts_cleared() override { reinserted_ = 0; }
  void add_counts(Counters& table) const override { table.add("primitives_reinserted", reinserted_); }

  double margin_, ahead_;
  std::vector<NodePair> stack_;
  std::vector<ProbeNode<std::uint32_t>> probe_stack_;
  BodyOrder probe_order_;
  std::uint64_t reinserted_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(dynamic_tree) {
  using namespace kbvh;
  return {make_entry<Dynamic>({
      .id = "dynamic_tree",
      .title = "dynamic tree of enlarged boxes",
      .family = "restructuring",
      .citation = "Catto 2019 (Box2D); Rouwe 2022 (Jolt Physics)",
      .tightness = Tightness::conservative,
      .declares = {.restructures = true},
      .topology = {.own = true},
      .parameters = {{"margin",
                      "0.1",
                      {},
                      "margin on every side, as a share of the median side of the body's "
                      "primitives at the reset"},
                     {"ahead", "4", {}, "steps like its last one for which a moving primitive gets room"}},
  })};
}
