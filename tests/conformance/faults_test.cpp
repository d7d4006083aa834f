// The conformance suite can fail: it catches strategies with one seeded fault each by the same check that the
// registered strategies pass.

#include <gtest/gtest.h>

#include <cmath>

#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "core/topology/leaf_pairs.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::faults_test {
namespace {

enum class Fault {
  none,
  one_ulp,        // one box too small by one unit in the last place, on one side
  dropped_child,  // an inner box that forgets its last child
  stale_frame,    // one frame is not refitted
  swapped_axis,   // y and z of one box exchanged
  repeated_pair,  // the first pair is reported twice
  lost_pair,      // the last pair is not reported
  too_loose,      // a valid box, but not tight, although tight is declared
  wrong_order,    // pairs reported with the bodies exchanged
};

template <class S, Fault fault>
class FaultyRefit : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) override {
    const QueryStatus status = Base::find_candidates(t, out, budget);
    if (out.empty()) return status;
    if constexpr (fault == Fault::repeated_pair) out.push_back(out.front());
    if constexpr (fault == Fault::lost_pair) out.resize(out.size() / 2);
    if constexpr (fault == Fault::wrong_order) {
      std::swap(out.front().body_a, out.front().body_b);
      std::swap(out.front().primitive_a, out.front().primitive_b);
    }
    return status;
  }

 private:
  void update(std::uint32_t body) override {
    ++frame_;
    if (fault == Fault::stale_frame && frame_ == 5) return;
    this->refit(body);
    auto& hierarchy = this->hierarchies_[body];
    const Topology& topology = hierarchy.topology();
    if (topology.size() < 4) return;
    const std::uint32_t faulty = topology.size() - 2;
    Box<S> box = hierarchy.box(faulty);
    if constexpr (fault == Fault::one_ulp) box.upper[1] = std::nextafter(box.upper[1], S(-1e38));
    if constexpr (fault == Fault::too_loose) box.upper[1] = std::nextafter(box.upper[1], S(1e38));
    if constexpr (fault == Fault::swapped_axis) {
      std::swap(box.lower[1], box.lower[2]);
      std::swap(box.upper[1], box.upper[2]);
    }
    hierarchy.set_box(faulty, box);
    if constexpr (fault == Fault::dropped_child) {
      const TopologyNode node = topology.nodes[1];
      if (!node.is_leaf()) hierarchy.set_box(1, hierarchy.box(node.first()));
    }
  }
  std::uint64_t frame_ = 0;
};

template <class S>
using Sound = FaultyRefit<S, Fault::none>;
template <class S>
using OneUlp = FaultyRefit<S, Fault::one_ulp>;
template <class S>
using DroppedChild = FaultyRefit<S, Fault::dropped_child>;
template <class S>
using StaleFrame = FaultyRefit<S, Fault::stale_frame>;
template <class S>
using SwappedAxis = FaultyRefit<S, Fault::swapped_axis>;
template <class S>
using RepeatedPair = FaultyRefit<S, Fault::repeated_pair>;
template <class S>
using LostPair = FaultyRefit<S, Fault::lost_pair>;
template <class S>
using TooLoose = FaultyRefit<S, Fault::too_loose>;
template <class S>
using WrongOrder = FaultyRefit<S, Fault::wrong_order>;

/// Finds pairs of leaves from boxes read off the realisers, and keeps nothing from frame to frame.
template <class S, class Forest>
QueryStatus implicit_candidates(const Forest& forest, const SceneView<S>& scene,
                                const SampledMotion<S>& motion, std::vector<NodePair>& stack, PairBuffer& out,
                                const Budget& budget) {
  std::uint64_t tests = 0;
  for (const BodyPair& pair : scene.pairs()) {
    const auto &a = forest.tree(pair.first), &b = forest.tree(pair.second);
    BoxCache<S> cache_a(a.topology().size()), cache_b(b.topology().size());
    LeafPairs<S> leaves(scene, motion, pair.first, a.topology(), pair.second, b.topology(), tests, out);
    RealiserBoxes<S> boxes_a(a.realisers(0), motion, pair.first, cache_a);
    RealiserBoxes<S> boxes_b(b.realisers(0), motion, pair.second, cache_b);
    traverse(a.topology(), boxes_a, b.topology(), boxes_b, stack, tests, budget, leaves);
  }
  return {};
}

