#pragma once
#include <optional>
#include <utility>

#include "core/contract/reports_work.hpp"
#include "core/contract/strategy.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/surface_sums.hpp"
#include "core/families/wide/swept_hierarchies.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Computes the box of a leaf from its unique vertices; 4 lanes, the last of which is padding.
template <class S>
inline Box<S> leaf_box(std::span<const std::uint32_t> vertices, const S* positions) {
  return LaneBox<S>::of(vertices, positions).box();
}

/// The shared part of strategies with stored boxes, including pairs and rays: a derived class only implements
/// `update(body)`. Bodies that cannot move are updated at `reset` only. Most strategies derive from
/// StoredHierarchyStrategy, which also accepts changes of plans.
template <class S>
class FixedPlansHierarchyStrategy : public CountedStrategy<S>, public AnswersProbes<S>, public ReportsWork {
 public:
  FixedPlansHierarchyStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion,
                              Topologies topologies, const Params& /*params*/,
                              KernelSet kernels = active_kernel_set());
  ~FixedPlansHierarchyStrategy() override;

  /// Restarts with the initial topologies, or those of the last change of geometry.
  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    probes_.start_over();
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) {
      hierarchies_[body].undo_edits(this->scene_.primitives(body));
      hierarchies_[body].positions_changed();
      refit(body);
    }
  }

  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) {
        hierarchies_[body].positions_changed();
        update(body);
      }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    for_near_bodies(tests, [&](const BodyPair& pair) {
      status.pending +=
          tests >= budget.box_tests
              ? 1
              : query_.run(side(pair.first), side(pair.second), out, tests, rest_of(budget, tests)).pending;
    });
    this->count_.add(Counter::box_tests, tests);
    last_box_tests_ = tests;
    return status;
  }
  std::uint64_t last_box_tests() const override { return last_box_tests_; }
  std::uint64_t last_ray_tests() const override { return last_ray_tests_; }
  double surface() override {
    double sum = 0;
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body)
      if (this->scene_.moving(body)) sum += surface_ratio(hierarchies_[body]);
    return sum;
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const WideHierarchy<S>& hierarchy = hierarchies_[body];
    std::vector<std::uint32_t> nodes;
    AuditView view{hierarchy.built_topology(nodes), {}, {}};
    for (const std::uint32_t node : nodes) view.boxes.push_back(to_double(hierarchy.box(node)));
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
    return total + near_bodies_.bytes() + query_.bytes() + probes_.bytes() + (swept_ ? swept_->bytes() : 0);
  }

 protected:
  /// Brings one moving body's bounds to the current time.
  virtual void update(std::uint32_t body) = 0;
  /// Edits the topologies locally and lays the hierarchies out again: O(nodes) for each changed body. For
  /// strategies that declare geometry changes and do not rebuild.
  void edit_geometry(const GeometryChange<S>& change) {
    plans_changed_ = true;  // new vertices have their own plans
    swept_.reset();         // it uses the old topologies
    for (const BodyChange& body_change : body_changes(this->scene_, change)) {
      WideHierarchy<S>& hierarchy = hierarchies_[body_change.body];
      const Primitives& primitives = this->scene_.primitives(body_change.body);
      const S* positions = this->sampled_.positions(body_change.body);
      std::vector<std::uint32_t> nodes;
      Topology topology = hierarchy.built_topology(nodes);
      std::vector<Box<S>> boxes;
      for (const std::uint32_t node : nodes) boxes.push_back(hierarchy.box(node));
      hierarchy.assign(
          edited_topology(std::move(topology), std::move(boxes), body_change, primitives, positions),
          primitives, hierarchy.kernels());
      topology_changed(body_change.body);
      update(body_change.body);
    }
  }
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    probes_.answer(
        probes, [&](std::uint32_t body) { return ray_side(body); },
        [&](std::uint32_t body, std::uint32_t node) { make_row(body, node); }, this->triangle_stats_, tests,
        this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
    last_ray_tests_ = tests;
  }
  /// Returns the work of the last call's rays in each body.
  std::span<const RayWork> ray_work() const { return probes_.work(); }
  /// Returns the data of a body that rays read. Lazy strategies add the marks of stale nodes; `make_row` is
  /// then called for these.
  virtual WideSide<S> ray_side(std::uint32_t body) { return side(body); }
  virtual void make_row(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
  /// Called when the topology of a body's hierarchy has changed, to update dependent data.
  virtual void topology_changed(std::uint32_t /*body*/) {}
  /// Implements the broad phase of contacts by one refit to both ends of the motion, on the topologies of its
  /// first call: for `swept_pairs` of strategies that declare contacts.
  void sweep(std::span<const S* const> before, PairBuffer& out) {
    if (!swept_)
      swept_.emplace(
          this->scene_, [&](std::uint32_t body) -> const auto& { return hierarchies_[body]; });
    swept_->refit(before, this->sampled_);
    for (const auto& hierarchy : hierarchies_)
      count_boxes(this->count_, hierarchy.topology().size(), 2 * hierarchy.leaf_vertex_count());
    std::uint64_t tests = 0;
    swept_->pairs(query_, out, tests);
    this->count_.add(Counter::box_tests, tests);
  }
  /// Calls work(pair) for each pair of the scene's bodies whose boxes overlap, or for all pairs if there are
  /// few.
  template <class Work>
  void for_near_bodies(std::uint64_t& tests, Work&& work) {
    const auto box_of = [&](std::uint32_t body) {
      return hierarchies_[body].empty() ? Box<double>{} : to_double(hierarchies_[body].box(0));
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) work(this->scene_.pairs()[i]);
  }
  /// Returns one side of a query of stored boxes.
  WideSide<S> side(std::uint32_t body) { return {&hierarchies_[body], body}; }
  void refit(std::uint32_t body) { hierarchies_[body].refit(this->sampled_.positions(body)); }
  /// Adds the work of one whole refit of a body to the counters.
  void count_refit(std::uint32_t body) {
    count_boxes(this->count_, hierarchies_[body].topology().size(), hierarchies_[body].leaf_vertex_count());
  }
  void refit_counted(std::uint32_t body) {
    refit(body);
    count_refit(body);
  }

  std::vector<WideHierarchy<S>> hierarchies_;
  NearBodies near_bodies_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  WideProbes<S> probes_{this->scene_, this->sampled_};
  bool plans_changed_ = false;
  std::uint64_t last_box_tests_ = 0, last_ray_tests_ = 0;
  std::optional<SweptHierarchies<S>> swept_;  ///< made at the first request for contacts
};

