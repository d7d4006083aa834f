// Correct rounding of positions against rational arithmetic, with every kernel set. KBVH_SLOW=1 checks 10
// million values and as many at frames of clips instead of 200,000 and 300,000.
#include "core/motion/round_positions.hpp"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/support/rounding.hpp"

namespace {

using kbvh::Piece;
using kbvh::PieceKind;
using kbvh::RoundingStats;
using kbvh::testing_support::is_nearest_even_by;
using kbvh::testing_support::slow;
using kbvh::testing_support::with_all_kernels;
using Rational = boost::multiprecision::cpp_rational;

Rational exact(double x) {
  return Rational(x);
}

Rational chord_value(double x0, double x1, double t0, double t1, double t) {
  return exact(x0) + (exact(x1) - exact(x0)) * (exact(t) - exact(t0)) / (exact(t1) - exact(t0));
}

Rational ray_value(double x0, double v, double t0, double t) {
  return exact(x0) + exact(v) * (exact(t) - exact(t0));
}

template <class S>
bool is_nearest_even(S rounded, const Rational& value) {
  const Rational twice = value * 2;
  return is_nearest_even_by(rounded, [&](S a, S b) { return twice.compare(exact(a) + exact(b)); });
}

TEST(RoundPositionsChecker, KnowsRightFromWrong) {
  const float one = 1.0F, next = std::nextafter(1.0F, 2.0F), after = std::nextafter(next, 2.0F);
  const Rational tie = (exact(one) + exact(next)) / 2, odd_tie = (exact(next) + exact(after)) / 2;
  EXPECT_TRUE(is_nearest_even(one, tie));
  EXPECT_FALSE(is_nearest_even(next, tie));
  EXPECT_FALSE(is_nearest_even(next, odd_tie));
  EXPECT_TRUE(is_nearest_even(after, odd_tie));
  const Rational more = tie + exact(1e-300);
  EXPECT_TRUE(is_nearest_even(next, more));
  EXPECT_FALSE(is_nearest_even(one, more));
  EXPECT_FALSE(is_nearest_even(-0.0F, Rational(0)));
  EXPECT_TRUE(is_nearest_even(0.0F, exact(0x1p-150)));
  EXPECT_FALSE(is_nearest_even(0x1p-149F, exact(0x1p-150)));
  EXPECT_TRUE(is_nearest_even(0x1p-148F, exact(0x1.8p-149)));
}

/// Pairs of values of one kind, and times that ordinary (and hostile) users choose.
template <class S>
class Samples {
 public:
  static constexpr int kinds = 10;
  explicit Samples(std::uint64_t seed) : random_(seed) {}

  S value(int magnitude_low, int magnitude_high) {
    const int exponent =
        magnitude_low + static_cast<int>(random_() % std::uint64_t(magnitude_high - magnitude_low));
    return static_cast<S>(std::ldexp(unit(), exponent));
  }

  void pair(int kind, S& x0, S& x1) {
    const S infinity = std::numeric_limits<S>::infinity();
    const bool is_float = std::numeric_limits<S>::digits == 24;
    x0 = static_cast<S>(unit());
    switch (kind) {
      case 0:
        x1 = static_cast<S>(unit());
        break;
      case 1:
        x1 = static_cast<S>(static_cast<double>(x0) + 0.02 * unit());
        break;
      case 2:  // a few ulps apart: nearly every value is a tie or next to one
        x1 = x0;
        for (auto n = random_() % 20; n > 0; --n) x1 = std::nextafter(x1, infinity);
        break;
      case 3:
        x1 = -x0;
        break;
      case 4:
        x0 = value(-20, 20), x1 = value(-20, 20);
        break;
      case 5:  // whole admissible range
        x0 = is_float ? value(-140, 99) : value(-300, 330);
        x1 = is_float ? value(-140, 99) : value(-300, 330);
        break;
      case 6:  // subnormals
        x0 = is_float ? value(-149, -120) : value(-1074, -1000);
        x1 = is_float ? value(-149, -120) : value(-1074, -1000);
        break;
      case 7:
        x0 = random_() % 2 ? x0 : S(0), x1 = random_() % 2 ? x0 : S(-0.0);
        break;
      case 8: {  // short numbers, as in hand-made scenes
        x0 = static_cast<S>(static_cast<int>(random_() % 201) - 100) / S(8);
        x1 = static_cast<S>(static_cast<int>(random_() % 201) - 100) / S(10);
        break;
      }
      default: {  // the largest admissible
        const double top = is_float ? 1e30 : 1e100;
        x0 = static_cast<S>(random_() % 2 ? top : -top);
        x1 = static_cast<S>(random_() % 2 ? top * 0.999 : unit());
      }
    }
  }

