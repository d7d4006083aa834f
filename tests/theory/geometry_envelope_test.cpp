// Insertion and deletion while a kinetic AABB tree or BoxTree runs: between any two changes, its log of bound
// changes is proved to equal the exact envelopes of the vertices then below each node, at all times and from
// the first instant.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numeric>

#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::geometry_envelope_test {
namespace {

using namespace kbvh::theory;

/// A change of a bound at an event, as reported.
template <class S>
struct Told {
  std::uint32_t body, node, side, old_vertex, new_vertex;
  double begin;
  Crossing<S> crossing;
};

template <class S>
struct Listener {
  std::vector<Told<S>>* log;
  template <class T>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<T>& now) {
    if (now.exact != nullptr)
      log->push_back({body, node, side, old_vertex, new_vertex, now.begin, *now.exact});
  }
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

/// Adds plans of new vertices at the end: their keyframes are unused, because they have plans of their own.
void add_vertices(StoredPlans& plans, std::uint32_t count) {
  StoredPlans grown = plans;
  grown.vertex_count += count;
  grown.positions.clear();
  for (std::size_t k = 0; k < plans.times.size(); ++k) {
    const auto begin = plans.positions.begin() + std::ptrdiff_t(3 * k * plans.vertex_count);
    grown.positions.insert(grown.positions.end(), begin, begin + std::ptrdiff_t(3) * plans.vertex_count);
    grown.positions.resize(grown.positions.size() + std::size_t(3) * count, 0.0);
  }
  plans = std::move(grown);
}

template <class S>
OwnKnots own_knots(double t, const PlanChange<S>& change, const S* position) {
  OwnKnots knots;
  knots.times = {t};
  knots.positions.assign(position, position + 3);
  knots.times.insert(knots.times.end(), change.times.begin(), change.times.end());
  knots.positions.insert(knots.positions.end(), change.positions.begin(), change.positions.end());
  std::copy(change.velocity, change.velocity + 3, knots.velocity);
  return knots;
}

template <class S, template <class, class, class> class Tree = KineticAabbTree>
class Prover {
 public:
  using Forest = KineticForest<S, AvlQueue<S>, Listener<S>, Tree>;

  /// Not 0: at every change, parts chosen at random are also rebuilt, if the tree can do so.
  Prover(const TestScene<S>& test, const BuilderConfig& builder, std::uint64_t rebuild_seed = 0)
      : random_(rebuild_seed),
        rebuilds_(rebuild_seed != 0),
        script_(test.script),
        frames_(frame_times(test.scene, 2)),
        changing_(test.scene),
        view_(changing_.scene()),
        playback_(test.scene) {
    playback_.seek(frames_.front());
    forest_.emplace(view_, ClipMotion<S>(playback_), build_topologies(view_, playback_, builder), count_,
                    Listener<S>{&log_});
    forest_->reset(frames_.front());
    for (const auto& body : test.scene.bodies) plans_.push_back(stored_plans(body.plans));
    begin_epoch(frames_.front());
  }

  EnvelopeReport run() {
    auto step = script_.steps.begin();
    for (const double t : frames_) {
      playback_.seek(t);
      forest_->advance(t);
      for (; step != script_.steps.end() && step->time == t; ++step) {
        end_epoch(t);
        change(t, *step);
        begin_epoch(t);
      }
    }
    forest_->advance(frames_.back() + 3);
    end_epoch(frames_.back() + 3);
    return total_;
  }

