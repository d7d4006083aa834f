// The suite can fail for the families beyond refits: linear bounds, the interval join with its span filter,
// near pairs, trees built at every frame and the sweep on one axis, each in its simplest form, without a
// fault and with one seeded fault. (faults_test.cpp: the others; contact_faults_test.cpp: sweeps of
// contacts.)

#include <gtest/gtest.h>

#include "core/families/build/built_strategy.hpp"
#include "core/families/build/curve_builders.hpp"
#include "core/families/drift/near_pairs.hpp"
#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "core/families/sweep/sorted_boxes.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::family_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  stale_segment,    // every second segment is not made: the previous one stays in use
  reversed_time,    // the ends of a segment are exchanged
  small_margin,     // boxes are too small by a thousandth
  plans_forgotten,  // changes of plans are not followed
  late_begin,       // pairs are reported a twentieth of the segment late
  early_end,        // and dropped a twentieth early
  overdue_verdict,  // a verdict at the segment's begin is reported throughout
  small_closing,    // bodies are assumed to close in by a tenth of the bound
  stale_rows,       // a search reads the leaves of the previous search
  lost_primitive,   // a sort loses a primitive and repeats another one
  short_leaf,       // a leaf ends one primitive early
  unmade_tree,      // every eighth tree is not built: the previous one stays in use
  unsorted_boxes,   // boxes are swept on a different axis than they are sorted on
  unmade_boxes,     // boxes are those of the first frame
  neighbours_kept,  // primitives of a body that share a vertex are a pair
};

/// Boxes linear in time, with one query per frame.
template <class S, Fault fault>
class Linear : public CountedStrategy<S>, public AnswersSelfPairs, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  Linear(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params&)
      : CountedStrategy<S>(scene, motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), {}),
        stale_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      stale_[body].resize(bounds_.hierarchy(body).node_count());
  }
  void reset_to(double /*t*/) override {
    bounds_.start();
    new_frame();
  }
  void advance_to(double t) override {
    if (fault == Fault::stale_segment && t > bounds_.end() && ++ends_ % 8 != 0) return new_frame();
    bounds_.advance();
    new_frame();
  }
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    if (fault != Fault::plans_forgotten) bounds_.plans_changed();
    new_frame();
  }
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*none*/) override {
    std::uint64_t tests = 0;
    for (const std::uint32_t i : bounds_.segment().near_pairs) {
      const BodyPair& pair = this->scene_.pairs()[i];
      const WideMoment<S> first = moment(pair.first, t), second = moment(pair.second, t);
      const bool self = pair.first == pair.second;
      if (self) make_boxes(first, pair.first);
      query_.run({.hierarchy = &bounds_.hierarchy(pair.first),
                  .body = pair.first,
                  .moment = self ? nullptr : &first},
                 {.hierarchy = &bounds_.hierarchy(pair.second),
                  .body = pair.second,
                  .moment = self ? nullptr : &second},
                 out, tests);
    }
    return {};
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    if (fault == Fault::reversed_time) return {};  // the pairs must show the fault
    AuditView view = bounds_.audit_view(body, this->time());
    if (fault == Fault::small_margin)
      for (Box<double>& box : view.boxes)
        for (int axis = 0; axis < 3; ++axis) box.upper[axis] -= 1e-3 * (box.upper[axis] - box.lower[axis]);
    return view;
  }
  std::size_t bytes() const override { return bounds_.bytes(); }

 private:
  void new_frame() {
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body) {
      bounds_.hierarchy(body).positions_changed();
      std::fill(stale_[body].begin(), stale_[body].end(), 1);
    }
  }
  void make_boxes(const WideMoment<S>& moment, std::uint32_t body) {
    if (fault == Fault::unmade_boxes && made_++ != 0) return;
    const auto& hierarchy = bounds_.hierarchy(body);
    for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node)
      wide_linear_kernels<S>(hierarchy.kernels()).make(hierarchy.width())(moment, node);
  }
  WideMoment<S> moment(std::uint32_t body, double t) {
    const S fraction = bounds_.fraction(t);
    return {bounds_.hierarchy(body).arrays(), bounds_.side(body).ends(), stale_[body].data(),
            fault == Fault::reversed_time ? 1 - fraction : fraction};
  }
  LinearBounds<S> bounds_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  std::vector<std::vector<std::uint8_t>> stale_;
  std::uint64_t ends_ = 0, made_ = 0;
};

