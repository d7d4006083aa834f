#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/families/slabs/slab_query.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {

/// A strategy with stored boxes (`Base`: StoredHierarchyStrategy or FixedPlansHierarchyStrategy) whose query
/// compares the slabs of leaves where both bodies consist of triangles, and boxes otherwise. Slabs are made
/// when a query needs them; classes that override `reset_to` or `advance_to` must call
/// `blocks_[body].positions_changed()`.
template <class S, class Base>
class SlabStrategy : public Base {
 public:
  SlabStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params), blocks_(scene.body_count()), slabs_(scene) {
    find_accepted();
  }

  void reset_to(double t) override {
    for (SlabBlocks<S>& blocks : blocks_) blocks.positions_changed();
    Base::reset_to(t);
  }
  void advance_to(double t) override {
    for (std::uint32_t body = 0; body < blocks_.size(); ++body)
      if (this->scene_.moving(body) || this->plans_changed_) blocks_[body].positions_changed();
    Base::advance_to(t);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      if (tests >= budget.box_tests)
        ++status.pending;
      else if (accepted_[pair.first] != 0 && accepted_[pair.second] != 0)
        status.pending +=
            slabs_.run(slab_side(pair.first), slab_side(pair.second), out, tests, rest_of(budget, tests))
                .pending;
      else
        status.pending +=
            this->query_.run(box_side(pair.first), box_side(pair.second), out, tests, rest_of(budget, tests))
                .pending;
    });
    this->count_.add(Counter::box_tests, tests);
    this->last_box_tests_ = tests;
    return status;
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + slabs_.bytes();
    for (const SlabBlocks<S>& blocks : blocks_) total += blocks.bytes();
    return total;
  }

 protected:
  /// Finds the bodies that have slabs: those of triangles. If a leaf is one triangle, its box is the
  /// triangle's, and a slab would add nothing.
  void find_accepted() {
    accepted_.clear();
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body)
      accepted_.push_back(
          SlabQuery<S>::accepts(this->scene_.primitives(body)) &&
          (this->hierarchies_[body].empty() || this->hierarchies_[body].padded_leaf_size() > 1));
  }
  /// Returns the positions that queries read if they are not the scene's; else null.
  virtual const S* own_positions(std::uint32_t /*body*/) const { return nullptr; }
  /// Returns the scene's positions of a body, all current.
  virtual const S* scene_positions(std::uint32_t body) { return this->sampled_.positions(body); }

  std::vector<SlabBlocks<S>> blocks_;   ///< [body]
  std::vector<std::uint8_t> accepted_;  ///< [body]

 private:
  WideSide<S> box_side(std::uint32_t body) { return {&this->hierarchies_[body], body, own_positions(body)}; }
  typename SlabQuery<S>::Side slab_side(std::uint32_t body) {
    const S* own = own_positions(body);
    return {&this->hierarchies_[body], body, &blocks_[body], own != nullptr ? own : scene_positions(body)};
  }
  void counts_cleared() override { slabs_.clear_counts(); }
  void add_counts(Counters& table) const override {
    table.add("leaf_pairs", slabs_.leaf_pairs());
    table.add("leaf_pairs_separated", slabs_.separated());
  }

  SlabQuery<S> slabs_;
};

}  // namespace kbvh