 private:
  /// Rebuilds up to three parts of each body, possibly one below another.
  void rebuild(double t) {
    forest_->advance(t);  // changed plans may cross immediately
    const ClipMotion<S> motion(playback_);
    for (std::uint32_t body = 0; body < plans_.size(); ++body)
      for (std::uint32_t i = random_.below(4); i > 0; --i) {
        auto& tree = forest_->tree(body);
        std::vector<std::uint32_t> order;
        tree.compacted_topology(order);
        if (order.empty()) continue;
        const auto at = std::uint32_t(order.size()) >> random_.below(8);
        const std::uint32_t node = order[random_.below(std::max(1u, at))];
        tree.rebuild_below(node, tree.box_of(node, motion), motion,
                           random_.below(2) == 0 ? BuildMethod::median : BuildMethod::sah);
      }
  }
  void change(double t, const typename PlanScript<S>::Step& step) {
    for (const PlanChange<S>& plan : step.changes)
      plans_[plan.body].own[plan.vertex] = own_knots(t, plan, playback_.position(plan.body, plan.vertex));
    playback_.change_plans(t, step.changes);
    forest_->plans_changed(t, step.changes);
    changing_.apply(step.geometry, playback_);
    for (const auto& vertex : step.geometry.vertices) {
      StoredPlans& plans = plans_[vertex.body];
      add_vertices(plans, 1);
      plans.own[plans.vertex_count - 1] = own_knots(t, vertex.plan, vertex.position);
    }
    forest_->geometry_changed(t, view_, ClipMotion<S>(playback_), body_changes(view_, step.geometry));
    if constexpr (requires { forest_->tree(0).own_side(0); })
      if (rebuilds_) rebuild(t);
  }

  /// Returns the realisers in the order of the compacted topology; `no_bound` if a tree stores none.
  std::vector<std::uint32_t> realisers(std::uint32_t body) const {
    std::vector<std::uint32_t> all;
    const auto& tree = forest_->tree(body);
    for (const std::uint32_t node : order_[body])
      for (Side side = 0; side < 6; ++side) {
        bool stored = true;
        if constexpr (requires { tree.own_side(node); }) stored = node == 0 || tree.own_side(node) == side;
        all.push_back(stored ? tree.realiser(node, side) : no_bound);
      }
    return all;
  }
  void begin_epoch(double t) {
    begin_ = t;
    log_.clear();
    order_.assign(plans_.size(), {});
    topologies_.clear();
    start_.clear();
    for (std::uint32_t body = 0; body < plans_.size(); ++body) {
      topologies_.push_back(forest_->tree(body).compacted_topology(order_[body]));
      EXPECT_EQ(check_topology(topologies_.back(), view_.primitives(body)), "");
      start_.push_back(realisers(body));
    }
  }
  void end_epoch(double t) {
    for (std::uint32_t body = 0; body < plans_.size(); ++body) {
      EnvelopeReport report;
      try {
        report = prove(t, body);
      } catch (const std::logic_error& error) {  // an inconsistent log
        report.violation = error.what();
      }
      if (!report.violation.empty())
        report.violation =
            "from " + std::to_string(begin_) + " body " + std::to_string(body) + ": " + report.violation;
      total_.add(report);
    }
  }
  EnvelopeReport prove(double until, std::uint32_t body) const {
    const ExactMotion motion(plans_[body], begin_, until);
    std::vector<std::uint32_t> place(forest_->tree(body).topology().size(), 0);
    for (std::uint32_t i = 0; i < order_[body].size(); ++i) place[order_[body][i]] = i;
    std::vector<BoundChange> log;
    for (const Told<S>& told : log_)
      if (told.body == body)
        log.push_back(
            {place[told.node], told.side, told.old_vertex, told.new_vertex, when_of(told.crossing, motion)});
    return check_envelopes(motion, vertices_below(topologies_[body], view_.primitives(body)), start_[body],
                           log, realisers(body));
  }

