// The conformance suite can fail: strategies with one seeded fault each are caught by the very check that the
// registered strategies pass.

#include <gtest/gtest.h>

#include <cmath>

#include "core/hierarchy/realiser_boxes.hpp"
#include "core/hierarchy/stored_hierarchy.hpp"
#include "core/kinetic/kinetic_forest.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test {
namespace {

enum class Fault {
  none,
  one_ulp,        // one box too small by one unit in the last place, on one side
  dropped_child,  // an inner box that forgets its last child
  stale_frame,    // one frame is not refitted
  swapped_axis,   // y and z of one box exchanged
  repeated_pair,  // the first pair is reported twice
  lost_pair,      // the last pair is not reported
  too_loose,      // a valid box, but not tight, though tight is declared
  wrong_order,    // pairs reported with the bodies exchanged
};

template <class S, class Count, Fault fault>
class FaultyRefit : public StoredHierarchyStrategy<S, Count> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& budget) override {
    const QueryStatus status = Base::candidates_at(t, out, budget);
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

template <class S, class C>
using Sound = FaultyRefit<S, C, Fault::none>;
template <class S, class C>
using OneUlp = FaultyRefit<S, C, Fault::one_ulp>;
template <class S, class C>
using DroppedChild = FaultyRefit<S, C, Fault::dropped_child>;
template <class S, class C>
using StaleFrame = FaultyRefit<S, C, Fault::stale_frame>;
template <class S, class C>
using SwappedAxis = FaultyRefit<S, C, Fault::swapped_axis>;
template <class S, class C>
using RepeatedPair = FaultyRefit<S, C, Fault::repeated_pair>;
template <class S, class C>
using LostPair = FaultyRefit<S, C, Fault::lost_pair>;
template <class S, class C>
using TooLoose = FaultyRefit<S, C, Fault::too_loose>;
template <class S, class C>
using WrongOrder = FaultyRefit<S, C, Fault::wrong_order>;

/// Pairs of leaves from boxes read off the realisers, without anything kept from frame to frame.
template <class S, class Count, class Forest>
QueryStatus implicit_candidates(const Forest& forest, const SceneView<S>& scene,
                                const SampledMotion<S>& motion, std::vector<NodePair>& stack, Count& count,
                                PairBuffer& out, const Budget& budget) {
  for (const BodyPair& pair : scene.pairs()) {
    const auto &a = forest.tree(pair.first), &b = forest.tree(pair.second);
    BoxCache<S> cache_a(a.topology().size()), cache_b(b.topology().size());
    LeafPairs<S, Count> leaves(scene, motion, pair.first, a.topology(), pair.second, b.topology(), count,
                               out);
    RealiserBoxes<S> boxes_a(a.realisers(0), motion, pair.first, cache_a);
    RealiserBoxes<S> boxes_b(b.realisers(0), motion, pair.second, cache_b);
    traverse(a.topology(), boxes_a, b.topology(), boxes_b, stack, count, budget, leaves);
  }
  return {};
}

/// A kinetic tree that loses one event: it leaves the queue and nobody handles it.
template <class S, class Count>
class LostEvent : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;
  LostEvent(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
      : Strategy<S>(scene, motion), forest_(scene, motion, std::move(topologies), count_) {}
  void reset(double t) override { forest_.reset(t); }
  void advance(double t) override {
    while (forest_.due(t))
      if (++events_ == 20)
        forest_.queue().pop();
      else
        forest_.handle_next();
  }
  QueryStatus candidates_at(double, PairBuffer& out, const Budget& budget) override {
    return implicit_candidates<S, Count>(forest_, this->scene_, this->sampled_, stack_, count_, out, budget);
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
  Count count_;
  KineticForest<S, AvlQueue<S>, Count> forest_;
  std::vector<NodePair> stack_;
  std::uint64_t events_ = 0;
};

/// Forgets certificates near the root while the switch is on: nobody watches them from then on.
template <class S>
class ForgetfulQueue : public AvlQueue<S> {
 public:
  using AvlQueue<S>::AvlQueue;
  void schedule(const Event& event) {
    if (!forgets || event.depth > 3) AvlQueue<S>::schedule(event);
  }
  bool forgets = false;
};

/// A kinetic tree that, when geometry changes, repairs leaves and what is near them, but not the certificates
/// of the ancestors far above.
template <class S, class Count, bool faulty>
class LocalRepair : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::whole_clip;
  LocalRepair(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
      : Strategy<S>(scene, motion), motion_(motion), forest_(scene, motion, std::move(topologies), count_) {}
  void reset(double t) override { forest_.reset(t); }
  void advance(double t) override { forest_.advance(t); }
  void geometry_changed(double t, const GeometryChange<S>& change) override {
    forest_.queue().forgets = faulty;
    forest_.geometry_changed(t, this->scene_, motion_, body_changes(this->scene_, change));
    forest_.queue().forgets = false;
  }
  QueryStatus candidates_at(double, PairBuffer& out, const Budget& budget) override {
    return implicit_candidates<S, Count>(forest_, this->scene_, this->sampled_, stack_, count_, out, budget);
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
  Count count_;
  KineticForest<S, ForgetfulQueue<S>, Count> forest_;
  std::vector<NodePair> stack_;
};
template <class S, class C>
using RepairsAll = LocalRepair<S, C, false>;
template <class S, class C>
using ForgetsAncestors = LocalRepair<S, C, true>;

Info info(const char* id) {
  Info result;
  result.id = id;
  result.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  return result;
}

template <template <class, class> class Strategy>
std::string violation(const char* id) {
  const StrategyEntry entry = make_entry<Strategy>(info(id));
  return check(entry, synthetic_scene<float>("soups"), 7, {}, entry.info.topology.preferred) + "|" +
         check(entry, synthetic_scene<double>("soups"), 7, {}, entry.info.topology.preferred);
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
TEST(Faults, LostEvent) {
  expect_caught(violation<LostEvent>("lost_event"), "protrudes");
}

template <template <class, class> class Strategy>
std::string violation_with_changing_geometry(const char* id) {
  Info described = info(id);
  described.can.geometry_changes = true;
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
}  // namespace kbvh::test
