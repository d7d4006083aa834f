#pragma once
#include <cstdint>
#include <span>

#include "core/contract/strategy.hpp"
#include "core/families/wide/near_bodies.hpp"

namespace kbvh {

/// The shared part of strategies that bring one body after the other to the current time: a derived class
/// implements `update(body)`. Bodies that cannot move are updated at `reset` only, until a plan changes.
template <class S>
class BodyByBody : public CountedStrategy<S>, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  BodyByBody(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : CountedStrategy<S>(scene, motion), near_bodies_(scene.pairs(), scene.body_count()) {}

  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) update(body);
  }
  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body)
      if (this->scene_.moving(body) || plans_changed_) update(body);
  }
  /// The strategy reads only positions, so this only records that any body may move from now on.
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }

 protected:
  virtual void update(std::uint32_t body) = 0;

  NearBodies near_bodies_;

 private:
  bool plans_changed_ = false;
};

}  // namespace kbvh