/// One join for each segment, from which frames are read; with span tests if all bodies are triangles.
template <class S, Fault fault>
class Join : public CountedStrategy<S>, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  Join(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params&)
      : CountedStrategy<S>(scene, motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), {}) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      triangles_ = triangles_ && all_triangles(scene.primitives(body));
  }
  void reset_to(double /*t*/) override {
    bounds_.start();
    join();
  }
  void advance_to(double t) override {
    if (fault == Fault::stale_segment && t > bounds_.end() && ++ends_ % 8 != 0) return;
    if (bounds_.advance()) join();
  }
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {
    if (fault == Fault::plans_forgotten) return;
    bounds_.plans_changed();
    join();
  }
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*none*/) override {
    float fraction = float(bounds_.fraction(t));
    if (fault == Fault::late_begin) fraction = std::max(0.f, fraction - 0.05f);
    if (fault == Fault::early_end) fraction = std::min(1.f, fraction + 0.05f);
    if (fault == Fault::overdue_verdict) fraction = 0;
    certain_ = 0;
    if (!triangles_) {
      join_.read(fraction, out);
      return {};
    }
    const std::size_t before = out.size();
    const std::size_t open = filter_.read(bounds_.segment(), this->scene_, join_, fraction, out);
    certain_ = out.size() - before - open;
    return {};
  }
  void confirm_candidates(double t, PairBuffer& pairs) override {
    open_.assign(pairs.begin() + std::ptrdiff_t(certain_), pairs.end());
    Strategy<S>::confirm_candidates(t, open_);
    pairs.resize(certain_);
    pairs.insert(pairs.end(), open_.begin(), open_.end());
  }
  std::size_t bytes() const override { return bounds_.bytes() + join_.bytes() + filter_.bytes(); }

 private:
  void join() {
    join_.join(bounds_.segment(), this->scene_, this->scene_.pairs());
    if (triangles_) filter_.start(join_);
  }
  LinearBounds<S> bounds_;
  IntervalJoin<S> join_;
  TriangleSpanFilter<S> filter_;
  PairBuffer open_;
  bool triangles_ = true;
  std::size_t certain_ = 0;
  std::uint64_t ends_ = 0;
};

/// One list of near pairs for as many frames as the bound on the motion allows.
template <class S, Fault fault>
class Near : public StoredHierarchyStrategy<S>, public AnswersSelfPairs {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::step_bound;
  Near(const SceneView<S>& scene, const SteppedMotion<S>& motion, Topologies topologies, const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        motion_(motion),
        lists_(scene.pairs().size()),
        rows_(scene.body_count()) {}
  void reset_to(double /*t*/) override { search(); }
  void advance_to(double t) override {
    for (std::uint32_t body = 0; body < rows_.size(); ++body) {
      const double way = motion_.displacement_bound(body, this->previous_time(), t);
      moved_[body] += fault == Fault::small_closing ? way / 10 : way;
    }
    if (*std::max_element(moved_.begin(), moved_.end()) > 0.999 * double(margin)) search();
  }
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    for (std::size_t i = 0; i < lists_.size(); ++i) {
      const BodyPair& pair = this->scene_.pairs()[i];
      lists_[i].read(std::min(1.0, (moved_[pair.first] + moved_[pair.second] + 1e-5) / double(2 * margin)),
                     out);
    }
    return {};
  }
  std::optional<AuditView> audit_view(std::uint32_t /*body*/) const override { return {}; }

 private:
  static constexpr S margin = S(0.25);
  void update(std::uint32_t /*body*/) override {}
  void search() {
    moved_.assign(rows_.size(), 0);
    constexpr S margins[6] = {margin, margin, margin, margin, margin, margin};
    constexpr S reach[6] = {2 * margin, 2 * margin, 2 * margin, 2 * margin, 2 * margin, 2 * margin};
    for (std::uint32_t body = 0; body < rows_.size(); ++body) {
      auto& hierarchy = this->hierarchies_[body];
      hierarchy.positions_changed();
      this->sampled_.fetch_all(body);
      this->refit(body);
      for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
        Box<S> box = hierarchy.box(node);
        for (int axis = 0; axis < 3; ++axis) {
          box.lower[axis] -= margin;
          box.upper[axis] += margin;
        }
        hierarchy.set_box(node, box);
      }
      if (fault != Fault::stale_rows) rows_[body].positions_changed();
    }
    std::uint64_t tests = 0;
    for (std::size_t i = 0; i < lists_.size(); ++i) {
      const BodyPair& pair = this->scene_.pairs()[i];
      lists_[i].clear();
      if (this->hierarchies_[pair.first].empty() || this->hierarchies_[pair.second].empty()) continue;
      const auto side = [&](std::uint32_t body) -> NearSide<S> {
        return {&this->hierarchies_[body],
                this->sampled_.positions(body),
                margins,
                &rows_[body],
                0,
                fault == Fault::neighbours_kept ? nullptr : &this->scene_.primitives(body)};
      };
      lists_[i].build(side(pair.first), side(pair.second), pair.first, pair.second, reach, work_, tests);
    }
  }
  SteppedMotion<S> motion_;
  std::vector<NearPairs<S>> lists_;
  std::vector<NearLeafRows<S>> rows_;
  NearWork<S> work_;
  std::vector<double> moved_;
};

