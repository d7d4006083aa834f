// Correct rounding of positions at the frames of clips, where ties are frequent, against integers, with every
// kernel set. KBVH_SLOW=1 checks 10 million values instead of 300,000.
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/motion/round_positions.hpp"
#include "tests/support/rounding.hpp"

namespace {

using kbvh::RoundingStats;
using kbvh::testing_support::is_nearest_even_by;
using kbvh::testing_support::slow;
using kbvh::testing_support::with_all_kernels;

/// Pairs of floats for the frames of a clip that the first stage must decide or leave open.
class FramePairs {
 public:
  static constexpr int kinds = 13;
  explicit FramePairs(std::uint64_t seed) : random_(seed) {}

  std::uint64_t below(std::uint64_t n) { return random_() % n; }
  double unit() { return 2 * static_cast<double>(random_() >> 11) * 0x1p-53 - 1; }
  float scaled(int low, int high) {
    return static_cast<float>(std::ldexp(unit(), low + static_cast<int>(below(std::uint64_t(high - low)))));
  }
  static float ulps_away(float x, std::int64_t n) {
    const float infinity = std::numeric_limits<float>::infinity();
    for (; n > 0; --n) x = std::nextafter(x, infinity);
    for (; n < 0; ++n) x = std::nextafter(x, -infinity);
    return x;
  }

  /// f is the fraction of the segment, l the number of frames per keyframe.
  void pair(int kind, double f, int l, float& x0, float& x1) {
    const auto few = static_cast<std::int64_t>(below(401)) - 200;
    x0 = static_cast<float>(unit());
    switch (kind) {
      case 0:  // neighbours: a lattice of ties at every short fraction
        x1 = ulps_away(x0, few);
        break;
      case 1:  // the same in any binade
        x0 = scaled(-100, 90), x1 = ulps_away(x0, few);
        break;
      case 2:  // around powers of two, where the spacing changes
        x0 = ulps_away(std::ldexp(below(2) != 0 ? 1.0F : -1.0F, static_cast<int>(below(40)) - 20), few / 4);
        x1 = ulps_away(x0, few);
        break;
      case 3:  // a grid coarser than floats, so that far ends have ties, too
        x0 = static_cast<float>(std::rint(unit() * 0x1p23) * 0x1p-23);
        x1 = static_cast<float>(std::rint(unit() * 0x1p24) * 0x1p-22);
        break;
      case 4: {  // one end of any smaller size that puts the result next to a midpoint
        const double near = static_cast<double>(x0) * (1 - f) +
                            std::ldexp(static_cast<double>(x0), -2 - static_cast<int>(below(45)));
        const auto rounded = static_cast<float>(near);
        const double middle = 0.5 * (static_cast<double>(rounded) +
                                     static_cast<double>(ulps_away(rounded, below(2) != 0 ? 1 : -1)));
        x1 = static_cast<float>((middle - static_cast<double>(x0) * (1 - f)) / f);
        break;
      }
      case 5:  // results near zero
        x1 = ulps_away(static_cast<float>(-static_cast<double>(x0) * (1 - f) / f), few / 50);
        break;
      case 6:  // results near zero, less so
        x1 = static_cast<float>(-static_cast<double>(x0) * (1 - f) / f *
                                (1 + static_cast<double>(scaled(-24, -2))));
        break;
      case 7:  // at rest, zeros of both signs, from or to zero
        x0 = below(2) != 0 ? x0 : below(2) != 0 ? 0.0F : -0.0F;
        x1 = below(2) != 0 ? x0 : below(2) != 0 ? 0.0F : below(2) != 0 ? -0.0F : static_cast<float>(unit());
        break;
      case 8:  // subnormals
        x0 = scaled(-149, -122), x1 = below(2) != 0 ? scaled(-149, -122) : ulps_away(x0, few);
        break;
      case 9:  // underflow of one end
        x0 = scaled(-149, -100), x1 = scaled(-149, -60);
        break;
      case 10: {  // ties, the ends up to 2^9 times larger than the result
        const double half = std::ldexp(1.0, std::ilogb(x0) - 24);
        const double dx = l * half * std::rint(std::ldexp(unit(), static_cast<int>(below(34))) / l);
        x1 = static_cast<float>(static_cast<double>(x0) + dx);
        x0 = static_cast<float>(static_cast<double>(x1) - dx);
        break;
      }
      case 11:  // the largest admissible
        x0 = below(2) != 0 ? 1e30F : -1e30F, x1 = below(2) != 0 ? ulps_away(x0, few) : scaled(0, 99);
        break;
      default:
        x1 = static_cast<float>(static_cast<double>(x0) + 0.02 * unit());
    }
  }

