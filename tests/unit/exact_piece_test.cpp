// Every sign of exact_piece.hpp against rational arithmetic: random pieces and the ties of structured scenes.
#include "core/motion/exact_piece.hpp"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

namespace {

using kbvh::Crossing;
using kbvh::Piece;
using kbvh::PieceKind;
using Rational = boost::multiprecision::cpp_rational;

/// x(t) = offset + slope t, from the definition in piece.hpp.
struct Line {
  Rational offset, slope;
  Rational at(const Rational& t) const { return offset + slope * t; }
};

template <class S>
Line line(const Piece<S>& p) {
  const Rational x0(static_cast<double>(p.x0)), x1(static_cast<double>(p.x1)), t0(p.t0);
  const Rational slope = p.kind == PieceKind::ray ? x1 : Rational((x1 - x0) / (Rational(p.t1) - t0));
  return {x0 - slope * t0, slope};
}

template <class S>
Rational root(const Crossing<S>& c) {
  const Line l = line(c.loser), w = line(c.winner);
  return (w.offset - l.offset) / (l.slope - w.slope);
}

int sign(const Rational& x) {
  return x.sign();
}

/// Families of four pieces and a time; small integers and shared numbers make most comparisons ties.
template <class S>
class Samples {
 public:
  static constexpr int families = 12;
  explicit Samples(std::uint64_t seed) : random_(seed) {}

  double unit() { return 2 * static_cast<double>(random_() >> 11) * 0x1p-53 - 1; }
  int pick(int count) { return static_cast<int>(random_() % static_cast<std::uint64_t>(count)); }
  double time() { return time_; }

  void frame(int family) {
    t0_ = 0, t1_ = 1, time_ = std::fabs(unit());
    if (family == 2 || family == 3) time_ = pick(11) / 10.0;
    if (family == 4) t0_ = pick(300) / 30.0, t1_ = t0_ + 1 / 30.0, time_ = t0_ + pick(11) / 300.0;
    if (family == 5) t0_ = unit(), t1_ = t0_ + 1e-6, time_ = t0_ + 5e-7;
    if (family == 6) t0_ = 1e15, t1_ = 1e15 + 1, time_ = t0_ + pick(2);
    if (family == 7) t0_ = -1e-200, t1_ = 1e200, time_ = std::ldexp(1.0, pick(1200) - 600);
  }

  Piece<S> piece(int family) {
    Piece<S> p;
    p.t0 = t0_, p.t1 = t1_, p.kind = PieceKind::chord;
    switch (family) {
      case 0:
      case 5:
      case 6:
        p.x0 = static_cast<S>(unit()), p.x1 = static_cast<S>(unit());
        break;
      case 1:
        p.x0 = static_cast<S>(unit()), p.x1 = static_cast<S>(static_cast<double>(p.x0) + 1e-3 * unit());
        break;
      case 2:
      case 4:
        p.x0 = static_cast<S>(pick(5)), p.x1 = static_cast<S>(pick(5));
        break;
      case 3:
        p.x0 = static_cast<S>(0.1 * pick(5)), p.x1 = static_cast<S>(0.1 * pick(5));
        break;
      case 7:
        p.x0 = wide(), p.x1 = wide();
        break;
      case 8:  // rays from one start
        p.kind = PieceKind::ray, p.x0 = static_cast<S>(pick(5)), p.x1 = static_cast<S>(pick(5)) / S(4);
        break;
      case 9:  // rays from several starts, as online plans have
        p.kind = PieceKind::ray, p.t0 = pick(4) / 10.0;
        p.x0 = static_cast<S>(pick(5)), p.x1 = static_cast<S>(pick(5)) / S(10);
        break;
      case 10:  // everything mixed, structured
        p.kind = pick(2) ? PieceKind::ray : PieceKind::chord;
        p.t0 = pick(3) / 4.0, p.t1 = p.t0 + (1 + pick(3)) / 2.0;
        p.x0 = static_cast<S>(pick(4)), p.x1 = static_cast<S>(pick(4));
        break;
      default:  // everything mixed, random
        p.kind = pick(2) ? PieceKind::ray : PieceKind::chord;
        p.t0 = unit(), p.t1 = p.t0 + std::fabs(unit()) + 1e-3;
        p.x0 = static_cast<S>(unit()), p.x1 = static_cast<S>(unit());
    }
    return p;
  }

 private:
  S wide() {
    const bool is_float = std::numeric_limits<S>::digits == 24;
    return static_cast<S>(std::ldexp(unit(), is_float ? pick(248) - 149 : pick(1404) - 1074));
  }

