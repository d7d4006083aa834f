#pragma once
#include <optional>

#include "core/contract/strategy.hpp"
#include "core/families/build/built_tree.hpp"
#include "core/families/build/curve_order.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// The shared part of strategies that build a new tree at every frame. `Builder` is constructible from Params
/// and has
///   build(BuiltTree&, CurveOrder&, const PrimitiveList&)   over the boxes that the order has taken
///   bytes()
/// Of the given topologies, only the leaf size counts. Bodies that cannot move are built at `reset` only.
template <class S, class Count, class Builder>
class BuiltStrategy : public CountedStrategy<S, Count>,
                      public AnswersSelfPairs,
                      public TakesPlanChanges<S>,
                      public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  BuiltStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies& topologies,
                const Params& params)
      : CountedStrategy<S, Count>(scene, motion),
        builder_(params),
        near_bodies_(scene.pairs(), scene.body_count()) {
    trees_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      trees_[body].start(topologies[body].leaf_size, active_kernel_set());
      lists_.emplace_back(scene.primitives(body));
    }
  }

  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    for (std::uint32_t body = 0; body < trees_.size(); ++body) build(body);
    check_layouts(
        this->scene_.pairs(), [&](std::uint32_t body) -> const auto& { return trees_[body]; });
  }
  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < trees_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) build(body);
  }
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) {
      return trees_[body].empty() ? Box<double>{} : to_double(trees_[body].root_box());
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      const WideSide<S> first{&trees_[pair.first], pair.first}, second{&trees_[pair.second], pair.second};
      status.pending += tests >= budget.box_tests
                            ? 1
                            : query_.run(first, second, out, tests, rest_of(budget, tests)).pending;
    }
    this->count_.add(Counter::box_tests, tests);
    return status;
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view;
    view.topology = trees_[body].topology(view.boxes);
    return view;
  }
  std::size_t bytes() const override {
    std::size_t total = builder_.bytes() + order_.bytes() + near_bodies_.bytes() + query_.bytes() +
                        trees_.capacity() * sizeof(trees_[0]) + lists_.capacity() * sizeof(lists_[0]);
    for (const BuiltTree<S>& tree : trees_) total += tree.bytes();
    for (const PrimitiveList& list : lists_) total += list.bytes();
    return total;
  }

 protected:
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    plans_changed_ = true;  // new vertices have their own plans
    for (const BodyChange& body_change : body_changes(this->scene_, change)) {
      lists_[body_change.body] = PrimitiveList(this->scene_.primitives(body_change.body));
      build(body_change.body);
    }
  }

 private:
  void build(std::uint32_t body) {
    const Primitives& primitives = this->scene_.primitives(body);
    BuiltTree<S>& tree = trees_[body];
    order_.take(primitives, lists_[body], this->sampled_.positions(body), tree.kernels());
    builder_.build(tree, order_, lists_[body]);
    const std::uint64_t boxes = tree.node_count() + tree.leaf_count();
    this->count_.add(Counter::nodes_visited, boxes);
    this->count_.add(Counter::values_written, 6 * (boxes + lists_[body].count));
    this->count_.add(Counter::vertex_reads, primitives.vertices.size());
  }

  Builder builder_;
  std::vector<BuiltTree<S>> trees_;
  std::vector<PrimitiveList> lists_;
  CurveOrder<S> order_;
  NearBodies near_bodies_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  bool plans_changed_ = false;
};

}  // namespace kbvh
