// Segments that are repaired where plans change within them: an interval join in its simplest form conforms,
// and does not with one seeded fault. (plan_changes_test.cpp and the suite: the registered strategies.)

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::plan_repairs_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  never_kept,     // no fault: every change begins a new segment
  leaf_left_out,  // changed leaves of the second body are not joined again
  root_left_out,  // the root's boxes are those before the change
  slabs_kept,     // the slabs of changed leaves are those before the change
  span_not_cut,   // a verdict from before the change is reported after it
};

template <class S, Fault fault>
class Repaired : public CountedStrategy<S>, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  Repaired(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params&)
      : CountedStrategy<S>(scene, motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), {}) {
    join_.use_slabs();
  }
  void reset_to(double /*t*/) override {
    bounds_.start();
    join();
  }
  void advance_to(double /*t*/) override {
    if (bounds_.advance()) join();
  }
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    std::vector<S> roots = fault == Fault::root_left_out ? exchange_roots({}) : std::vector<S>{};
    const auto slabs = fault == Fault::slabs_kept ? slab_stamps() : std::vector<std::vector<std::uint32_t>>{};
    const bool kept = fault != Fault::never_kept && bounds_.repair(changes);
    if (fault == Fault::slabs_kept) keep_slabs(slabs);
    if (kept) {
      if (fault == Fault::root_left_out) exchange_roots(roots);
      if (fault == Fault::span_not_cut) proved_before_ = proved_;
      return;
    }
    bounds_.plans_changed();
    join();
  }
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*none*/) override {
    const float fraction = float(bounds_.fraction(t));
    if (bounds_.any_changed()) {
      std::vector<ChangedParts> changed(bounds_.changed().begin(), bounds_.changed().end());
      if (fault == Fault::leaf_left_out) changed[1].clear();
      join_.repair(changed, fraction, IntervalJoin<S>::Reader::filter);
      filter_.repair(join_);
      bounds_.clear_changed();
    }
    const std::size_t open = filter_.read(bounds_.segment(), this->scene_, join_, fraction, out);
    proved_.assign(out.begin(), out.end() - std::ptrdiff_t(open));
    for (const PrimitivePair& pair : proved_before_)
      if (std::find(out.begin(), out.end(), pair) == out.end()) {
        out.insert(out.begin(), pair);
        proved_.push_back(pair);
      }
    return {};
  }
  void confirm_candidates(double t, PairBuffer& pairs) override {
    PairBuffer open(pairs.begin() + std::ptrdiff_t(proved_.size()), pairs.end());
    Strategy<S>::confirm_candidates(t, open);
    pairs.resize(proved_.size());
    pairs.insert(pairs.end(), open.begin(), open.end());
  }
  std::size_t bytes() const override { return bounds_.bytes() + join_.bytes() + filter_.bytes(); }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return bounds_.audit_view(body, this->time());
  }

 protected:
  void add_counts(Counters& table) const override { table.add("segments_kept", bounds_.repairs().kept); }

 private:
  void join() {
    join_.join(bounds_.segment(), this->scene_, this->scene_.pairs());
    filter_.start(join_);
    bounds_.clear_changed();
    proved_before_.clear();
  }
  /// Returns the stamps of all blocks and slabs of leaves: body by body, of each slot and of the slabs.
  std::vector<std::vector<std::uint32_t>> slab_stamps() {
    std::vector<std::vector<std::uint32_t>> stamps;
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body) {
      const LinearBody<S>& of = *bounds_.side(body).body;
      stamps.insert(stamps.end(), std::begin(of.block_stamps), std::end(of.block_stamps));
      stamps.push_back(of.slab_stamps);
    }
    return stamps;
  }
  void keep_slabs(const std::vector<std::vector<std::uint32_t>>& stamps) {
    auto next = stamps.begin();
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body) {
      LinearBody<S>& of = *bounds_.side(body).body;
      for (auto& one : of.block_stamps) one = *next++;
      of.slab_stamps = *next++;
    }
  }
  /// Returns the boxes of the roots' children at both ends, and replaces them unless `by` is empty.
  std::vector<S> exchange_roots(const std::vector<S>& by) {
    std::vector<S> roots;
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body)
      for (const EndpointBounds<S>& end : bounds_.side(body).at)
        for (std::size_t i = 0; i < lane_scalars(8); ++i) {
          roots.push_back(end.child_bounds[i]);
          if (!by.empty()) const_cast<S*>(end.child_bounds)[i] = by[roots.size() - 1];
        }
    return roots;
  }
  LinearBounds<S> bounds_;
  IntervalJoin<S> join_;
  TriangleSpanFilter<S> filter_;
  PairBuffer proved_, proved_before_;
};

template <Fault fault>
struct With {
  template <class S>
  using Strategy = Repaired<S, fault>;
};