template <class S>
FixedPlansHierarchyStrategy<S>::FixedPlansHierarchyStrategy(const SceneView<S>& scene,
                                                            const SampledMotion<S>& motion,
                                                            Topologies topologies, const Params& /*params*/,
                                                            KernelSet kernels)
    : CountedStrategy<S>(scene, motion), near_bodies_(scene.pairs(), scene.body_count()) {
  hierarchies_.resize(scene.body_count());
  for (std::uint32_t body = 0; body < scene.body_count(); ++body)
    hierarchies_[body].assign(std::move(topologies[body]), scene.primitives(body), kernels);
  check_layouts(
      scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchies_[body]; });
}

template <class S>
FixedPlansHierarchyStrategy<S>::~FixedPlansHierarchyStrategy() = default;

/// Does the same for plans that may change.
template <class S>
class StoredHierarchyStrategy : public FixedPlansHierarchyStrategy<S>, public TakesPlanChanges<S> {
 public:
  using FixedPlansHierarchyStrategy<S>::FixedPlansHierarchyStrategy;

 protected:
  /// The strategy reads only positions, so this only records that any body may move from now on.
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    this->plans_changed_ = true;
  }
};

/// Does the same where geometry changes, by `edit_geometry`, and also answers pairs within a body.
template <class S>
class EditedHierarchyStrategy : public StoredHierarchyStrategy<S>,
                                public AnswersSelfPairs,
                                public TakesGeometryChanges<S> {
 public:
  using StoredHierarchyStrategy<S>::StoredHierarchyStrategy;

 protected:
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }
};

// Compiled once, in stored_hierarchy.cpp, instead of with every strategy.
extern template class StoredHierarchyStrategy<float>;
extern template class StoredHierarchyStrategy<double>;
extern template class FixedPlansHierarchyStrategy<float>;
extern template class FixedPlansHierarchyStrategy<double>;

}  // namespace kbvh
