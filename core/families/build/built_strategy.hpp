#pragma once
#include <optional>

#include "core/contract/reports_work.hpp"
#include "core/families/build/built_each_frame.hpp"
#include "core/families/build/built_tree.hpp"
#include "core/families/build/curve_order.hpp"
#include "core/families/wide/shared_query.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// The shared part of strategies that build a new tree at every frame. `Builder` is constructible from Params
/// and has
///   build(BuiltTree&, CurveOrder&, const PrimitiveList&)   over the boxes that the order has taken
///   bytes()
/// and may have
///   build(Workers&, BuiltTree&, CurveOrder&, const PrimitiveList&)   the same tree on the threads of Workers
///   searched()                                                      clusters searched by all builds: counted
/// Of the given topologies, only the leaf size counts.
///
/// With several threads (the parameter `threads`), they share the build if the builder lets them, the search
/// of pairs, and the triangle tests.
template <class S, class Builder>
class BuiltStrategy : public BuiltEachFrame<S, BuiltTree<S>>, public AnswersProbes<S>, public ReportsWork {
  using Base = BuiltEachFrame<S, BuiltTree<S>>;

 protected:
  using Base::bodies_;
  using Base::lists_;
  using Base::near_bodies_;

  /// Returns a function of a body that returns its box.
  auto root_boxes() const {
    return [this](std::uint32_t body) {
      return bodies_[body].empty() ? Box<double>{} : to_double(bodies_[body].root_box());
    };
  }

 public:
  BuiltStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies& topologies,
                const Params& params)
      : Base(scene, motion), builder_(params) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      bodies_[body].start(topologies[body].leaf_size, this->kernels_);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    probes_.start_over();
    check_layouts(
        this->scene_.pairs(), [&](std::uint32_t body) -> const auto& { return bodies_[body]; });
  }
  /// A budget is spent in single-threaded order.
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    Workers& workers = this->sampled_.workers();
    if (workers.several() && budget.box_tests == Budget{}.box_tests && !watches_searches()) {
      share_query(workers, out);
      return {};
    }
    QueryStatus status;
    std::uint64_t tests = 0;
    for (const std::uint32_t i : near_bodies_.find(root_boxes(), tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (tests >= budget.box_tests) {
        ++status.pending;
        continue;
      }
      const WideSide<S> first{&bodies_[pair.first], pair.first}, second{&bodies_[pair.second], pair.second};
      const std::uint64_t tests_before = tests;
      const std::size_t pairs_before = out.size();
      status.pending += query_.run(first, second, out, tests, rest_of(budget, tests)).pending;
      searched(pair, tests - tests_before, out.size() - pairs_before);
    }
    this->count_.add(Counter::box_tests, tests);
    last_box_tests_ = tests;
    return status;
  }
  void confirm_candidates(double /*t*/, PairBuffer& pairs) override {
    shared_confirmation_.confirm(this->scene_, this->sampled_, pairs, this->triangle_stats_);
  }
  std::uint64_t last_box_tests() const override { return last_box_tests_; }
  std::uint64_t last_ray_tests() const override { return last_ray_tests_; }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view;
    view.topology = bodies_[body].topology(view.boxes);
    return view;
  }
  std::size_t bytes() const override {
    return Base::bytes() + builder_.bytes() + order_.bytes() + query_.bytes() + shared_query_.bytes() +
           shared_confirmation_.bytes() + probes_.bytes();
  }

 protected:
  void build(std::uint32_t body) override {
    take_boxes(body);
    if constexpr (shares)
      builder_.build(this->sampled_.workers(), bodies_[body], order_, lists_[body]);
    else
      builder_.build(bodies_[body], order_, lists_[body]);
    count_boxes(body);
  }
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    const auto side_of = [&](std::uint32_t body) -> WideSide<S> { return {&bodies_[body], body}; };
    probes_.answer(probes, side_of, this->triangle_stats_, tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
    last_ray_tests_ = tests;
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) followed(body, probes_.work()[body]);
  }
  void counts_cleared() override {
    if constexpr (searches) searched_before_ = builder_.searched();
  }
  void add_counts(Counters& table) const override {
    if constexpr (searches) table.add("clusters_searched", builder_.searched() - searched_before_);
  }
  /// Computes the boxes of a tree that keeps its shape.
  void refit(std::uint32_t body) {
    take_boxes(body);
    bodies_[body].fit(this->sampled_.workers(), order_.boxes());
    count_boxes(body);
  }
  /// Returns whether `searched` must be called: all pairs are then searched by one thread.
  virtual bool watches_searches() const { return false; }
  /// Reports the work of searching two bodies: box tests made, and pairs of primitives found. Not called by
  /// several threads unless `watches_searches`.
  virtual void searched(const BodyPair& /*pair*/, std::uint64_t /*tests*/, std::uint64_t /*found*/) {}
  /// Reports the work of a call's rays in a body.
  virtual void followed(std::uint32_t /*body*/, const RayWork& /*work*/) {}

 private:
  static constexpr bool shares = requires(Builder & builder, Workers& workers, BuiltTree<S>& tree,
                                          CurveOrder<S>& order, const PrimitiveList& list) {
    builder.build(workers, tree, order, list);
  };
  static constexpr bool searches = requires(const Builder& builder) { builder.searched(); };

  void share_query(Workers& workers, PairBuffer& out) {
    std::uint64_t tests = 0;
    shared_query_.start();
    for (const std::uint32_t i : near_bodies_.find(root_boxes(), tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      shared_query_.add({&bodies_[pair.first], pair.first}, {&bodies_[pair.second], pair.second});
    }
    shared_query_.run(workers, out, tests);
    this->count_.add(Counter::box_tests, tests);
    last_box_tests_ = tests;
  }
  void take_boxes(std::uint32_t body) {
    order_.take(this->sampled_.workers(), this->scene_.primitives(body), lists_[body],
                this->sampled_.positions(body), this->kernels_);
  }
  void count_boxes(std::uint32_t body) {
    const std::uint64_t boxes = bodies_[body].node_count() + bodies_[body].leaf_count();
    this->count_.add(Counter::nodes_visited, boxes);
    this->count_build(body, boxes);
  }

  Builder builder_;
  CurveOrder<S> order_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  SharedQuery<S> shared_query_{this->scene_, this->sampled_};
  SharedConfirmation<S> shared_confirmation_;
  WideProbes<S> probes_{this->scene_, this->sampled_};
  std::uint64_t last_box_tests_ = 0, last_ray_tests_ = 0, searched_before_ = 0;
};

// Compiled once, in built_strategy.cpp, instead of with every strategy.
extern template class BuiltEachFrame<float, BuiltTree<float>>;
extern template class BuiltEachFrame<double, BuiltTree<double>>;

}  // namespace kbvh
