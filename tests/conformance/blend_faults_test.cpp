// The suite can fail for blended boxes: those of reduced models and of keyframes, without a fault and with
// one seeded fault each. (family_faults_test.cpp: other families.)

#include <gtest/gtest.h>

#include "core/families/blend/blended_strategy.hpp"
#include "core/families/blend/reduced_boxes.hpp"
#include "core/families/blend/target_boxes.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/grids.hpp"

namespace kbvh::test::blend_faults_test {
namespace {

enum class BlendFault : std::uint8_t {
  none,
  no_remainder,     // the motion that the modes do not capture is forgotten
  no_sign,          // coordinates count as positive
  small_mode,       // the largest coordinate is too small by a thousandth
  no_translation,   // the body stays where it was at the first frame
  swapped_weights,  // the keyframes of a segment are exchanged
  one_keyframe,     // the boxes of the previous keyframe are used until the next one
  no_margin,        // boxes lack the margin for roundings
};

/// A source with a fault.
template <class S, class Source, BlendFault fault>
class Faulty : public BlendSource<S> {
 public:
  template <class... Args>
  explicit Faulty(Args&&... args) : source_(std::forward<Args>(args)...) {}
  void blend_at(double t, BlendTerms<S>& out) const override {
    source_.blend_at(t, out);
    auto& terms = out.terms;
    if (fault == BlendFault::no_remainder) terms.back().weight = 0;
    if (fault == BlendFault::no_sign)
      for (BlendTerm<S>& term : terms) term.mirrored = 0;
    if (fault == BlendFault::small_mode && terms.size() > 2) terms[1].weight *= S(0.999);
    if (fault == BlendFault::no_translation) {
      if (first_.empty()) first_.assign(out.offset, out.offset + 6);
      std::copy(first_.begin(), first_.end(), out.offset);
    }
    if (fault == BlendFault::swapped_weights && terms.size() == 2)
      std::swap(terms[0].weight, terms[1].weight);
    if (fault == BlendFault::one_keyframe && terms.size() == 2) {
      terms.pop_back();
      terms[0].weight = 1;
    }
    if (fault == BlendFault::no_margin)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const S translation = (out.offset[axis] - out.offset[axis + 3]) / 2;
        out.offset[axis] = translation;
        out.offset[axis + 3] = -translation;
        out.rounding = 0;
      }
  }
  std::size_t bytes() const override { return source_.bytes(); }

 private:
  Source source_;
  mutable std::vector<S> first_;
};

template <BlendFault fault>
struct Reduced {
  template <class S>
  class Strategy : public BlendedStrategy<S> {
   public:
    Strategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
        : BlendedStrategy<S>(scene, motion, std::move(topologies)) {}

   private:
    std::unique_ptr<BlendSource<S>> make_source(std::uint32_t /*body*/, WideHierarchy<S>& hierarchy,
                                                const FlightPlans<S>& plans) override {
      return std::make_unique<Faulty<S, ReducedBoxes<S>, fault>>(hierarchy, plans, 3, 0.0,
                                                                 fault == BlendFault::no_margin ? 0 : 1);
    }
  };
};

template <BlendFault fault>
struct Targets {
  template <class S>
  class Strategy : public BlendedStrategy<S> {
   public:
    Strategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
        : BlendedStrategy<S>(scene, motion, std::move(topologies)) {}

