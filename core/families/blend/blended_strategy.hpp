#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/blend/blend_source.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/rows_on_demand.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// Boxes on demand that are blends of boxes made when the clip began.
template <class S>
class BlendedRows : public RowsOnDemand<S> {
 public:
  /// Computes the boxes of the root's children and of the nodes that recent queries visited. Returns the
  /// number of boxes written.
  std::uint64_t make_visited(const Blend<S>& blend) { return make(this->due(), blend); }
  /// Computes the boxes of a wide node's children, and records the visit. Returns the same.
  std::uint64_t make_wanted(std::uint32_t node, const Blend<S>& blend) {
    return make(this->visit(node), blend);
  }
  std::size_t bytes() const { return this->bytes_on_demand(); }

 private:
  std::uint64_t make(std::span<const std::uint32_t> nodes, const Blend<S>& blend) {
    auto& hierarchy = this->hierarchy();
    const WideArrays<S> arrays = hierarchy.arrays();
    blend_kernels<S>(hierarchy.kernels()).of(hierarchy.width())(arrays, blend, nodes.data(), nodes.size());
    std::uint64_t boxes = 0;
    for (const std::uint32_t node : nodes) {
      this->computed(node);
      boxes += arrays.nodes[node].count;
    }
    return boxes;
  }
};

/// The shared part of strategies whose boxes at any time are blends of stored boxes, known from the whole
/// clip. A derived class gives each moving body its source at every `reset`, which is part of the clip.
/// Frames cost O(terms) for each body, and O(terms) for each node that a query reads. Bodies at rest keep
/// tight boxes. Bodies whose vertices get their own plans are refitted at every frame from then on, because
/// their motion is no longer that of the clip.
template <class S>
class BlendedStrategy : public CountedStrategy<S>, public AnswersProbes<S>, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;

  BlendedStrategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies)
      : CountedStrategy<S>(scene, motion),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()),
        bodies_(scene.body_count()) {
    for (std::uint32_t index = 0; index < scene.body_count(); ++index)
      bodies_[index].rows.assign(std::move(topologies[index]), scene.primitives(index), active_kernel_set());
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchy(body); });
  }

  void reset_to(double t) override {
    near_bodies_.start_over();
    probes_.start_over();
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      body.rows.start_over();
      body.source.reset();
      // A body without primitives has no source of blended boxes.
      if (this->scene_.moving(index) && motion_.as_in_the_scene(index) && !hierarchy(index).empty())
        body.source = make_source(index, hierarchy(index), motion_.plans(index));
      body.known = !this->scene_.moving(index) ? Known::still
                   : body.source != nullptr    ? Known::blended
                                               : Known::refitted;
      if (body.known == Known::blended)
        new_blend(index, t);
      else
        refit(index);
    }
  }

  void advance_to(double t) override {
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      const Known known = bodies_[index].known;
      if (known == Known::blended)
        new_blend(index, t);
      else if (known == Known::refitted)
        refit(index);
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    make_visited();
    const QueryStatus status = query_lazily(
        query_, near_bodies_, this->scene_.pairs(), budget,
        [&](std::uint32_t index) { return lazy_side(index); },
        [&](std::uint32_t index, std::uint32_t node) { make_wanted(index, node); }, out, tests);
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes) {
      Body& body = bodies_[change.body];
      if (body.known == Known::refitted) continue;
      body.known = Known::refitted;
      body.rows.plans_changed();
      refit(change.body);
    }
  }

  /// Boxes that no query has read are computed for the audit, as a query would do.
  std::optional<AuditView> audit_view(std::uint32_t index) const override {
    const Body& body = bodies_[index];
    const WideHierarchy<S>& hierarchy = body.rows.hierarchy();
    AuditView view{hierarchy.topology(), {}, {}};
    WideHierarchy<S> unread = hierarchy;
    if (body.known == Known::blended)
      for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node)
        blend_kernels<S>(hierarchy.kernels()).of(hierarchy.width())(unread.arrays(), body.blend, &node, 1);
    for (std::uint32_t node = 0; node < view.topology.size(); ++node)
      view.boxes.push_back(to_double((body.rows.current(node) ? hierarchy : unread).box(node)));
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + query_.bytes() + probes_.bytes();
    for (const Body& body : bodies_)
      total += body.rows.bytes() + body.terms.terms.capacity() * sizeof(BlendTerm<S>) +
               (body.source ? body.source->bytes() : 0);
    return total;
  }

 protected:
  enum class Known : std::uint8_t {
    still,    ///< rests unless its plans change: tight boxes, made at the reset
    blended,  ///< follows the clip
    refitted  ///< vertices have their own plans: boxes are refitted at every frame
  };
  struct Body {
    BlendedRows<S> rows;
    std::unique_ptr<BlendSource<S>> source;  ///< for bodies that follow the clip
    BlendTerms<S> terms;
    Blend<S> blend{};  ///< a view of these terms
    Known known = Known::still;
  };

  /// Makes the source of a body that follows its keyframes; called by `reset_to`, body by body.
  virtual std::unique_ptr<BlendSource<S>> make_source(std::uint32_t body, WideHierarchy<S>& hierarchy,
                                                      const FlightPlans<S>& plans) = 0;
  const WideHierarchy<S>& hierarchy(std::uint32_t index) const { return bodies_[index].rows.hierarchy(); }
  WideHierarchy<S>& hierarchy(std::uint32_t index) { return bodies_[index].rows.hierarchy(); }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    make_visited();
    probes_.answer(
        probes, [&](std::uint32_t index) { return lazy_side(index); },
        [&](std::uint32_t index, std::uint32_t node) { make_wanted(index, node); }, this->triangle_stats_,
        tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }

  ClipMotion<S> motion_;
  NearBodies near_bodies_;
  std::vector<Body> bodies_;

 private:
  void new_blend(std::uint32_t index, double t) {
    Body& body = bodies_[index];
    body.source->blend_at(t, body.terms);
    body.blend = body.terms.view();
    body.rows.new_frame(motion_, index);
  }
  void refit(std::uint32_t index) {
    WideHierarchy<S>& refitted = hierarchy(index);
    refitted.positions_changed();
    this->sampled_.fetch_all(index);
    refitted.refit(this->sampled_.positions(index));
    bodies_[index].rows.refitted();
    count_boxes(this->count_, refitted.topology().size(), refitted.leaf_vertex_count());
  }
  void make_visited() {
    for (Body& body : bodies_)
      if (body.known == Known::blended) count_boxes(this->count_, body.rows.make_visited(body.blend), 0);
  }
  void make_wanted(std::uint32_t index, std::uint32_t node) {
    Body& body = bodies_[index];
    count_boxes(this->count_, body.rows.make_wanted(node, body.blend), 0);
  }
  WideSide<S> lazy_side(std::uint32_t body) {
    return {.hierarchy = &hierarchy(body), .body = body, .stale = bodies_[body].rows.stale()};
  }

  WideQuery<S> query_{this->scene_, this->sampled_};
  WideProbes<S> probes_{this->scene_, this->sampled_};
};

}  // namespace kbvh