  Random random_;
  bool rebuilds_;
  const PlanScript<S>& script_;
  std::vector<double> frames_;
  ChangingScene<S> changing_;
  SceneView<S> view_;
  Playback<S> playback_;
  Counters count_;
  std::vector<Told<S>> log_;
  std::optional<Forest> forest_;
  std::vector<StoredPlans> plans_;
  double begin_ = 0;
  std::vector<std::vector<std::uint32_t>> order_, start_;
  std::vector<Topology> topologies_;
  EnvelopeReport total_;
};

class GeometryEnvelopes : public testing::TestWithParam<std::string> {};

template <class S>
void prove_scene(const std::string& name) {
  const auto test = synthetic_scene<S>(name, 2);
  EnvelopeReport total;
  for (const std::uint32_t width : {2u, 8u})
    for (const std::uint32_t leaf_size : {1u, 4u}) {
      const EnvelopeReport report = Prover<S>(test, {.width = width, .leaf_size = leaf_size}).run();
      EXPECT_EQ(report.violation, "") << name << ", width " << width << ", leaf size " << leaf_size;
      EXPECT_EQ(report.net, report.envelope);
      total.add(report);
    }
  std::printf("%s, %s: %llu bounds, %llu entries, %llu net changes, %llu envelope breakpoints\n",
              name.c_str(), sizeof(S) == 4 ? "float" : "double", (unsigned long long)total.bounds,
              (unsigned long long)total.logged, (unsigned long long)total.net,
              (unsigned long long)total.envelope);
  EXPECT_GT(total.net, 0u);
}

template <class S>
void prove_boxtree(const std::string& name) {
  const auto test = synthetic_scene<S>(name, 2);
  EnvelopeReport total;
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah})
    for (const std::uint32_t leaf_size : {1u, 4u}) {
      const EnvelopeReport report =
          Prover<S, KineticBoxTree>(test, {.method = method, .width = 2, .leaf_size = leaf_size}).run();
      EXPECT_EQ(report.violation, "") << name << ", " << kbvh::name(method) << ", leaf size " << leaf_size;
      EXPECT_EQ(report.net, report.envelope);
      total.add(report);
      const EnvelopeReport rebuilt =
          Prover<S, KineticBoxTree>(test, {.method = method, .width = 2, .leaf_size = leaf_size}, 5).run();
      EXPECT_EQ(rebuilt.violation, "")
          << name << " with rebuilding, " << kbvh::name(method) << ", leaf size " << leaf_size;
      EXPECT_EQ(rebuilt.net, rebuilt.envelope);
    }
  std::printf("%s, %s, BoxTree: %llu bounds, %llu entries, %llu net changes, %llu envelope breakpoints\n",
              name.c_str(), sizeof(S) == 4 ? "float" : "double", (unsigned long long)total.bounds,
              (unsigned long long)total.logged, (unsigned long long)total.net,
              (unsigned long long)total.envelope);
  EXPECT_GT(total.net, 0u);
}

TEST_P(GeometryEnvelopes, Float) {
  prove_scene<float>(GetParam());
}
TEST_P(GeometryEnvelopes, Double) {
  prove_scene<double>(GetParam());
}
TEST_P(GeometryEnvelopes, BoxTreeFloat) {
  prove_boxtree<float>(GetParam());
}
TEST_P(GeometryEnvelopes, BoxTreeDouble) {
  prove_boxtree<double>(GetParam());
}
INSTANTIATE_TEST_SUITE_P(Scenes, GeometryEnvelopes, testing::ValuesIn(geometry_scene_names()),
                         [](const auto& param_info) { return param_info.param; });

// ---- Seeded fault: the proof must catch it ---------------------------------------------------------------

/// A tree that does not propagate an insertion up to the root: the root keeps its realisers.
template <class S, class Queue, class Observer>
class ForgetfulBoxTree : public KineticBoxTree<S, Queue, Observer> {
 public:
  using Base = KineticBoxTree<S, Queue, Observer>;
  using Base::Base;
  void insert(double t, std::uint32_t primitive, const Primitives& primitives,
              const SampledMotion<S>& motion) {
    if (this->topology().empty()) return Base::insert(t, primitive, primitives, motion);
    const std::array<std::uint32_t, 6> before = this->root_realisers();
    Base::insert(t, primitive, primitives, motion);
    for (Side side = 0; side < 6; ++side) {
      if (this->bounds_[side].realiser == before[side]) continue;
      this->bounds_[side].realiser = before[side];
      this->certifier_.withdraw(this->slot(0, side));
    }
  }
};