   private:
    std::unique_ptr<BlendSource<S>> make_source(std::uint32_t /*body*/, WideHierarchy<S>& hierarchy,
                                                const FlightPlans<S>& plans) override {
      return std::make_unique<Faulty<S, TargetBoxes<S>, fault>>(hierarchy, plans);
    }
  };
};

/// Two crossing sheets, each the sum of a flat sheet and of three fixed displacements with coefficients of
/// both signs, so that only roundings remain of their motion.
template <class S>
TestScene<S> three_modes() {
  constexpr int side = 9, keyframes = 5;
  constexpr double coefficients[keyframes][3] = {
      {0.5, -0.2, 0.1}, {-0.4, 0.3, 0.2}, {0.1, 0.4, -0.3}, {-0.3, -0.4, 0.1}, {0.2, 0.1, -0.2}};
  TestScene<S> test;
  for (int b = 0; b < 2; ++b) {
    Random random(std::uint64_t(5 + b));
    Body<S> body;
    body.name = "sheet";
    std::vector<double> shapes[3];
    for (auto& shape : shapes)
      for (int i = 0; i < 3 * side * side; ++i) shape.push_back(0.3 * random.unit() + 0.2);
    std::vector<S> positions;
    for (const auto& row : coefficients)
      for (int i = 0; i < 3 * side * side; ++i) {
        const int x = i / 3 % side, y = i / 3 / side, axis = i % 3;
        double value = axis == 0 ? x : axis == 1 ? (b == 0 ? y : 4.3) : (b == 0 ? 0.1 : y - 4.1);
        for (int m = 0; m < 3; ++m) value += row[m] * shapes[m][std::size_t(i)];
        positions.push_back(S(value));
      }
    std::vector<double> times;
    for (int k = 0; k < keyframes; ++k) times.push_back(k / 30.0);
    body.plans = FlightPlans<S>(side * side, times, std::move(positions));
    add_grid_triangles(body.primitives, side - 1);
    test.scene.bodies.push_back(std::move(body));
  }
  test.scene.pairs = all_pairs(test.scene.bodies);
  return test;
}

/// Returns the first violation.
template <class S, template <class> class Strategy>
std::string violation(const std::string& scene) {
  Info info;
  info.id = "faulty";
  info.tightness = Tightness::conservative;
  info.positions = PositionUse::fetched;
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  const TestScene<S> test = scene == "three_modes" ? three_modes<S>() : synthetic_scene<S>(scene, 7);
  return check(make_entry<Strategy>(info), test, 7, {}, info.topology.preferred);
}

constexpr const char* scenes[] = {
    "three_modes", "soups", "sheets", "plan_changes", "plans_start_at_rest", "four_bodies_own_keyframes"};

TEST(BlendFaults, SoundReducedModelsPass) {
  using Sound = Reduced<BlendFault::none>;
  for (const char* const scene : scenes) {
    EXPECT_EQ((violation<float, Sound::Strategy>(scene)), "") << scene;
    EXPECT_EQ((violation<double, Sound::Strategy>(scene)), "") << scene;
  }
}
TEST(BlendFaults, SoundBlendsOfKeyframesPass) {
  using Sound = Targets<BlendFault::none>;
  for (const char* const scene : scenes) {
    EXPECT_EQ((violation<float, Sound::Strategy>(scene)), "") << scene;
    EXPECT_EQ((violation<double, Sound::Strategy>(scene)), "") << scene;
  }
}

template <template <class> class Strategy>
void expect_caught(const char* scene) {
  const std::string in_float = violation<float, Strategy>(scene),
                    in_double = violation<double, Strategy>(scene);
  EXPECT_NE(in_float.find("protru"), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find("protru"), std::string::npos) << "in double: " << in_double;
}

TEST(BlendFaults, AForgottenRemainder) {
  expect_caught<Reduced<BlendFault::no_remainder>::Strategy>("soups");
}
TEST(BlendFaults, ADroppedSign) {
  expect_caught<Reduced<BlendFault::no_sign>::Strategy>("three_modes");
}
TEST(BlendFaults, AnAmplitudeTooSmall) {
  expect_caught<Reduced<BlendFault::small_mode>::Strategy>("three_modes");
}
TEST(BlendFaults, AForgottenTranslation) {
  expect_caught<Reduced<BlendFault::no_translation>::Strategy>("four_bodies_own_keyframes");
}
TEST(BlendFaults, NoMarginForARemainder) {
  // In double the range of the remainder, which is measured including its roundings, hides the fault.
  const std::string in_float = violation<float, Reduced<BlendFault::no_margin>::Strategy>("three_modes");
  EXPECT_NE(in_float.find("protru"), std::string::npos) << in_float;
}
TEST(BlendFaults, SwappedWeights) {
  expect_caught<Targets<BlendFault::swapped_weights>::Strategy>("soups");
}
TEST(BlendFaults, BoxesOfOneKeyframe) {
  expect_caught<Targets<BlendFault::one_keyframe>::Strategy>("soups");
}
TEST(BlendFaults, NoMarginBetweenKeyframes) {
  expect_caught<Targets<BlendFault::no_margin>::Strategy>("soups");
}

}  // namespace
}  // namespace kbvh::test::blend_faults_test
