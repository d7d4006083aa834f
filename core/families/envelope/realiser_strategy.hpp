#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/envelope/kernels/wide_realisers.hpp"
#include "core/families/envelope/segment_envelope.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

/// The shared part of strategies that keep the realisers of a wide hierarchy's boxes instead of the boxes. A
/// query computes the boxes of a node at its first visit, from six coordinates per child, into the rows of
/// stored boxes, so that it runs on the kernels of a refit's query. Nodes that the last queries visited are
/// computed together beforehand: one call per node costs several times as much per coordinate.
template <class S, class Count>
class RealiserStrategy : public CountedStrategy<S, Count> {
 public:
  RealiserStrategy(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies)
      : CountedStrategy<S, Count>(scene, motion),
        motion_(motion),
        near_bodies_(scene.pairs(), scene.body_count()) {
    bodies_.resize(scene.body_count());
    for (std::uint32_t index = 0; index < scene.body_count(); ++index) {
      Body& body = bodies_[index];
      body.hierarchy.assign(std::move(topologies[index]), scene.primitives(index), active_kernel_set());
      body.stale.assign(body.hierarchy.node_count(), 1);
      body.visited.reserve(body.hierarchy.node_count());
    }
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return bodies_[body].hierarchy; });
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) make_visited(index);
    const auto side_of = [&](std::uint32_t body) -> WideSide<S> {
      return {.hierarchy = &bodies_[body].hierarchy, .body = body, .stale = bodies_[body].stale.data()};
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) { make_wanted(body, node); };
    const QueryStatus status =
        query_lazily(query_, near_bodies_, this->scene_.pairs(), budget, side_of, make, out, tests);
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  std::optional<AuditView> audit_view(std::uint32_t index) const override {
    const Body& body = bodies_[index];
    const auto& hierarchy = body.hierarchy;
    AuditView view{hierarchy.topology(), {}, {}};
    const auto size = view.topology.size();
    view.boxes.resize(size);
    for (std::uint32_t node = size; node-- > 0;) {
      const bool root = hierarchy.wide_parent(node) == WideHierarchy<S>::no_node;
      if (body.stale[root ? 0 : hierarchy.wide_parent(node)] == 0)
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
    std::size_t total = near_bodies_.bytes() + query_.bytes();
    for (const Body& body : bodies_)
      total += body.hierarchy.bytes() +
               (body.realisers.size() + body.visited.capacity()) * sizeof(std::uint32_t) + body.stale.size();
    return total;
  }

 protected:
  struct Body {
    WideHierarchy<S> hierarchy;
    WideRealisers realisers;
    std::vector<std::uint8_t> stale;  ///< by wide node: its rows are not current
    std::vector<std::uint32_t>
        visited;               ///< nodes whose rows were computed for queries since the list was emptied
    std::uint32_t frames = 0;  ///< since then
    const S* line_ends[2] = {nullptr, nullptr};  ///< stored positions between which vertices move, or null
    double line_times[2] = {0, 0};
  };

  /// Invalidates all rows, because the positions changed.
  void new_frame(std::uint32_t index) {
    Body& body = bodies_[index];
    body.hierarchy.positions_changed();
    std::fill(body.stale.begin(), body.stale.end(), std::uint8_t(1));
    ++body.frames;
  }
  /// Marks all rows as current, after a refit of all positions.
  void refit(std::uint32_t index) {
    Body& body = bodies_[index];
    body.hierarchy.positions_changed();
    this->sampled_.fetch_all(index);
    body.hierarchy.refit(this->sampled_.positions(index));
    std::fill(body.stale.begin(), body.stale.end(), std::uint8_t(0));
    body.visited.clear();
  }

  SegmentMotion<S> motion_;
  NearBodies near_bodies_;
  std::vector<Body> bodies_;

 private:
  static constexpr std::uint32_t visits_kept = 16;  ///< frames; then the visited nodes are collected anew
  static constexpr std::size_t made_together = 16;  ///< nodes

  void make_visited(std::uint32_t index) {
    Body& body = bodies_[index];
    if (body.hierarchy.empty()) return;
    if (body.frames >= visits_kept) {
      body.visited.clear();
      body.frames = 0;
    }
    if (body.visited.empty()) {
      if (body.stale[0] != 0) make_wanted(index, 0);  // a query starts with the box of the root
      return;
    }
    if (body.stale[body.visited[0]] != 0) make(index, body.visited);
  }
  void make_wanted(std::uint32_t index, std::uint32_t node) {
    bodies_[index].visited.push_back(node);
    make(index, {&bodies_[index].visited.back(), 1});
  }

  void make(std::uint32_t index, std::span<const std::uint32_t> nodes) {
    Body& body = bodies_[index];
    const std::uint32_t width = body.hierarchy.topology().width;
    const std::size_t scalars = lane_scalars(width);
    const auto& kernels = wide_realiser_kernels<S>(body.hierarchy.kernels());
    const bool on_lines = body.line_ends[0] != nullptr && !this->sampled_.all_current(index);
    alignas(64) S values[made_together * lane_scalars(8)], ends[made_together * lane_scalars(8)];
    std::uint32_t vertices[lane_scalars(8)];
    while (!nodes.empty()) {
      const std::size_t many = std::min(nodes.size(), made_together);
      for (std::size_t i = 0; i < many; ++i) {
        const std::uint32_t* places = body.realisers.data() + nodes[i] * scalars;
        if (on_lines) {
          kernels.collect(places, body.line_ends[0], scalars, values + i * scalars);
          kernels.collect(places, body.line_ends[1], scalars, ends + i * scalars);
          continue;
        }
        if (!this->sampled_.all_current(index)) {
          for (std::size_t k = 0; k < scalars; ++k) vertices[k] = places[k] / 3;
          this->sampled_.fetch(index, {vertices, scalars});
        }
        kernels.collect(places, this->sampled_.positions(index), scalars, values + i * scalars);
      }
      if (on_lines) {
        this->count_.add(Counter::positions_fetched, many * scalars / 3);
        round_chord(values, ends, many * scalars, body.line_times[0], body.line_times[1], this->time(),
                    values);
      }
      const auto place = kernels.place(width);
      for (std::size_t i = 0; i < many; ++i) {
        place(body.hierarchy.arrays(), values + i * scalars, nodes[i]);
        body.stale[nodes[i]] = 0;
      }
      nodes = nodes.subspan(many);
    }
  }

  Box<double> realised_box(std::uint32_t index, std::uint32_t node) const {
    const Body& body = bodies_[index];
    Box<double> box;
    const auto coordinate = [&](std::uint32_t row) {
      const std::uint32_t place = body.realisers[body.hierarchy.row_place(node, row)];
      return double(this->sampled_.position(index, place / 3)[place % 3]);
    };
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = coordinate(axis);
      box.upper[axis] = coordinate(3 + axis);
    }
    return box;
  }

  WideQuery<S> query_{this->scene_, this->sampled_};
};

}  // namespace kbvh
