#pragma once
#include <optional>
#include <variant>

#include "core/contract/strategy.hpp"
#include "core/families/volumes/volume_hierarchy.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/volumes/aligned_box.hpp"
#include "core/topology/leaf_pairs.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh {

/// The shared part of strategies over hierarchies of bounding volumes: every volume of a moving body is
/// recomputed at each frame, leaves first. `Hierarchies` lists the kinds; an instance uses one. Each kind is
/// a hierarchy of one body, such as VolumeHierarchy and DopHierarchy.
template <class S, class... Hierarchies>
class HierarchyStrategy : public CountedStrategy<S>,
                          public AnswersProbes<S>,
                          public TakesPlanChanges<S>,
                          public TakesGeometryChanges<S>,
                          public AnswersSelfPairs {
  template <class Hierarchy>
  struct State {
    std::vector<Hierarchy> bodies;
    typename Hierarchy::Scratch scratch;
  };

 public:
  static constexpr Foresight foresight = Foresight::none;

  /// `kind` is the index of the used kind among Hierarchies.
  HierarchyStrategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                    std::size_t kind)
      : CountedStrategy<S>(scene, motion), near_bodies_(scene.pairs(), scene.body_count()) {
    std::size_t index = 0;
    (void)((index++ == kind && (state_.template emplace<State<Hierarchies>>(), true)) || ...);
    const std::vector<Cover> cover = covers(scene);
    on_bodies([&](auto& bodies) {
      for (std::uint32_t body = 0; body < scene.body_count(); ++body)
        bodies.emplace_back(std::move(topologies[body]), scene.primitives(body), cover[body]);
    });
  }

  /// Computes all volumes. Hierarchies that keep anything of earlier frames forget it (`restore`).
  void reset_to(double /*t*/) override {
    plans_changed_ = false;
    near_bodies_.start_over();
    on_bodies([&](auto& bodies) {
      for (std::uint32_t body = 0; body < bodies.size(); ++body) {
        if constexpr (requires { bodies[body].restore(); }) bodies[body].restore();
        update(bodies[body], body);
      }
    });
  }

  void advance_to(double /*t*/) override {
    on_bodies([&](auto& bodies) {
      for (std::uint32_t body = 0; body < bodies.size(); ++body)
        if (this->scene_.moving(body) || plans_changed_) update(bodies[body], body);
    });
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    std::visit([&](auto& state) { search(state, out, tests, budget, status); }, state_);
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  /// The strategy reads only positions, so this only records that any body may move from now on.
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    plans_changed_ = true;
  }

  /// Edits the topologies locally, guided by boxes, and lays them out again: O(nodes) for each changed body.
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    plans_changed_ = true;  // new vertices have their own plans
    on_bodies([&](auto& bodies) {
      for (const BodyChange& body_change : body_changes(this->scene_, change)) {
        auto& body = bodies[body_change.body];
        const Primitives& primitives = this->scene_.primitives(body_change.body);
        const S* positions = this->sampled_.positions(body_change.body);
        VolumeHierarchy<Box<S>> boxes(body.topology(), primitives, Cover::vertices);
        boxes.refit(positions);
        body.assign(edited_topology(body.topology(), boxes.volumes(), body_change, primitives, positions),
                    primitives);
        update(body, body_change.body);
      }
    });
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return on_bodies([&](const auto& bodies) { return view_of(bodies[body]); });
  }

  std::size_t bytes() const override {
    return std::visit(
        [&](const auto& state) {
          std::size_t total = near_bodies_.bytes() + probe_order_.bytes() + state.scratch.bytes() +
                              probe_stack_.capacity() * sizeof(ProbeNode<std::uint32_t>);
          for (const auto& body : state.bodies) total += body.bytes();
          return total;
        },
        state_);
  }

 protected:
  /// Follows rays node by node, in the boxes around volumes.
  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    on_bodies([&](const auto& bodies) {
      const auto box_of = [&](std::uint32_t body) {
        return bodies[body].empty() ? Box<double>{} : to_double(enclosing_box(bodies[body].volume(0)));
      };
      const std::uint64_t all = answer_by_body(
          this->scene_, this->sampled_, probes, probe_order_, this->ray_bodies(), box_of,
          [&](std::uint32_t body, auto& search, std::uint64_t& tests) {
            const TopologyTree tree{bodies[body].topology(), [&](std::uint32_t node) {
                                      return enclosing_box(bodies[body].volume(node));
                                    }};
            return follow_probe(tree, search, body, this->scene_.primitives(body),
                                this->sampled_.positions(body), probe_stack_, tests, this->triangle_stats_);
          });
      this->count_.add(Counter::box_tests, all);
    });
  }

  /// Calls work(bodies) with the hierarchies of all bodies, of the used kind.
  template <class Work>
  decltype(auto) on_bodies(Work&& work) {
    return std::visit([&](auto& state) -> decltype(auto) { return work(state.bodies); }, state_);
  }
  template <class Work>
  decltype(auto) on_bodies(Work&& work) const {
    return std::visit([&](const auto& state) -> decltype(auto) { return work(state.bodies); }, state_);
  }

 private:
  template <class Hierarchy>
  void search(State<Hierarchy>& state, PairBuffer& out, std::uint64_t& tests, const Budget& budget,
              QueryStatus& status) {
    auto& bodies = state.bodies;
    const auto box_of = [&](std::uint32_t body) {
      return bodies[body].empty() ? Box<double>{} : enclosing_box(bodies[body].volume(0));
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (tests >= budget.box_tests) {
        ++status.pending;
        continue;
      }
      Hierarchy &a = bodies[pair.first], &b = bodies[pair.second];
      if constexpr (requires { &Hierarchy::find_pairs; }) {
        status.pending +=
            Hierarchy::find_pairs(a, pair.first, b, pair.second, state.scratch, tests, budget, out);
      } else {
        LeafPairs<S> leaves(this->scene_, this->sampled_, pair.first, a.topology(), pair.second, b.topology(),
                            tests, out);
        status.pending += Hierarchy::search(a, b, state.scratch, tests, budget, leaves);
      }
    }
  }

  /// Returns `boxes` for the bodies of pairs that are answered by boxes; a point equals its box.
  static std::vector<Cover> covers(const SceneView<S>& scene) {
    const auto kind = [&](std::uint32_t body) { return scene.primitives(body).kind; };
    std::vector<Cover> covers(scene.body_count(), Cover::vertices);
    for (const BodyPair& pair : scene.pairs()) {
      if (kind(pair.first) == PrimitiveKind::polygons && kind(pair.second) == PrimitiveKind::polygons)
        continue;
      for (const std::uint32_t body : {pair.first, pair.second})
        if (kind(body) != PrimitiveKind::points) covers[body] = Cover::boxes;
    }
    return covers;
  }

  template <class Hierarchy>
  void update(Hierarchy& hierarchy, std::uint32_t body) {
    hierarchy.refit(this->sampled_.positions(body));
    const std::uint64_t nodes = hierarchy.topology().size();
    this->count_.add(Counter::nodes_visited, nodes);
    this->count_.add(Counter::values_written, nodes * (sizeof(typename Hierarchy::Volume) / sizeof(S)));
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }

  template <class Hierarchy>
  static AuditView view_of(const Hierarchy& hierarchy) {
    using V = typename Hierarchy::Volume;
    AuditView view{hierarchy.topology(), {}, {}};
    for (const V& volume : hierarchy.volumes()) view.boxes.push_back(enclosing_box(volume));
    if constexpr (!std::is_same_v<V, Box<S>>)
      view.volumes = std::make_shared<AuditedVolumes<V>>(hierarchy.volumes());
    return view;
  }

  NearBodies near_bodies_;
  std::variant<State<Hierarchies>...> state_;
  std::vector<ProbeNode<std::uint32_t>> probe_stack_;
  BodyOrder probe_order_;
  bool plans_changed_ = false;
};

/// A simple strategy over bounding volumes of any kind, which compares them by the template traversal
/// (core/topology/traversal.hpp). Nothing is specialised for speed; the wide hierarchies of boxes and
/// DopHierarchy are fast special cases.
template <class S, BoundingVolume... Volumes>
using VolumeStrategy = HierarchyStrategy<S, VolumeHierarchy<Volumes>...>;

}  // namespace kbvh