  std::mt19937_64 random_;
  double t0_ = 0, t1_ = 1, time_ = 0;
};

template <class S>
class ExactPiece : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(ExactPiece, Scalars);

TYPED_TEST(ExactPiece, SignsAreThoseOfRationals) {
  using S = TypeParam;
  const char* slow = std::getenv("KBVH_SLOW");
  const int rounds = slow != nullptr && std::strcmp(slow, "0") != 0 && *slow != '\0' ? 200'000 : 3'000;
  Samples<S> samples(2006);
  int ties = 0, checked = 0;
  for (int i = 0; i < rounds; ++i) {
    const int family = i % Samples<S>::families;
    samples.frame(family);
    const Piece<S> a = samples.piece(family), b = samples.piece(family), c = samples.piece(family);
    const Piece<S> d = samples.pick(4) == 0 ? b : samples.piece(family);
    const Line la = line(a), lb = line(b);
    const std::string where = "family " + std::to_string(family) + " round " + std::to_string(i);
    const auto expect = [&](int got, int wanted, const char* what) {
      ++checked;
      ties += wanted == 0;
      EXPECT_EQ(got, wanted) << what << ", " << where;
    };
    const double t = samples.time();
    expect(kbvh::compare_at(a, b, t), sign(la.at(Rational(t)) - lb.at(Rational(t))), "compare_at");
    expect(kbvh::compare_slopes(a, b), sign(la.slope - lb.slope), "compare_slopes");
    for (const double end : {a.t0, a.t1, b.t0}) {
      expect(kbvh::compare_at(a, b, end), sign(la.at(Rational(end)) - lb.at(Rational(end))),
             "compare_at an end");
    }
    const Crossing<S> x{a, b}, y{c, d};
    const bool crosses = la.slope != lb.slope, crosses_too = line(c).slope != line(d).slope;
    if (!crosses) {
      EXPECT_THROW(kbvh::compare_crossing_to(x, t), std::invalid_argument) << where;
      EXPECT_THROW(kbvh::compare_at_crossing(c, d, x), std::invalid_argument) << where;
      EXPECT_THROW(kbvh::crossing_estimate(x), std::invalid_argument) << where;
      continue;
    }
    const Rational rx = root(x);
    expect(kbvh::compare_crossing_to(x, t), sign(rx - Rational(t)), "compare_crossing_to");
    const kbvh::TimeEstimate estimate = kbvh::crossing_estimate(x);
    if (std::isfinite(estimate.error)) {
      const Rational off = abs(Rational(rx - Rational(estimate.time)));
      EXPECT_LE(off, Rational(estimate.error))
          << where << " estimate " << estimate.time << " +- " << estimate.error;
      // A hint that is a double brings the comparison to the edge.
      expect(kbvh::compare_crossing_to(x, estimate.time), sign(rx - Rational(estimate.time)), "at the hint");
    } else {
      EXPECT_TRUE(std::isinf(estimate.time)) << where;
    }
    expect(kbvh::compare_at_crossing(a, b, x), 0, "compare_at_crossing of its own pieces");
    expect(kbvh::compare_at_crossing(c, d, x), sign(line(c).at(rx) - line(d).at(rx)), "compare_at_crossing");
    expect(kbvh::compare_at_crossing(a, d, x), sign(la.at(rx) - line(d).at(rx)),
           "compare_at_crossing, shared");
    expect(kbvh::compare_crossings(x, x), 0, "compare_crossings with itself");
    expect(kbvh::compare_crossings(x, Crossing<S>{b, a}), 0, "compare_crossings, exchanged");
    if (crosses_too) {
      expect(kbvh::compare_crossings(x, y), sign(rx - root(y)), "compare_crossings");
      expect(kbvh::compare_crossings(y, x), sign(root(y) - rx), "compare_crossings, swapped");
    }
  }
  EXPECT_GT(ties, checked / 20) << "the families no longer make ties";
  this->RecordProperty("signs_checked", checked);
  this->RecordProperty("ties", ties);
}

TYPED_TEST(ExactPiece, HintsInOneFrameAreGoodToAFewUlps) {
  using S = TypeParam;
  Samples<S> samples(7);
  for (int i = 0; i < 2000; ++i) {
    samples.frame(i % 2);
    const Crossing<S> c{samples.piece(i % 2), samples.piece(i % 2)};
    if (kbvh::compare_slopes(c.winner, c.loser) == 0) continue;
    const kbvh::TimeEstimate estimate = kbvh::crossing_estimate(c);
    EXPECT_LE(estimate.error, 16 * 0x1p-53 * std::fabs(estimate.time) + 0x1p-990);
  }
}

TYPED_TEST(ExactPiece, SymmetricFlightPlansCrossTogether) {
  using S = TypeParam;
  // Two vertices that mirror two others cross at the same instant, 1/3 of the way: no double is that time.
  const Piece<S> low{0, 1, S(0), S(2), PieceKind::chord}, high{0, 1, S(1), S(0), PieceKind::chord};
  const Piece<S> low2{0, 1, S(10), S(14), PieceKind::chord}, high2{0, 1, S(12), S(10), PieceKind::chord};
  const Crossing<S> x{high, low}, y{high2, low2};
  EXPECT_EQ(kbvh::compare_crossings(x, y), 0);
  EXPECT_NE(kbvh::compare_crossing_to(x, kbvh::crossing_estimate(x).time), 0);
  Piece<S> later = high2;
  later.x0 = std::nextafter(later.x0, S(100));
  EXPECT_EQ(kbvh::compare_crossings(x, Crossing<S>{later, low2}), -1);
}

}  // namespace