/// A kinetic tree that loses one event: it leaves the queue without being handled.
template <class S>
class LostEvent : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;
  LostEvent(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
      : Strategy<S>(scene, motion), forest_(scene, motion, std::move(topologies), count_) {}
  void reset_to(double t) override { forest_.reset(t); }
  void advance_to(double t) override {
    while (forest_.due(t))
      if (++events_ == 20)
        forest_.queue().pop();
      else
        forest_.handle_next();
  }
  QueryStatus find_candidates(double, PairBuffer& out, const Budget& budget) override {
    return implicit_candidates<S>(forest_, this->scene_, this->sampled_, stack_, out, budget);
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view{forest_.tree(body).topology(), {}, {}};
    for (std::uint32_t node = 0; node < view.topology.size(); ++node)
      view.boxes.push_back(
          to_double(box_of_realisers(forest_.tree(body).realisers(node), this->sampled_, body)));
    return view;
  }
  std::size_t bytes() const override { return forest_.bytes(); }

 private:
  Counters count_;
  KineticForest<S, AvlQueue<S>> forest_;
  std::vector<NodePair> stack_;
  std::uint64_t events_ = 0;
};

enum class LazyFault : std::uint8_t {
  none,
  small_margin,  // boxes have three quarters of the margin that the motion may use
  half_bound,    // the bound on the motion is halved
};

/// Inflated boxes that are kept as long as the bound on the motion allows, in their simplest form.
template <class S, LazyFault fault>
class FaultyMargin : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::step_bound;
  FaultyMargin(const SceneView<S>& scene, const SteppedMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params), motion_(motion), moved_(scene.body_count(), 0) {}
  void reset_to(double t) override {
    Base::reset_to(t);
    last_ = t;
    for (std::uint32_t body = 0; body < moved_.size(); ++body) inflate(body);
  }
  void advance_to(double t) override {
    Base::advance_to(t);
    last_ = t;
  }

 private:
  static constexpr double margin = 0.2;
  void inflate(std::uint32_t body) {
    this->refit(body);
    moved_[body] = 0;
    auto& hierarchy = this->hierarchies_[body];
    const S by = S(fault == LazyFault::small_margin ? 0.75 * margin : margin);
    for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
      Box<S> box = hierarchy.box(node);
      for (int axis = 0; axis < 3; ++axis) {
        box.lower[axis] -= by;
        box.upper[axis] += by;
      }
      hierarchy.set_box(node, box);
    }
  }
  void update(std::uint32_t body) override {
    double way = motion_.displacement_bound(body, last_, this->time());
    if (fault == LazyFault::half_bound) way /= 2;
    moved_[body] += way;
    if (moved_[body] > margin - 1e-3) inflate(body);
  }
  SteppedMotion<S> motion_;
  std::vector<double> moved_;
  double last_ = 0;
};
template <class S>
using SoundMargin = FaultyMargin<S, LazyFault::none>;
template <class S>
using SmallMargin = FaultyMargin<S, LazyFault::small_margin>;
template <class S>
using HalfBound = FaultyMargin<S, LazyFault::half_bound>;

