// Reduced models of motion: their decomposition, what remains, and the kernel that blends boxes.

#include <gtest/gtest.h>

#include <cmath>

#include "core/families/blend/kernels/blend_rows.hpp"
#include "core/families/blend/reduced_model.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::reduced_model_test {
namespace {

/// Plans of `vertices` vertices: a moving centre, and `modes` random fields.
template <class S>
FlightPlans<S> moving(std::uint32_t vertices, std::size_t modes, std::size_t keyframes) {
  Random random(9);
  const auto numbers = [&](std::size_t count) {
    std::vector<double> values(count);
    for (double& x : values) x = random.unit();
    return values;
  };
  const std::size_t row = std::size_t(3) * vertices;
  const std::vector<double> rest = numbers(row), fields = numbers(row * modes);
  const std::vector<double> amounts = numbers(modes * keyframes), centres = numbers(3 * keyframes);
  std::vector<S> positions;
  std::vector<double> times;
  for (std::size_t k = 0; k < keyframes; ++k) {
    times.push_back(double(k));
    for (std::size_t i = 0; i < row; ++i) {
      double x = rest[i] + 10 * centres[3 * k + i % 3];
      for (std::size_t m = 0; m < modes; ++m) x += amounts[m * keyframes + k] * fields[m * row + i];
      positions.push_back(S(x));
    }
  }
  return {vertices, times, positions};
}

/// Compares positions with those of the model, up to its remainder and roundings.
template <class S>
void expect_bounded(const FlightPlans<S>& plans, const ReducedModel<S>& model) {
  std::vector<S> positions(std::size_t(3) * plans.vertex_count() + 1);
  typename ReducedModel<S>::Coordinates now;
  for (double t = -0.5; t < double(plans.keyframe_count()) + 0.5; t += 0.25) {
    plans.evaluate(t, positions.data());
    model.at(plans, t, now);
    for (std::size_t i = 0; i + 1 < positions.size(); ++i) {
      const double magnitude = now.translated[i % 3] + std::abs(double(model.rest[i])) + now.displaced;
      const double slack = 20 * double(std::numeric_limits<S>::epsilon()) * magnitude;
      double x = now.translation[i % 3] + double(model.rest[i]);
      for (std::size_t m = 0; m < model.mode_count; ++m) x += now.modes[m] * double(model.shapes[m][i]);
      const double left = double(positions[i]) - x;
      ASSERT_GE(left, now.remainder * double(model.low[i]) - slack) << t;
      ASSERT_LE(left, now.remainder * double(model.high[i]) + slack) << t;
      ASSERT_LE(std::abs(double(positions[i])), magnitude) << t;
    }
  }
}

TEST(ReducedModel, FindsTheModesOfAMotion) {
  for (const std::size_t modes : {std::size_t(0), std::size_t(1), std::size_t(3)}) {
    const auto plans = moving<double>(50, modes, 9);
    const ReducedModel<double> model(plans, {16, 1e-9});
    EXPECT_EQ(model.mode_count, modes);  // translations are no modes
    EXPECT_LT(model.rms, 1e-9);
    expect_bounded(plans, model);
    const auto in_float = moving<float>(50, modes, 9);
    const ReducedModel<float> rounded(in_float, {16, 1e-4});
    EXPECT_EQ(rounded.mode_count, modes);
    EXPECT_LT(rounded.rms, 1e-5);
    expect_bounded(in_float, rounded);
  }
}

TEST(ReducedModel, BoundsWhatFewModesLeave) {
  for (const std::uint32_t most : {0u, 1u, 4u}) {
    const auto plans = moving<float>(50, 8, 100);  // more keyframes than snapshots
    const ReducedModel<float> model(plans, {most, 0.0});
    EXPECT_EQ(model.mode_count, most);
    EXPECT_GT(model.rms, 0.01);
    expect_bounded(plans, model);
  }
  expect_bounded(moving<float>(1, 2, 5), ReducedModel<float>(moving<float>(1, 2, 5), {16, 0.0}));
}

template <class S>
void kernels_agree(std::uint32_t width) {
  Random random(width);
  constexpr std::uint32_t nodes = 3, terms = 5;
  const std::size_t scalars = lane_scalars(width);
  std::vector<S> ranges(nodes * terms * scalars);
  for (S& x : ranges) x = S(random.unit());
  std::vector<BlendTerm<S>> list;
  for (std::uint32_t i = 0; i < terms; ++i)
    list.push_back({ranges.data() + i * scalars, S(std::abs(random.unit())), i % 2});
  Blend<S> blend{list.data(), terms, terms * scalars, {}};
  for (S& x : blend.offset) x = S(random.unit());
  const WideNode wide[nodes] = {};
  const std::uint32_t order[nodes] = {2, 0, 1};
  std::vector<S> first_rows, first_own;
  for (const KernelSet set : supported_kernel_sets()) {
    std::vector<S> rows(nodes * scalars), own(std::size_t(8) * nodes);
    blend_kernels<S>(set).of(width)({wide, rows.data(), own.data(), nullptr}, blend, order, nodes);
    if (first_rows.empty()) {
      first_rows = rows;
      first_own = own;
      for (std::size_t i = 0; i < rows.size(); ++i) {
        const std::size_t node = i / scalars, side = i % scalars / width, lane = i % width;
        double sum = double(blend.offset[side]);
        for (std::uint32_t k = 0; k < terms; ++k)
          sum += double(list[k].weight) *
                 double(ranges[(node * terms + k) * scalars +
                               (list[k].mirrored ? (side + 3) % 6 : side) * width + lane]);
        EXPECT_NEAR(double(rows[i]), sum, 1e-5);
        EXPECT_LE(side < 3 ? own[8 * node + side] : -own[8 * node + side + 1], rows[i]);
      }
    }
    EXPECT_EQ(rows, first_rows) << name(set);
    EXPECT_EQ(own, first_own) << name(set);
  }
}

TEST(BlendKernels, AllAgree) {
  for (const std::uint32_t width : {2u, 4u, 8u}) {
    kernels_agree<float>(width);
    kernels_agree<double>(width);
  }
}

}  // namespace
}  // namespace kbvh::test::reduced_model_test