  static constexpr int time_kinds = 14;
  void times(int kind, double& t0, double& t1, double& t) {
    t0 = 0, t1 = 1;
    const auto fraction = [&](int parts) {
      return static_cast<double>(1 + random_() % std::uint64_t(parts - 1)) / parts;
    };
    switch (kind) {
      case 0:
        t = 0.5;
        break;
      case 1:
        t = 0.25;
        break;
      case 2:
        t = fraction(10);
        break;
      case 3:
        t = fraction(30);
        break;
      case 4:
        t = fraction(100);
        break;
      case 5:
        t = std::fabs(unit());
        break;
      case 6: {
        const auto frame = static_cast<double>(random_() % 300);
        t0 = frame / 30, t1 = (frame + 1) / 30, t = t0 + (t1 - t0) * fraction(10);
        break;
      }
      case 7:
        t0 = 100 * unit(), t1 = t0 + 1e-6, t = t0 + 1e-6 * fraction(100);
        break;
      case 8:
        t0 = unit() - 1, t1 = 1 + unit(), t = 0.3 * unit();
        break;
      case 9:
        t0 = 1e15, t1 = 1e15 + 3, t = 1e15 + (random_() % 2 ? 1 : 2.5);
        break;
      case 10:
        t0 = -1e-9, t1 = 1e9, t = std::ldexp(std::fabs(unit()), static_cast<int>(random_() % 60) - 30);
        break;
      case 11:
        t0 = 1e-200, t1 = 3e-200, t = 2.2e-200;
        break;
      case 12:
        t1 = std::ldexp(1.0, 200), t = std::ldexp(std::fabs(unit()), static_cast<int>(random_() % 500) - 300);
        break;
      default:
        t = std::nextafter(random_() % 2 ? 0.5 : 1.0, 0.0);
    }
    if (t < t0) t = t0;
    if (t > t1) t = t1;
  }

  double unit() { return 2 * static_cast<double>(random_() >> 11) * 0x1p-53 - 1; }

 private:
  std::mt19937_64 random_;
};

template <class S>
class RoundPositions : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RoundPositions, Scalars);

TYPED_TEST(RoundPositions, AreTheExactValuesRounded) {
  using S = TypeParam;
  const std::uint64_t wanted = slow() ? 5'000'000 : 100'000;
  Samples<S> samples(20060101);
  std::vector<S> x0, x1, out, scattered;
  RoundingStats stats;
  std::uint64_t checked = 0, wrong = 0;
  for (std::uint64_t round = 0; checked < wanted; ++round) {
    double t0 = 0, t1 = 1, t = 0;
    const auto time_kind = static_cast<int>(round % Samples<S>::time_kinds);
    samples.times(time_kind, t0, t1, t);
    // Lengths around the block size; several kinds of values in one call.
    const std::size_t count = 3 * (40 + round % 140);
    x0.resize(count), x1.resize(count), out.assign(count, S(7)), scattered.assign(count, S(7));
    for (std::size_t i = 0; i < count; ++i) {
      samples.pair(static_cast<int>((i / 8 + round) % Samples<S>::kinds), x0[i], x1[i]);
    }
    const bool ray = round % 5 == 4;
    if (ray) {
      if (time_kind == 12) t = std::ldexp(t, -150);  // keep positions finite
      out = with_all_kernels<S>(
          count, [&](S* to) { kbvh::round_ray(x0.data(), x1.data(), count, t0, t, to, &stats); });
    } else {
      out = with_all_kernels<S>(
          count, [&](S* to) { kbvh::round_chord(x0.data(), x1.data(), count, t0, t1, t, to, &stats); });
      std::vector<std::uint32_t> vertices;
      for (std::uint32_t v = 0; 3 * v < count; ++v)
        vertices.push_back(static_cast<std::uint32_t>(count / 3) - 1 - v);
      scattered = with_all_kernels<S>(count, [&](S* to) {
        kbvh::round_chord_vertices(x0.data(), x1.data(), vertices.data(), vertices.size(), t0, t1, t, to);
      });
      ASSERT_EQ(out, scattered);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const Rational value = ray ? ray_value(x0[i], x1[i], t0, t) : chord_value(x0[i], x1[i], t0, t1, t);
      if (ray && abs(value) > exact(std::numeric_limits<S>::max()) / 2) continue;
      ++checked;
      const Piece<S> piece{t0, t1, x0[i], x1[i], ray ? PieceKind::ray : PieceKind::chord};
      const bool right = is_nearest_even(out[i], value) && kbvh::round_piece(piece, t) == out[i];
      if (!right && ++wrong <= 10) {
        ADD_FAILURE() << (ray ? "ray " : "chord ") << std::hexfloat << x0[i] << ' ' << x1[i] << " times "
                      << t0 << ' ' << t1 << ' ' << t << " gave " << out[i] << " and "
                      << kbvh::round_piece(piece, t);
      }
    }
  }
  EXPECT_EQ(wrong, 0U) << "of " << checked;
  EXPECT_GE(stats.values, checked);
  this->RecordProperty("values_checked", std::to_string(checked));
  this->RecordProperty("second_stage", std::to_string(stats.second_stage));
  this->RecordProperty("exact_stage", std::to_string(stats.exact));
}