/// Boxes below the root that are made at a query's first request. With the fault, every fifth node loses its
/// mark without being made.
template <class S, LazyFault fault>
class FaultyLazy : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;
  QueryStatus find_candidates(double, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    for (const BodyPair& pair : this->scene_.pairs()) {
      const auto a = lazy_side(pair.first), b = lazy_side(pair.second);
      this->query_.start_lazy(a, b, budget);
      while (const auto wanted = this->query_.step(a, b, out, tests)) {
        if (wanted.first != wanted.none) make(pair.first, wanted.first);
        if (wanted.second != wanted.none) make(pair.second, wanted.second);
      }
    }
    return {};
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    auto view = Base::audit_view(body);
    for (std::uint32_t node = 0; node < view->topology.size(); ++node) {
      const std::uint32_t parent = this->hierarchies_[body].wide_parent(node);
      view->stale.push_back(!stale_.empty() && parent != this->hierarchies_[body].no_node &&
                            stale_[body][parent]);
    }
    return view;
  }

 private:
  WideSide<S> lazy_side(std::uint32_t body) {
    stale_.resize(this->hierarchies_.size());
    stale_[body].resize(this->hierarchies_[body].node_count());
    return {.hierarchy = &this->hierarchies_[body], .body = body, .stale = stale_[body].data()};
  }
  void update(std::uint32_t body) override {
    this->refit(body);  // only the root's box is used
    const std::uint32_t nodes = this->hierarchies_[body].node_count();
    stale_.resize(this->hierarchies_.size());
    stale_[body].assign(nodes, 1);
    auto arrays = this->hierarchies_[body].arrays();
    const std::size_t row = lane_scalars(this->hierarchies_[body].topology().width);
    for (std::size_t i = 0; i < nodes * row; ++i) arrays.child_bounds[i] *= S(0.5);
  }
  void make(std::uint32_t body, std::uint32_t node) {
    stale_[body][node] = 0;
    if (fault != LazyFault::none && ++made_ % 5 == 0) return;
    this->hierarchies_[body].refit_nodes(this->sampled_.positions(body), node, node + 1);
  }
  std::vector<std::vector<std::uint8_t>> stale_;
  std::uint64_t made_ = 0;
};
template <class S>
using SoundLazy = FaultyLazy<S, LazyFault::none>;
template <class S>
using ForgetfulLazy = FaultyLazy<S, LazyFault::half_bound>;
/// While the switch is on, forgets certificates near the root, which are not checked from then on.
template <class S>
class ForgetfulQueue : public AvlQueue<S> {
 public:
  using AvlQueue<S>::AvlQueue;
  void schedule(const Event& event) {
    if (!forgets || event.depth > 3) AvlQueue<S>::schedule(event);
  }
  bool forgets = false;
};

/// A kinetic tree that, when geometry changes, repairs leaves and their surroundings, but not the
/// certificates of distant ancestors.
template <class S, bool faulty>
class LocalRepair : public Strategy<S>, public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;
  LocalRepair(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
      : Strategy<S>(scene, motion), motion_(motion), forest_(scene, motion, std::move(topologies), count_) {}
  void reset_to(double t) override { forest_.reset(t); }
  void advance_to(double t) override { forest_.advance(t); }
  void follow_geometry(double t, const GeometryChange<S>& change) override {
    forest_.queue().forgets = faulty;
    forest_.geometry_changed(t, this->scene_, motion_, body_changes(this->scene_, change));
    forest_.queue().forgets = false;
  }
  QueryStatus find_candidates(double, PairBuffer& out, const Budget& budget) override {
    return implicit_candidates<S>(forest_, this->scene_, this->sampled_, stack_, out, budget);
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    std::vector<std::uint32_t> order;
    AuditView view{forest_.tree(body).compacted_topology(order), {}, {}};
    for (const std::uint32_t node : order)
      view.boxes.push_back(
          to_double(box_of_realisers(forest_.tree(body).realisers(node), this->sampled_, body)));
    return view;
  }
  std::size_t bytes() const override { return forest_.bytes(); }

 private:
  ClipMotion<S> motion_;
  Counters count_;
  KineticForest<S, ForgetfulQueue<S>> forest_;
  std::vector<NodePair> stack_;
};
template <class S>
using RepairsAll = LocalRepair<S, false>;
template <class S>
using ForgetsAncestors = LocalRepair<S, true>;

Info info(const char* id) {
  Info result;
  result.id = id;
  result.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  return result;
}

