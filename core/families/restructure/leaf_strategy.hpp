#pragma once
#include <vector>

#include "core/families/restructure/leaf_contents.hpp"
#include "core/families/restructure/tree_age.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {

/// The shared part of strategies that refit at every frame and restructure by exchanging the primitives of
/// leaves. A derived class implements `update(body)`; the queries of a frame add to the age of both trees.
template <class S>
class LeafStrategy : public EditedHierarchyStrategy<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  LeafStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params), bodies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) prepare(body);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (Body& body : bodies_) {
      body.contents.stop();
      body.age = {};
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      if (tests >= budget.box_tests) {
        ++status.pending;
        return;
      }
      const std::uint64_t tests_before = tests, found_before = out.size();
      status.pending +=
          this->query_
              .run(this->side(pair.first), this->side(pair.second), out, tests, rest_of(budget, tests))
              .pending;
      bodies_[pair.first].age.add(tests - tests_before, out.size() - found_before);
      if (pair.second != pair.first)
        bodies_[pair.second].age.add(tests - tests_before, out.size() - found_before);
    });
    this->count_.add(Counter::box_tests, tests);
    this->last_box_tests_ = tests;
    return status;
  }

  double growth() const override {
    double sum = 0;
    for (const Body& body : bodies_) sum += body.age.growth();
    return sum;
  }
  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + bodies_.capacity() * sizeof(Body);
    for (const Body& body : bodies_) total += body.contents.bytes();
    return total;
  }

 protected:
  struct Body {
    LeafContents<S> contents;
    TreeAge age;
  };

  void topology_changed(std::uint32_t body) override { prepare(body); }
  void answer_probes(double t, const Probes<S>& probes) override {
    Base::answer_probes(t, probes);
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      const RayWork& work = this->ray_work()[body];
      bodies_[body].age.add_rays(work.tests, work.rays);
    }
  }

  std::vector<Body> bodies_;

 private:
  void prepare(std::uint32_t body) {
    bodies_[body].contents.prepare(this->hierarchies_[body]);
    bodies_[body].age = {};
  }
};

}  // namespace kbvh
