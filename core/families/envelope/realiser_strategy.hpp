#pragma once
#include <cstdint>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/envelope/segment_envelope.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/realiser_rows.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// The shared part of strategies that keep the realisers of a wide hierarchy's boxes instead of the boxes
/// (RealiserRows). Queries run on the kernels of a refit's query.
template <class S>
class RealiserStrategy : public CountedStrategy<S>, public AnswersProbes<S> {
 public:
  RealiserStrategy(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies)
      : CountedStrategy<S>(scene, motion), motion_(motion), near_bodies_(scene.pairs(), scene.body_count()) {
    bodies_.resize(scene.body_count());
    for (std::uint32_t index = 0; index < scene.body_count(); ++index) {
      bodies_[index].rows.assign(std::move(topologies[index]), scene.primitives(index), active_kernel_set());
    }
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchy(body); });
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    std::uint64_t reads = make_visited();
    const auto side_of = [&](std::uint32_t body) { return lazy_side(body); };
    const auto make = [&](std::uint32_t index, std::uint32_t node) {
      Body& body = bodies_[index];
      reads += body.rows.make_wanted(node, this->sampled_, index, places_of(body));
    };
    const QueryStatus status =
        query_lazily(query_, near_bodies_, this->scene_.pairs(), budget, side_of, make, out, tests);
    this->count_.add(Counter::box_tests, tests);
    this->count_.add(Counter::positions_fetched, reads);
    return status;
  }

  std::optional<AuditView> audit_view(std::uint32_t index) const override {
    const auto& hierarchy = this->hierarchy(index);
    AuditView view{hierarchy.topology(), {}, {}};
    const auto size = view.topology.size();
    view.boxes.resize(size);
    for (std::uint32_t node = size; node-- > 0;) {
      const bool root = hierarchy.wide_parent(node) == WideHierarchy<S>::no_node;
      if (bodies_[index].rows.current(node))
        view.boxes[node] = to_double(hierarchy.box(node));  // the boxes that a query read
      else if (root)
        for (std::uint32_t child = 0; child < view.topology.nodes[0].count(); ++child)
          view.boxes[0].extend(view.boxes[view.topology.nodes[0].first() + child]);
      else
        view.boxes[node] = realised_box(index, node);
    }
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + query_.bytes() + probes_.bytes();
    for (const Body& body : bodies_)
      total += body.rows.bytes() + body.realisers.size() * sizeof(std::uint32_t);
    return total;
  }

 protected:
  struct Body {
    RealiserRows<S> rows;
    WideRealisers realisers;
  };

  WideHierarchy<S>& hierarchy(std::uint32_t index) { return bodies_[index].rows.hierarchy(); }
  const WideHierarchy<S>& hierarchy(std::uint32_t index) const { return bodies_[index].rows.hierarchy(); }

  /// Invalidates all boxes, because the positions changed.
  void new_frame(std::uint32_t index) { bodies_[index].rows.new_frame(motion_, index); }
  /// Computes all boxes from all positions.
  void refit(std::uint32_t index) {
    hierarchy(index).positions_changed();
    this->sampled_.fetch_all(index);
    hierarchy(index).refit(this->sampled_.positions(index));
    bodies_[index].rows.refitted();
  }

  SegmentMotion<S> motion_;
  NearBodies near_bodies_;
  std::vector<Body> bodies_;

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    std::uint64_t reads = make_visited();
    probes_.answer(
        probes, [&](std::uint32_t body) { return lazy_side(body); },
        [&](std::uint32_t index, std::uint32_t node) {
          Body& body = bodies_[index];
          reads += body.rows.make_wanted(node, this->sampled_, index, places_of(body));
        },
        this->triangle_stats_, tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
    this->count_.add(Counter::positions_fetched, reads);
  }

 private:
  /// Computes the boxes that recent queries visited, at least those of roots. Returns the positions read.
  std::uint64_t make_visited() {
    std::uint64_t reads = 0;
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      reads += body.rows.make_visited(this->sampled_, index, places_of(body));
    }
    return reads;
  }
  WideSide<S> lazy_side(std::uint32_t body) {
    return {.hierarchy = &hierarchy(body), .body = body, .stale = bodies_[body].rows.stale()};
  }
  /// Returns a callable for RealiserRows.
  static auto places_of(const Body& body) {
    return
        [&body, scalars = lane_scalars(body.rows.hierarchy().topology().width)](
            std::uint32_t node, std::uint32_t* /*room*/) { return body.realisers.data() + node * scalars; };
  }

  Box<double> realised_box(std::uint32_t index, std::uint32_t node) const {
    const Body& body = bodies_[index];
    Box<double> box;
    const auto coordinate = [&](std::uint32_t row) {
      const std::uint32_t place = body.realisers[body.rows.hierarchy().row_place(node, row)];
      return double(this->sampled_.position(index, place / 3)[place % 3]);
    };
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = coordinate(axis);
      box.upper[axis] = coordinate(3 + axis);
    }
    return box;
  }

  WideQuery<S> query_{this->scene_, this->sampled_};
  WideProbes<S> probes_{this->scene_, this->sampled_};
};

}  // namespace kbvh
