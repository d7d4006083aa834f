#pragma once
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/build/curve_order.hpp"
#include "core/families/wide/near_bodies.hpp"

namespace kbvh {

/// The shared part of strategies that build a new search structure at every frame. `Body` is the structure of
/// one body; it is default-constructible and has bytes(). Derived classes implement `build` and
/// `find_candidates`. Bodies that cannot move are built at `reset` only.
template <class S, class Body>
class BuiltEachFrame : public CountedStrategy<S>,
                       public AnswersSelfPairs,
                       public TakesPlanChanges<S>,
                       public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  BuiltEachFrame(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : CountedStrategy<S>(scene, motion),
        bodies_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      lists_.emplace_back(scene.primitives(body));
  }

  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    start();
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      list_changed(body);
      build(body);
    }
  }
  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->scene_.moving(body) || plans_changed_) build(body);
  }
  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + bodies_.capacity() * sizeof(bodies_[0]) +
                        lists_.capacity() * sizeof(lists_[0]);
    for (const Body& body : bodies_) total += body.bytes();
    for (const PrimitiveList& list : lists_) total += list.bytes();
    return total;
  }

 protected:
  /// Prepares for the builds of `reset`.
  virtual void start() {}
  /// Prepares a body with a new list of primitives. A `build` follows.
  virtual void list_changed(std::uint32_t /*body*/) {}
  /// Builds a body from its positions at the current time.
  virtual void build(std::uint32_t body) = 0;

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    plans_changed_ = true;  // new vertices have their own plans
    for (const BodyChange& body_change : body_changes(this->scene_, change)) {
      lists_[body_change.body] = PrimitiveList(this->scene_.primitives(body_change.body));
      list_changed(body_change.body);
      build(body_change.body);
    }
  }
  /// Counts the vertices that a build reads, and the boxes that it writes: one per primitive, and `more`.
  void count_build(std::uint32_t body, std::uint64_t more = 0) {
    this->count_.add(Counter::values_written, 6 * (more + lists_[body].count));
    this->count_.add(Counter::vertex_reads, this->scene_.primitives(body).vertices.size());
  }

  const KernelSet kernels_ = active_kernel_set();
  std::vector<Body> bodies_;
  std::vector<PrimitiveList> lists_;
  NearBodies near_bodies_;

 private:
  bool plans_changed_ = false;
};

}  // namespace kbvh