template <template <class> class Strategy>
std::string violation(const char* id, Tightness tightness = Tightness::tight, const char* scene = "soups",
                      std::uint32_t frames_per_keyframe = 7) {
  StrategyEntry entry = make_entry<Strategy>(info(id));
  entry.info.tightness = tightness;
  const BuilderConfig& builder = entry.info.topology.preferred;
  const std::uint32_t l = frames_per_keyframe;
  return check(entry, synthetic_scene<float>(scene, l), l, {}, builder) + "|" +
         check(entry, synthetic_scene<double>(scene, l), l, {}, builder);
}

void expect_caught(const std::string& violations, const std::string& expected) {
  const std::size_t bar = violations.find('|');
  EXPECT_NE(violations.substr(0, bar).find(expected), std::string::npos) << "in float: " << violations;
  EXPECT_NE(violations.substr(bar + 1).find(expected), std::string::npos) << "in double: " << violations;
}

TEST(Faults, SoundRefitPasses) {
  EXPECT_EQ(violation<Sound>("sound"), "|");
}
TEST(Faults, OneUlpTooSmall) {
  expect_caught(violation<OneUlp>("one_ulp"), "protrudes");
}
TEST(Faults, DroppedChild) {
  expect_caught(violation<DroppedChild>("dropped_child"), "t = ");
}
TEST(Faults, StaleFrame) {
  expect_caught(violation<StaleFrame>("stale_frame"), "protrudes");
}
TEST(Faults, SwappedAxis) {
  expect_caught(violation<SwappedAxis>("swapped_axis"), "protrudes");
}
TEST(Faults, RepeatedPair) {
  expect_caught(violation<RepeatedPair>("repeated_pair"), "more than once");
}
TEST(Faults, LostPair) {
  expect_caught(violation<LostPair>("lost_pair"), "not among the candidates");
}
TEST(Faults, TooLooseThoughDeclaredTight) {
  expect_caught(violation<TooLoose>("too_loose"), "not tight");
}
TEST(Faults, BodiesExchanged) {
  expect_caught(violation<WrongOrder>("wrong_order"), "malformed");
}
TEST(Faults, SoundMarginPasses) {
  for (const char* scene : {"soups", "plan_changes", "keyframes_a_millionth_apart"})
    for (const std::uint32_t l : {1u, 7u, 30u})
      EXPECT_EQ(violation<SoundMargin>("sound_margin", Tightness::conservative, scene, l), "|") << scene << l;
}
TEST(Faults, MarginTooSmall) {
  // The fastest vertex flies along an axis, at the side of its box: at frames that use up most of the margin.
  expect_caught(violation<SmallMargin>("small_margin", Tightness::conservative, "all_cross_at_once", 100),
                "protrudes");
}
TEST(Faults, BoundOnMotionTooSmall) {
  expect_caught(violation<HalfBound>("half_bound", Tightness::conservative, "soups", 30), "protrudes");
}
TEST(Faults, SoundLazyPasses) {
  EXPECT_EQ(violation<SoundLazy>("sound_lazy"), "|");
}
TEST(Faults, BoxesNotMadeWhenAsked) {
  expect_caught(violation<ForgetfulLazy>("forgetful"), "t = ");
}
TEST(Faults, LostEvent) {
  expect_caught(violation<LostEvent>("lost_event"), "protrudes");
}

template <template <class> class Strategy>
std::string violation_with_changing_geometry(const char* id) {
  Info described = info(id);
  described.topology.preferred.leaf_size = 1;
  const StrategyEntry entry = make_entry<Strategy>(described);
  const BuilderConfig builder = entry.info.topology.preferred;
  return check(entry, synthetic_scene<float>("geometry_changes_shared", 7), 7, {}, builder) + "|" +
         check(entry, synthetic_scene<double>("geometry_changes_shared", 7), 7, {}, builder);
}
TEST(Faults, LocalRepairOfGeometryPasses) {
  EXPECT_EQ(violation_with_changing_geometry<RepairsAll>("repairs_all"), "|");
}
TEST(Faults, AncestorsForgottenWhenGeometryChanges) {
  expect_caught(violation_with_changing_geometry<ForgetsAncestors>("forgets_ancestors"), "protrudes");
}

}  // namespace
}  // namespace kbvh::test::faults_test