 private:
  std::mt19937_64 random_;
};

/// x * 2^scale as an integer, which it must be.
boost::multiprecision::cpp_int whole(double x, int scale) {
  int exponent = 0;
  const double fraction = std::frexp(x, &exponent);
  const auto mantissa = static_cast<std::int64_t>(std::ldexp(fraction, 53));
  const int shift = exponent - 53 + scale;
  boost::multiprecision::cpp_int wide(mantissa);
  if (shift >= 0) return wide <<= static_cast<unsigned>(shift);
  return wide >>= static_cast<unsigned>(-shift);
}

/// Frames of clips as users compute them: l per keyframe, keyframes at odd and even times.
TEST(RoundFrames, AreTheExactValuesRounded) {
  const std::uint64_t wanted = slow() ? 10'000'000 : 300'000;
  FramePairs pairs(1729);
  const int frames_to_keyframe[] = {10, 30, 100, 7, 3, 64, 1000, 1024, 97, 1030, 3000};
  const double keyframe_steps[] = {1, 1.0 / 24, 1.0 / 30, 0.1, 10, 3, 1 / 3.0};
  RoundingStats stats;
  std::uint64_t checked = 0, wrong = 0, ties = 0;
  std::vector<float> x0, x1;
  for (std::uint64_t round = 0; checked < wanted; ++round) {
    const int l = frames_to_keyframe[round % std::size(frames_to_keyframe)];
    const double step = keyframe_steps[pairs.below(std::size(keyframe_steps))];
    const auto k = static_cast<double>(pairs.below(round % 3 == 0 ? 3 : 300));
    const auto frame = static_cast<double>(1 + pairs.below(std::uint64_t(l - 1)));
    double t0 = k * step, t1 = (k + 1) * step, t = 0;
    if (pairs.below(4) == 0) t0 = k / (1 / step), t1 = (k + 1) / (1 / step);
    switch (pairs.below(4)) {
      case 0:
        t = t0 + (t1 - t0) * frame / l;
        break;
      case 1:
        t = (k * l + frame) * (step / l);
        break;
      case 2:
        t = (k + frame / l) * step;
        break;
      default:
        t = std::nextafter(t0 + (t1 - t0) * (frame / l), pairs.below(2) != 0 ? t1 : t0);
    }
    if (!(t0 < t && t < t1)) continue;
    const double f = (t - t0) / (t1 - t0);
    const std::size_t count = 3 * (60 + pairs.below(140));
    x0.resize(count), x1.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      pairs.pair(static_cast<int>(pairs.below(FramePairs::kinds)), f, l, x0[i], x1[i]);
      const auto admissible = [](float x) { return std::min(std::max(x, -1e30F), 1e30F); };
      x0[i] = admissible(x0[i]), x1[i] = admissible(x1[i]);
    }
    const auto out = with_all_kernels<float>(
        count, [&](float* to) { kbvh::round_chord(x0.data(), x1.data(), count, t0, t1, t, to, &stats); });
    const auto elapsed = whole(t, 120) - whole(t0, 120), duration = whole(t1, 120) - whole(t0, 120);
    for (std::size_t i = 0; i < count; ++i) {
      const auto start = whole(static_cast<double>(x0[i]), 149), end = whole(static_cast<double>(x1[i]), 149);
      const boost::multiprecision::cpp_int twice = 2 * (start * duration + (end - start) * elapsed);
      bool tie = false;
      const bool right = is_nearest_even_by(out[i], [&](float a, float b) {
        const double sum = static_cast<double>(a) + static_cast<double>(b);
        const boost::multiprecision::cpp_int middle = whole(sum, 149) * duration;
        const boost::multiprecision::cpp_int off = abs(twice - middle);
        tie |= (off << 40) < abs(middle);
        return twice.compare(middle);
      });
      ++checked;
      ties += tie ? 1 : 0;
      if (!right && ++wrong <= 10) {
        ADD_FAILURE() << std::hexfloat << x0[i] << ' ' << x1[i] << " times " << t0 << ' ' << t1 << ' ' << t
                      << " gave " << out[i];
      }
    }
  }
  EXPECT_EQ(wrong, 0U) << "of " << checked;
  EXPECT_GT(ties, checked / 20) << "samples that miss the point";
  RecordProperty("values_checked", std::to_string(checked));
  RecordProperty("ties_and_near_ties", std::to_string(ties));
  RecordProperty("second_stage", std::to_string(stats.second_stage));
}

TEST(RoundFrames, LeaveLittleToLaterStages) {
  FramePairs pairs(4);
  std::vector<float> x0(30'000), x1(x0.size());
  for (std::size_t i = 0; i < x0.size(); ++i) pairs.pair(FramePairs::kinds - 1, 0.3, 10, x0[i], x1[i]);
  for (const int l : {10, 30, 100, 64}) {
    for (const double step : {1.0, 1.0 / 24, 10.0}) {
      RoundingStats stats;
      with_all_kernels<float>(x0.size(), [&](float* to) {
        for (int k = 1; k < l; k += 3)
          kbvh::round_chord(x0.data(), x1.data(), x0.size(), 7 * step, 8 * step, (7 + double(k) / l) * step,
                            to, &stats);
      });
      EXPECT_LT(stats.second_stage, stats.values / 500) << l << " frames to a keyframe of " << step;
    }
  }
}

}  // namespace