TEST(GeometryEnvelopeFaults, ABoxTreeThatDoesNotLookFurtherUpIsCaught) {
  const auto test = synthetic_scene<double>("geometry_changes", 2);
  const BuilderConfig builder{.width = 2, .leaf_size = 1};
  EXPECT_TRUE((Prover<double, KineticBoxTree>(test, builder).run().holds()));
  EXPECT_FALSE((Prover<double, ForgetfulBoxTree>(test, builder).run().holds()));
}

// ---- What an edit of a BoxTree costs ---------------------------------------------------------------------

/// Small triangles that wander through a cube whose volume grows with their number.
Scene<double> wandering_triangles(std::uint32_t count) {
  Random random(count);
  Body<double> body;
  body.name = "triangles";
  const double edge = std::cbrt(double(count));
  std::vector<double> positions;
  for (std::uint32_t p = 0; p < count; ++p)
    body.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
  for (int keyframe = 0; keyframe < 2; ++keyframe)
    for (std::uint32_t p = 0; p < count; ++p) {
      double centre[3];
      for (double& x : centre) x = edge * random.unit();
      for (int corner = 0; corner < 3; ++corner)
        for (const double x : centre) positions.push_back(x + random.unit());
    }
  body.plans = FlightPlans<double>(3 * count, {0, 1}, std::move(positions));
  Scene<double> scene;
  scene.name = "wandering triangles";
  scene.bodies.push_back(std::move(body));
  return scene;
}

struct EditCost {
  double certificates = 0, nodes = 0;  ///< per edit: recomputed certificates, nodes visited by searches
};

/// Returns the cost of the changes halfway through the clip.
EditCost cost_of_edits(std::uint32_t count, const GeometryChange<double>& change) {
  const Scene<double> scene = wandering_triangles(count);
  ChangingScene<double> changing(scene);
  const SceneView<double> view(changing.scene());
  Playback<double> playback(scene);
  playback.seek(0);
  Counters counting;
  KineticBoxForest<double, AvlQueue<double>> forest(
      view, ClipMotion<double>(playback), build_topologies(view, playback, {.width = 2, .leaf_size = 1}),
      counting);
  forest.reset(0);
  playback.seek(0.5);
  forest.advance(0.5);
  auto& tree = forest.tree(0);
  tree.search_cost().forget();
  changing.apply(change, playback);
  forest.geometry_changed(0.5, view, ClipMotion<double>(playback), body_changes(view, change));
  const double edits = double(change.primitives.size() + change.removed_primitives.size());
  // Each has two searches: for its realiser and for its first failure.
  return {double(tree.search_cost().searches) / 2 / edits, double(tree.search_cost().nodes) / edits};
}

TEST(BoxTreeEdits, AreLocal) {
  EditCost first[2];
  for (const std::uint32_t count : {128u, 512u, 2048u, 8192u, 18432u}) {
    Random random(count);
    GeometryChange<double> inserted, removed;
    std::vector<std::uint32_t> ids(count);
    std::iota(ids.begin(), ids.end(), 0u);
    for (std::uint32_t i = 0; i < 100; ++i) {
      std::swap(ids[i], ids[i + random.below(count - i)]);
      removed.removed_primitives.push_back({0, ids[i]});
      inserted.primitives.push_back({0, {3 * ids[i], 3 * ids[i] + 1, 3 * ids[i] + 2}});
    }
    const EditCost costs[2] = {cost_of_edits(count, inserted), cost_of_edits(count, removed)};
    for (const int kind : {0, 1}) {
      if (count == 128) first[kind] = costs[kind];
      std::printf("%u triangles, %s: %.2f certificates made again, %.0f nodes looked at\n", count,
                  kind == 0 ? "insertion" : "removal", costs[kind].certificates, costs[kind].nodes);
      // Six, and those of new nodes; further up only where realisers change.
      EXPECT_LT(costs[kind].certificates, 16);
      // Searches are not logarithmic (Z&W s.6), but less than linear.
      EXPECT_LT(costs[kind].nodes, first[kind].nodes * std::pow(double(count) / 128, 0.85) + 1);
    }
  }
}

}  // namespace
}  // namespace kbvh::test::geometry_envelope_test