TYPED_TEST(RoundPositions, StoredValuesComeBackAtBothEnds) {
  using S = TypeParam;
  const std::vector<S> x0{S(-0.0), S(1), S(0.1)}, x1{S(2), S(-0.0), S(0.3)};
  std::vector<S> out(3);
  kbvh::round_chord(x0.data(), x1.data(), 3, 0.1, 0.7, 0.1, out.data());
  EXPECT_EQ(out, x0);
  EXPECT_FALSE(std::signbit(out[0]));
  kbvh::round_chord(x0.data(), x1.data(), 3, 0.1, 0.7, 0.7, out.data());
  EXPECT_EQ(out, x1);
  EXPECT_FALSE(std::signbit(out[1]));
  kbvh::round_ray(x0.data(), x1.data(), 3, 0.1, 0.1, out.data());
  EXPECT_EQ(out, x0);
}

TYPED_TEST(RoundPositions, HoldNoNegativeZero) {
  using S = TypeParam;
  const S least = std::numeric_limits<S>::denorm_min();
  const std::vector<S> x0{S(-0.0), S(-1), S(-least), S(-0.0)}, x1{S(-0.0), S(1), S(-0.0), least};
  std::vector<S> out(4, S(9));
  for (const double t : {0.5, 0.25, 0.75, 0.1}) {
    kbvh::round_chord(x0.data(), x1.data(), 4, 0.0, 1.0, t, out.data());
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_TRUE(is_nearest_even(out[i], chord_value(x0[i], x1[i], 0, 1, t))) << i << " at " << t;
    }
  }
}

TYPED_TEST(RoundPositions, MayReplaceTheirInput) {
  using S = TypeParam;
  Samples<S> samples(5);
  std::vector<S> x0(1000), x1(1000), out(1000);
  for (std::size_t i = 0; i < x0.size(); ++i) samples.pair(static_cast<int>(i % 3), x0[i], x1[i]);
  kbvh::round_chord(x0.data(), x1.data(), x0.size(), 0.0, 1.0, 0.3, out.data());
  auto first = x0, second = x1;
  kbvh::round_chord(first.data(), x1.data(), x0.size(), 0.0, 1.0, 0.3, first.data());
  kbvh::round_chord(x0.data(), second.data(), x0.size(), 0.0, 1.0, 0.3, second.data());
  EXPECT_EQ(first, out);
  EXPECT_EQ(second, out);
}

TYPED_TEST(RoundPositions, AreMonotoneInTime) {
  using S = TypeParam;
  Samples<S> samples(6);
  std::vector<S> x0(64), x1(64), before(64), now(64);
  for (std::size_t i = 0; i < x0.size(); ++i) samples.pair(2, x0[i], x1[i]);
  before = x0;
  for (int k = 1; k <= 500; ++k) {
    kbvh::round_chord(x0.data(), x1.data(), x0.size(), 0.0, 1.0, k / 500.0, now.data());
    for (std::size_t i = 0; i < x0.size(); ++i) ASSERT_LE(before[i], now[i]);
    before = now;
  }
}

TYPED_TEST(RoundPositions, RayOverflowsToInfinity) {
  using S = TypeParam;
  const S start = 0, speed = sizeof(S) == 4 ? S(1e30) : S(1e100);
  S out = 0;
  kbvh::round_ray(&start, &speed, 1, 0.0, sizeof(S) == 4 ? 1e30 : 1e250, &out);
  EXPECT_EQ(out, std::numeric_limits<S>::infinity());
}

TYPED_TEST(RoundPositions, RefuseTimesOutOfOrder) {
  using S = TypeParam;
  const S x = 1;
  S out = 0;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_THROW(kbvh::round_chord(&x, &x, 1, 1.0, 1.0, 1.0, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_chord(&x, &x, 1, 0.0, 1.0, 1.5, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_chord(&x, &x, 1, 0.0, 1.0, -0.5, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_chord(&x, &x, 1, 0.0, 1.0, nan, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_chord(&x, &x, 1, 0.0, infinity, 1.0, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_ray(&x, &x, 1, 1.0, 0.5, &out), std::invalid_argument);
  EXPECT_THROW(kbvh::round_ray(&x, &x, 1, 1.0, nan, &out), std::invalid_argument);
  try {
    kbvh::round_chord(&x, &x, 1, 0.0, 1.0, 1.5, &out);
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("t = 1.5"), std::string::npos) << error.what();
  }
}

}  // namespace
