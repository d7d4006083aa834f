// The suite can fail for kinetic sweep and prune: in its simplest form, with a box for each primitive,
// without a fault and with one seeded fault.

#include <gtest/gtest.h>

#include "core/contract/registry.hpp"
#include "core/families/linear/segment_interval.hpp"
#include "core/families/sweep/kinetic_overlaps.hpp"
#include "core/scene/self_pairs.hpp"
#include "tests/conformance/list_faults.hpp"

namespace kbvh::test::kinetic_sweep_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  lost_swap,            // some certificates are not made
  ties_in_wrong_order,  // neighbours that are equal at the begin of a segment: in the order of their numbers,
                        // for good
  set_not_updated,      // some swaps do not reach the set
};

template <Fault fault>
struct FaultyOrder {
  template <class S>
  static int at_begin(const MovingEnd<S>& first, const MovingEnd<S>& second) {
    if (fault != Fault::ties_in_wrong_order) return EndOrder::at_begin(first, second);
    return first.begin < second.begin ? -1 : first.begin > second.begin ? 1 : 0;
  }
  template <class S>
  static bool swaps(const MovingEnd<S>& first, const MovingEnd<S>& second) {
    if (fault == Fault::lost_swap && ++count % 4 == 0) return false;
    if (fault == Fault::ties_in_wrong_order && first.begin == second.begin) return false;
    return EndOrder::swaps(first, second);
  }
  static inline std::uint32_t count = 0;
};

template <Fault fault, KeptBy kept>
struct Seeded {
  template <class S>
  class Strategy : public CountedStrategy<S>, public AnswersSelfPairs {
   public:
    static constexpr Foresight foresight = Foresight::next_keyframe;
    Strategy(const SceneView<S>& scene, const SegmentMotion<S>& motion, const Topologies&, const Params&)
        : CountedStrategy<S>(scene, motion), motion_(motion) {
      std::vector<std::uint32_t> body_of;
      for (std::uint32_t body = 0; body < scene.body_count(); ++body)
        for (std::uint32_t p = 0; p < scene.primitives(body).count(); ++p) {
          boxes_.push_back(std::uint32_t(boxes_.size()));
          primitive_.push_back(p);
          body_of.push_back(body);
        }
      body_of_ = body_of;
      overlaps_.assign(std::move(body_of), scene.body_count(), scene.pairs());
    }
    void reset_to(double t) override {
      started_ = false;
      begin_segment(t);
    }
    void advance_to(double t) override {
      if (t > segment_.end) begin_segment(t);
      bring_to(t);
    }
    QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
      for (const BoxPairSet::Pair& pair : overlaps_.set().pairs()) {
        PrimitivePair found{body_of_[pair.a], primitive_[pair.a], body_of_[pair.b], primitive_[pair.b]};
        if (found.body_a != found.body_b ||
            keep_self_pair(&this->scene_.primitives(found.body_a), LeavesOf::two, found.primitive_a,
                           found.primitive_b))
          out.push_back(found);
      }
      return {};
    }
    std::size_t bytes() const override { return 0; }

   private:
    using Overlaps = KineticOverlaps<S, FaultyOrder<fault>>;
    void begin_segment(double t) {
      segment_ = segment_interval(motion_, this->scene_.body_count(), t, 1, 1.0);
      std::uint32_t box = 0;
      for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) {
        const bool rests = motion_.at_rest(body);
        std::vector<S> room[2];
        const S* const ends[2] = {motion_.positions_on_lines(body, rests ? t : segment_.begin, room[0]),
                                  motion_.positions_on_lines(body, rests ? t : segment_.end, room[1])};
        const Primitives& primitives = this->scene_.primitives(body);
        for (std::uint32_t p = 0; p < primitives.count(); ++p, ++box) take_box(box, primitives[p], ends);
      }
      if (!started_ || !overlaps_.renew()) overlaps_.start(boxes_);
      started_ = true;
      overlaps_.start_segment(segment_.begin, segment_.end, kept);
      bring_to(t);
    }
    void take_box(std::uint32_t box, std::span<const std::uint32_t> vertices, const S* const (&ends)[2]) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        S lower[2], upper[2];
        for (const int end : {0, 1}) {
          lower[end] = std::numeric_limits<S>::infinity();
          upper[end] = -lower[end];
          for (const std::uint32_t v : vertices) {
            lower[end] = std::min(lower[end], ends[end][3 * v + axis]);
            upper[end] = std::max(upper[end], ends[end][3 * v + axis]);
          }
        }
        const S largest =
            std::max({std::abs(lower[0]), std::abs(lower[1]), std::abs(upper[0]), std::abs(upper[1])});
        const S margin = 8 * std::numeric_limits<S>::epsilon() * largest + std::numeric_limits<S>::min();
        overlaps_.order(axis).line(2 * box) = {lower[0] - margin, lower[1] - margin};
        overlaps_.order(axis).line(2 * box + 1) = {upper[0] + margin, upper[1] + margin};
      }
    }
    void bring_to(double t) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        overlaps_.order(axis).advance(t, [&](std::uint32_t low, std::uint32_t high) {
          if (fault == Fault::set_not_updated && ++swaps_ % 4 == 0) return;
          overlaps_.take_swap(axis, low, high);
        });
    }

    SegmentMotion<S> motion_;
    Overlaps overlaps_;
    SegmentInterval segment_;
    std::vector<std::uint32_t> boxes_, primitive_, body_of_;
    bool started_ = false;
    std::uint32_t swaps_ = 0;
  };
};

template <Fault fault>
void expect_caught(const char* scene) {
  expect_lost_candidates<Seeded<fault, KeptBy::events>::template Strategy>(scene);
}

TEST(KineticSweepFaults, SoundListsPass) {
  for (const char* const scene : {"soups", "sheets", "four_bodies_own_keyframes"}) {
    expect_sound_candidates<Seeded<Fault::none, KeptBy::events>::Strategy>(scene);
    expect_sound_candidates<Seeded<Fault::none, KeptBy::sorting>::Strategy>(scene);
  }
}
TEST(KineticSweepFaults, ALostSwap) {
  expect_caught<Fault::lost_swap>("soups");
}
TEST(KineticSweepFaults, EqualEndsInTheWrongOrder) {
  expect_caught<Fault::ties_in_wrong_order>("static_obstacle");
  expect_caught<Fault::ties_in_wrong_order>("integer_ties");
}
TEST(KineticSweepFaults, ASwapThatDoesNotReachTheSet) {
  expect_caught<Fault::set_not_updated>("soups");
}

}  // namespace
}  // namespace kbvh::test::kinetic_sweep_faults_test