/// Small triangles that hover over a sheet of large ones: all slide along a tilted plane, and at every frame
/// some of the small ones begin to rise or to sink. Their boxes always overlap, so slabs decide.
template <class S>
TestScene<S> hovering() {
  constexpr std::uint32_t count = 24, frames = 60;
  std::mt19937 random(7);
  const auto number = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
  // Two directions in the plane, and one across it.
  const double along[2][3] = {{0.8, 0, -0.6}, {0.36, 0.8, 0.48}}, across[3] = {0.48, -0.6, 0.64};
  TestScene<S> test;
  test.scene.name = "hovering";
  for (std::uint32_t body = 0; body < 2; ++body) {
    Body<S> made;
    made.name = body == 0 ? "small" : "sheet";
    std::vector<double> corners;
    for (std::uint32_t i = 0; i < count; ++i) {
      const double u = 2.0 * (i % 6), v = 2.0 * (i / 6), height = body == 0 ? number(0.3, 1) : 0;
      const double size = body == 0 ? 0.5 : 1.9;
      for (const auto& [du, dv] : {std::pair{0.0, 0.0}, {1.0, 0.1}, {0.2, 1.0}}) {
        const double w = body == 0 ? height + number(0, 0.05) : 0;
        for (int axis = 0; axis < 3; ++axis)
          corners.push_back((u + size * du) * along[0][axis] + (v + size * dv) * along[1][axis] +
                            w * across[axis]);
      }
      made.primitives.add(std::vector<std::uint32_t>{3 * i, 3 * i + 1, 3 * i + 2});
    }
    std::vector<S> positions;
    for (const double later : {0.0, double(frames)})
      for (std::size_t i = 0; i < corners.size(); ++i)
        positions.push_back(S(corners[i] + later * 0.01 * along[0][i % 3]));
    made.plans = FlightPlans<S>(3 * count, {0, double(frames)}, std::move(positions));
    test.scene.bodies.push_back(std::move(made));
  }
  test.scene.pairs = all_pairs(test.scene.bodies);
  std::vector<double> height(count, 0.6);
  std::vector<double> speed(count, 0);
  for (std::uint32_t frame = 0; frame <= frames; ++frame) {
    test.frames.push_back(frame);
    if (frame == frames) break;
    typename PlanScript<S>::Step step;
    step.time = frame;
    for (std::uint32_t i = 0; i < count; ++i) {
      height[i] += speed[i];
      if (random() % 6 != 0) continue;
      speed[i] = number(0.1, 0.6) * (height[i] > 0 ? -1 : 1);
      for (std::uint32_t corner = 0; corner < 3; ++corner) {
        PlanChange<S> change;
        change.body = 0;
        change.vertex = 3 * i + corner;
        for (int axis = 0; axis < 3; ++axis)
          change.velocity[axis] = S(0.01 * along[0][axis] + speed[i] * across[axis]);
        step.changes.push_back(change);
      }
    }
    if (!step.changes.empty()) test.script.steps.push_back(step);
  }
  return test;
}

/// Plays triangles whose plans change at about every third frame, some with knots, and returns the first
/// violation; counts the segments that were kept.
template <class S, Fault fault>
std::string violation(std::uint64_t& kept, const TestScene<S>& test) {
  Info info;
  info.id = "repaired";
  info.tightness = Tightness::conservative;
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  const StrategyEntry entry = make_entry<With<fault>::template Strategy>(info);
  Session<S> session(test.scene, {&entry, {}, info.topology.preferred});
  const Verification result =
      verify(session, std::span<const double>(test.frames.empty() ? frame_times(test.scene, 7) : test.frames),
             shared_oracle(test), &test.script);
  for (const auto& named : session.strategy().counters().named) kept += named.value;
  return result.first_violation;
}

template <Fault fault>
void expect(const std::string& expected, bool keeps) {
  std::uint64_t kept = 0;
  std::string in_float, in_double;
  // A fault must show in one of the scenes.
  for (const bool hovers : {false, true}) {
    const std::string one =
        violation<float, fault>(kept, hovers ? hovering<float>() : synthetic_scene<float>("plan_changes", 7));
    const std::string other = violation<double, fault>(
        kept, hovers ? hovering<double>() : synthetic_scene<double>("plan_changes", 7));
    if (in_float.empty()) in_float = one;
    if (in_double.empty()) in_double = other;
  }
  EXPECT_EQ(kept > 0, keeps);
  if (expected.empty()) {
    EXPECT_EQ(in_float, "");
    EXPECT_EQ(in_double, "");
    return;
  }
  EXPECT_NE(in_float.find(expected), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find(expected), std::string::npos) << "in double: " << in_double;
}

TEST(PlanRepairs, SoundOnesPass) {
  expect<Fault::none>("", true);
}
TEST(PlanRepairs, NewSegmentsPass) {
  expect<Fault::never_kept>("", false);
}
TEST(PlanRepairs, AChangedLeafThatIsNotJoinedAgain) {
  expect<Fault::leaf_left_out>("t = ", true);
}
TEST(PlanRepairs, AnAncestorsBoxThatIsNotEnlarged) {
  expect<Fault::root_left_out>("protrudes", true);
}
TEST(PlanRepairs, SlabsOfChangedLeavesThatAreNotRemade) {
  expect<Fault::slabs_kept>("t = ", true);
}
TEST(PlanRepairs, ASpanThatIsNotCut) {
  expect<Fault::span_not_cut>("t = ", true);
}

}  // namespace
}  // namespace kbvh::test::plan_repairs_test
