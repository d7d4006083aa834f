// Reinsertion: refit, then take subtrees out and insert them where they cost least (Bittner et al. 2013, with
// the search of Meister & Bittner 2018). Considers only nodes whose surface has grown since their children
// were last tried, those that have grown most first, and only if the queries notice it. Each move is applied
// before the next search: on one thread no two moves conflict. Nodes have eight children, all of which a
// search compares at once. Leaves hold single primitives, because a leaf is moved as a whole.
//
// When it wins: against a refit on scenes that age a tree (65,000 triangles, l = 1: 9 times on mixing swarms,
// 10 times on unrolling yarns, 1.7 times on shattering balls). It won against nothing else that was tried: a
// builder makes a whole new tree (`lbvh`) in less time than the moves and the refit of single-primitive
// leaves take together, and `partial_rebuild` is faster, too. On cloth, where nothing is moved, its refit
// alone is 45 times slower than that of `bottom_up` with full leaves.
#include <algorithm>
#include <cmath>

#include "core/contract/registry.hpp"
#include "core/families/restructure/moving_tree.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {
namespace {

template <class S>
class Reinsertion final : public CountedStrategy<S>,
                          public AnswersSelfPairs,
                          public AnswersProbes<S>,
                          public TakesPlanChanges<S>,
                          public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  Reinsertion(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
              const Params& params)
      : CountedStrategy<S>(scene, motion),
        tried_(params.number("tried")),
        growth_(S(params.number("growth"))),
        least_(S(params.number("least"))),
        lane_price_(S(params.number("lane_price"))),
        visits_(std::uint32_t(params.number("visits"))),
        price_(params.number("price")),
        start_(std::move(topologies)),
        bodies_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()) {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) assign(body);
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return bodies_[body].tree; });
  }

  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    probes_.start_over();
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      if (bodies_[body].moved) assign(body);
      bodies_[body].start_over();
      refit(body);
      bodies_[body].tree.settle();
    }
  }
  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) {
        refit(body);
        restructure(body);
      }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) {
      return bodies_[body].tree.empty() ? Box<double>{} : to_double(bodies_[body].tree.root_box());
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (tests >= budget.box_tests) {
        ++status.pending;
        continue;
      }
      const std::uint64_t tests_before = tests;
      status.pending +=
          query_.run(side(pair.first), side(pair.second), out, tests, rest_of(budget, tests)).pending;
      bodies_[pair.first].tests += double(tests - tests_before);
      if (pair.second != pair.first) bodies_[pair.second].tests += double(tests - tests_before);
    }
    this->count_.add(Counter::box_tests, tests);
    return status;
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view;
    view.topology = bodies_[body].tree.topology(view.boxes);
    return view;
  }
  std::size_t bytes() const override {
    std::size_t total = bodies_.capacity() * sizeof(Body) + scores_.capacity() * sizeof(S) +
                        chosen_.capacity() * sizeof(Scored) + near_bodies_.bytes() + query_.bytes() +
                        probes_.bytes();
    for (const Body& body : bodies_) total += body.tree.bytes();
    for (const Topology& topology : start_) total += topology.bytes();
    return total;
  }

 protected:
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    probes_.answer(
        probes, [&](std::uint32_t body) { return side(body); }, this->triangle_stats_, tests,
        this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    plans_changed_ = true;  // new vertices have their own plans
    for (const BodyChange& own : body_changes(this->scene_, change)) {
      std::vector<Box<double>> boxes;
      Topology topology = bodies_[own.body].tree.topology(boxes);
      std::vector<Box<S>> narrow(boxes.size());
      for (std::size_t i = 0; i < boxes.size(); ++i)
        for (int axis = 0; axis < 3; ++axis) {
          narrow[i].lower[axis] = S(boxes[i].lower[axis]);
          narrow[i].upper[axis] = S(boxes[i].upper[axis]);
        }
      start_[own.body] =
          edited_topology(std::move(topology), std::move(narrow), own, this->scene_.primitives(own.body),
                          this->sampled_.positions(own.body));
      assign(own.body);
      refit(own.body);
      bodies_[own.body].tree.settle();
    }
  }

 private:
  struct Body {
    MovingTree<S> tree;
    bool moved = false;  ///< the tree differs from the initial one
    double tests = 0;    ///< box tests of the queries since the last frame
    double credit = 0;   ///< number of children that may be tried
    void start_over() {
      tests = 0;
      credit = 0;
    }
  };
  struct Scored {
    S score;
    std::uint32_t node;
  };

  WideSide<S> side(std::uint32_t body) { return {&bodies_[body].tree, body}; }

  void assign(std::uint32_t index) {
    Body& body = bodies_[index];
    body.tree.assign(start_[index], this->scene_.primitives(index), active_kernel_set());
    body.moved = false;
    body.start_over();
  }
  void refit(std::uint32_t index) {
    MovingTree<S>& tree = bodies_[index].tree;
    tree.positions_changed();
    if (tree.empty()) return;
    tree.refit(this->sampled_.positions(index));
    count_boxes(this->count_, tree.node_count(), tree.leaf_vertex_count());
  }

  void restructure(std::uint32_t index) {
    Body& body = bodies_[index];
    MovingTree<S>& tree = body.tree;
    const double tests = std::exchange(body.tests, 0.0), all = double(start_[index].primitives.size());
    if (tree.empty() || tests <= price_) return;
    choose(body, tests);
    body.credit = std::min(body.credit + tried_ * all, std::max(1.0, tried_ * all));
    std::uint64_t visits = scores_.size();
    for (const Scored& scored : chosen_) {
      if (body.credit < 1) break;
      visits += improve(body, scored.node);
    }
    this->count_.add(Counter::nodes_visited, visits);
  }

  /// Lists the nodes that have grown since they settled, in decreasing order of growth.
  void choose(Body& body, double tests) {
    MovingTree<S>& tree = body.tree;
    const auto nodes = tree.nodes();
    scores_.resize(nodes.size());
    const double surface = tree.growths(nodes, growth_, scores_.data());
    const S worth = S(price_ * surface / tests);
    chosen_.clear();
    for (std::size_t i = 0; i < nodes.size(); ++i)
      if (scores_[i] > worth) chosen_.push_back({scores_[i], nodes[i]});
    std::sort(chosen_.begin(), chosen_.end(), [](const Scored& a, const Scored& b) {
      return a.score != b.score ? a.score > b.score : a.node < b.node;
    });
  }

  /// Tries to move every child of a node, starting with the last. The node may have been replaced since it
  /// was chosen. Returns the number of nodes visited.
  std::uint64_t improve(Body& body, std::uint32_t node) {
    MovingTree<S>& tree = body.tree;
    std::uint64_t visits = 0;
    for (std::uint32_t lane = tree.node(node).count; lane-- > 0 && body.credit >= 1;) {
      if (lane >= tree.node(node).count || tree.node(node).count < 2) continue;
      body.credit -= 1;
      ++searches_;
      const auto found = tree.best_place(node, lane, lane_price_, least_, visits_);
      visits += found.visits;
      if (!(found.gain > 0)) continue;
      tree.move(found);
      body.moved = true;
      ++moves_;
    }
    if (tree.node(node).count > 0) tree.settle(node);
    return visits;
  }

  void counts_cleared() override { searches_ = moves_ = 0; }
  void add_counts(Counters& table) const override {
    table.add("reinsertions_tried", searches_);
    table.add("reinsertions", moves_);
  }

  double tried_;
  S growth_;
  S least_, lane_price_;
  std::uint32_t visits_;
  double price_;
  Topologies start_;
  std::vector<Body> bodies_;
  NearBodies near_bodies_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  WideProbes<S> probes_{this->scene_, this->sampled_};
  std::vector<S> scores_;
  std::vector<Scored> chosen_;
  bool plans_changed_ = false;
  std::uint64_t searches_ = 0, moves_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(reinsertion) {
  using namespace kbvh;
  return {make_entry<Reinsertion>({
      .id = "reinsertion",
      .title = "refit with reinsertion",
      .family = "restructuring",
      .citation = "Bittner et al. 2013; Meister & Bittner 2018",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::sah, .width = 8, .leaf_size = 1}},
      .parameters =
          {{"tried",
            "0.1",
            {},
            "maximum number of subtrees tried per frame, as a share of the primitives",
            0,
            1},
           {"growth",
            "1.3",
            {},
            "growth of a node's surface, as a factor since its children were last tried, from which on they "
            "are tried again",
            1,
            1e6},
           {"price",
            "20",
            {},
            "box tests of the next queries that the growth of a node must be expected to cost; trees that no "
            "query comes near are left alone",
            0,
            1e9},
           {"least",
            "0.02",
            {},
            "minimum gain of a move, as a share of the surface of the node that the subtree leaves",
            0,
            1},
           {"lane_price",
            "0.05",
            {},
            "cost of each child of a node, as a share of the surface of the node",
            0,
            1},
           {"visits", "16", {}, "maximum number of nodes visited by one search", 1, 1e6, Numbers::whole}},
  })};
}