/// Splits ranges in the middle.
struct Halves {
  using Part = KeyRange;
  std::uint32_t shortened = 0;
  static std::uint32_t count(const Part& part) { return part.end - part.begin; }
  static std::uint32_t size(const Part& part) { return count(part); }
  static double weight(const Part& part) { return count(part); }
  static void expect(std::uint32_t /*leaves*/) {}
  static std::pair<Part, Part> split(const Part& part) {
    const std::uint32_t middle = part.begin + count(part) / 2;
    return {{part.begin, middle}, {middle, part.end}};
  }
  std::pair<std::uint32_t, std::uint32_t> leaf(std::uint32_t /*number*/, const Part& part,
                                               std::uint32_t /*placed*/) {
    return {part.begin, part.end - (shortened-- == 1 ? 1 : 0)};
  }
};

/// A tree built at every frame, by halves along the curve.
template <class S, Fault fault>
struct HalvesBuilder {
  explicit HalvesBuilder(const Params&) {}
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
    if (fault == Fault::unmade_tree && ++builds % 8 == 0) return;
    tree.clear(order.count());
    if (order.count() == 0) return;
    order.sort(list, Curve::hilbert);
    Halves halves{fault == Fault::short_leaf ? 3U : 0U};
    lay_out(tree, halves, KeyRange{0, order.count()}, parts);
    for (std::uint32_t k = 0; k < order.count(); ++k)
      tree.entries()[k] = CurveOrder<S>::primitive(order.keys()[k]);
    if (fault == Fault::lost_primitive) tree.entries()[order.count() / 2] = tree.entries()[0];
    tree.fit(order.boxes());
  }
  std::size_t bytes() const { return parts.capacity() * sizeof(KeyRange); }
  std::uint32_t builds = 0;
  std::vector<KeyRange> parts;
};
template <class S, Fault fault>
using Built = BuiltStrategy<S, HalvesBuilder<S, fault>>;

/// A sweep on one axis.
template <class S, Fault fault>
class AxisSweep : public CountedStrategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  AxisSweep(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies&, const Params&)
      : CountedStrategy<S>(scene, motion), bodies_(scene.body_count()), found_(sweep_block) {}
  void reset_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      bodies_[body].start(PrimitiveList(this->scene_.primitives(body)), active_kernel_set());
      update(body);
    }
  }
  void advance_to(double /*t*/) override {
    if (fault == Fault::unmade_boxes) return;
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) update(body);
  }
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    for (const BodyPair& pair : this->scene_.pairs()) {
      SweepJob<S> job{bodies_[pair.first].side(pair.first),
                      bodies_[pair.second].side(pair.second),
                      fault == Fault::unsorted_boxes ? 1U : 0U,
                      0,
                      0,
                      SweepJob<S>::no_block,
                      found_.data(),
                      0,
                      found_.size(),
                      0};
      while (job.next < job.a.count) {
        sweep_kernels<S>(active_kernel_set()).two(job);
        for (std::size_t i = 0; i < job.found; ++i)
          out.push_back({found_[i].body_a, found_[i].primitive_a, found_[i].body_b, found_[i].primitive_b});
        job.found = 0;
      }
    }
    return {};
  }
  std::size_t bytes() const override { return 0; }

 private:
  void update(std::uint32_t body) {
    const Primitives& primitives = this->scene_.primitives(body);
    boxes_.take(primitives, PrimitiveList(primitives), this->sampled_.positions(body), active_kernel_set());
    bodies_[body].update(boxes_.boxes(), 0);
  }
  std::vector<SortedBoxes<S>> bodies_;
  CurveOrder<S> boxes_;
  std::vector<FoundPair> found_;
};

template <template <class, Fault> class Family, Fault fault>
struct With {
  template <class S>
  using Strategy = Family<S, fault>;
};

template <template <class, Fault> class Family, Fault fault>
StrategyEntry entry_of() {
  Info info;
  info.id = "faulty";
  info.tightness = Tightness::conservative;
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  return make_entry<With<Family, fault>::template Strategy>(info);
}

/// The first violation in float and in double.
template <template <class, Fault> class Family, Fault fault>
std::pair<std::string, std::string> violations(const char* scene, std::uint32_t l = 7) {
  const StrategyEntry entry = entry_of<Family, fault>();
  const BuilderConfig& builder = entry.info.topology.preferred;
  return {check(entry, synthetic_scene<float>(scene, l), l, {}, builder),
          check(entry, synthetic_scene<double>(scene, l), l, {}, builder)};
}
template <template <class, Fault> class Family>
void expect_sound(std::initializer_list<const char*> scenes) {
  for (const char* const scene : scenes) {
    const auto [in_float, in_double] = violations<Family, Fault::none>(scene);
    EXPECT_EQ(in_float, "") << scene;
    EXPECT_EQ(in_double, "") << scene;
  }
}
template <template <class, Fault> class Family, Fault fault>
void expect_caught(const char* scene, const std::string& expected) {
  const auto [in_float, in_double] = violations<Family, fault>(scene);
  EXPECT_NE(in_float.find(expected), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find(expected), std::string::npos) << "in double: " << in_double;
}

TEST(FamilyFaults, SoundLinearBoundsPass) {
  expect_sound<Linear>({"soups", "sheets", "plan_changes", "four_bodies_own_keyframes", "self_rolled_cloth",
                        "self_soup_alone", "self_plan_changes"});
}
TEST(FamilyFaults, LinearBoxesOfABodyWithItselfThatAreNotMade) {
  expect_caught<Linear, Fault::unmade_boxes>("self_soup_alone", "not among the candidates");
}
TEST(FamilyFaults, ASegmentThatIsNotMade) {
  expect_caught<Linear, Fault::stale_segment>("soups", "protrudes");
}
TEST(FamilyFaults, EndsExchanged) {
  expect_caught<Linear, Fault::reversed_time>("soups", "not among the candidates");
}
TEST(FamilyFaults, LinearBoxesTooSmall) {
  expect_caught<Linear, Fault::small_margin>("soups", "protrudes");
}
TEST(FamilyFaults, PlansForgottenByLinearBounds) {
  expect_caught<Linear, Fault::plans_forgotten>("plan_changes", "protrudes");
}

TEST(FamilyFaults, SoundJoinPasses) {
  expect_sound<Join>({"soups", "sheets", "plan_changes", "four_bodies_own_keyframes"});
}
TEST(FamilyFaults, ASegmentThatIsNotJoined) {
  expect_caught<Join, Fault::stale_segment>("soups", "t = ");
}
TEST(FamilyFaults, PairsThatBeginLate) {
  expect_caught<Join, Fault::late_begin>("soups", "t = ");
}
TEST(FamilyFaults, PairsThatEndEarly) {
  expect_caught<Join, Fault::early_end>("soups", "t = ");
}
TEST(FamilyFaults, VerdictsBeyondTheirProof) {
  expect_caught<Join, Fault::overdue_verdict>("soups", "t = ");
}
TEST(FamilyFaults, PlansForgottenByTheJoin) {
  expect_caught<Join, Fault::plans_forgotten>("plan_changes", "t = ");
}

TEST(FamilyFaults, SoundNearPairsPass) {
  expect_sound<Near>({"soups", "sheets", "four_bodies_own_keyframes", "self_rolled_cloth", "self_soup_alone",
                      "self_sheets_crumpled"});
}
TEST(FamilyFaults, ClosingWithinABodyTakenForLess) {
  expect_caught<Near, Fault::small_closing>("self_soup_alone", "not among the candidates");
}
TEST(FamilyFaults, NeighboursTakenForNearPairs) {
  expect_caught<Near, Fault::neighbours_kept>("self_rolled_cloth", "is reported but does not intersect");
}
TEST(FamilyFaults, ClosingTakenForLess) {
  expect_caught<Near, Fault::small_closing>("soups", "not among the candidates");
}
TEST(FamilyFaults, RowsOfTheSearchBefore) {
  expect_caught<Near, Fault::stale_rows>("soups", "not among the candidates");
}

TEST(FamilyFaults, SoundBuiltTreesPass) {
  expect_sound<Built>({"soups", "sheets", "four_bodies_own_keyframes"});
}
TEST(FamilyFaults, APrimitiveLostBySorting) {
  expect_caught<Built, Fault::lost_primitive>("soups", "reported more than once");
}
TEST(FamilyFaults, ALeafThatEndsEarly) {
  expect_caught<Built, Fault::short_leaf>("soups", "primitive");
}
TEST(FamilyFaults, ATreeThatIsNotBuilt) {
  expect_caught<Built, Fault::unmade_tree>("soups", "protrudes");
}

TEST(FamilyFaults, SoundSweepsOnAnAxisPass) {
  expect_sound<AxisSweep>({"soups", "sheets", "four_bodies_own_keyframes"});
}
TEST(FamilyFaults, SweptOnAnotherAxisThanSorted) {
  expect_caught<AxisSweep, Fault::unsorted_boxes>("soups", "not among the candidates");
}
TEST(FamilyFaults, SweptBoxesOfTheFirstFrame) {
  expect_caught<AxisSweep, Fault::unmade_boxes>("soups", "not among the candidates");
}

}  // namespace
}  // namespace kbvh::test::family_faults_test
