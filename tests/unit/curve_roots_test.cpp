// Roots of curves, their order and signs at them, against rational arithmetic: 10^5 random and 10^3
// adversarial pairs of pieces, with multiple roots, common roots, equal pieces, roots at knots, and nearly
// equal coefficients.
#include "core/motion/curve_roots.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/motion/round_curve.hpp"
#include "tests/support/rational_curves.hpp"
#include "tests/support/rounding.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::curve_roots_test {
namespace {

template <class S>
std::string text(const CurvedPiece<S>& p) {
  char line[240];
  std::snprintf(line, sizeof line, "{%.17g, %.17g, %.9g, %.9g, %.9g, %.9g}", p.t0, p.t1, double(p.x0),
                double(p.x1), double(p.bend), double(p.twist));
  return line;
}

template <class S>
struct Pair {
  CurvedPiece<S> a, b;
  std::string text() const { return curve_roots_test::text(a) + " and " + curve_roots_test::text(b); }
};

/// Pairs of pieces; most families are made so that differences have several roots in the segment.
template <class S>
class Pairs {
 public:
  static constexpr int random_families = 5;
  static constexpr int adversarial_families = 10;
  explicit Pairs(std::uint64_t seed) : random_(seed) {}

  Pair<S> random(int family) {
    Pair<S> pair;
    frame(pair, family % 3);
    for (CurvedPiece<S>* piece : {&pair.a, &pair.b}) {
      piece->x0 = S(random_.unit()), piece->x1 = S(random_.unit());
      if (family != 3) piece->bend = S(4 * random_.unit());
      if (family != 1 && family != 3) piece->twist = S(8 * random_.unit());
    }
    if (family == 2) pair.b.bend = pair.a.bend, pair.b.twist = pair.a.twist;  // gravity alone
    if (family == 4) pair.b.x0 = pair.a.x0;
    return pair;
  }

  Pair<S> adversarial(int family) {
    Pair<S> pair;
    frame(pair, family % 4);
    const double places[] = {0, 0.25, 0.5, 0.75, 1, 1.0 / 3, 0.3, -0.5, 1.5, 0.4999999, 0.5000001};
    const auto place = [&] { return places[random_.below(11)]; };
    const double r = place(), q = family < 4 ? r : place(), p = family < 2 ? r : place();
    switch (family) {
      case 0:  // triple roots, nearly or exactly
      case 1:  // the same, in large numbers
      case 2:  // double roots
      case 3:
      case 4:  // any three
      case 5:
        from_roots(pair, r, q, p, family == 1 ? 0x1p60 : 1);
        break;
      case 6:  // small integers
        for (CurvedPiece<S>* piece : {&pair.a, &pair.b})
          for (S* x : {&piece->x0, &piece->x1, &piece->bend, &piece->twist})
            *x = S(int(random_.below(7)) - 3);
        break;
      case 7:  // nearly equal pieces
        pair = random(0);
        pair.b = pair.a;
        for (S* x : {&pair.b.x0, &pair.b.x1, &pair.b.bend, &pair.b.twist})
          if (random_.below(2) == 0) *x = std::nextafter(*x, random_.below(2) == 0 ? S(9) : S(-9));
        break;
      case 8:  // extreme numbers
        pair = random(0);
        for (CurvedPiece<S>* piece : {&pair.a, &pair.b})
          for (S* x : {&piece->x0, &piece->x1, &piece->bend, &piece->twist})
            *x = std::ldexp(*x, int(random_.below(3)) * 90 - 140);
        break;
      default:  // a third of two different curves, and a double root at a start
        from_roots(pair, 0, 0, p, 1);
    }
    if (family == 3 || family == 5) {  // off by one unit
      S* const numbers[] = {&pair.a.x0, &pair.a.x1, &pair.a.bend, &pair.a.twist};
      S& x = *numbers[random_.below(4)];
      x = std::nextafter(x, random_.below(2) == 0 ? S(100) : S(-100));
    }
    return pair;
  }
  Random& generator() { return random_; }

 private:
  void frame(Pair<S>& pair, int kind) {
    const double starts[] = {0, 1.0 / 30, -1e6, 0.1}, lengths[] = {1, 1.0 / 30, 1e-3, 0.7};
    for (CurvedPiece<S>* piece : {&pair.a, &pair.b}) {
      piece->t0 = starts[kind];
      piece->t1 = starts[kind] + lengths[kind];
    }
  }
  /// Makes a - b = scale (s - r) (s - q) (s - p), but for rounding.
  static void from_roots(Pair<S>& pair, double r, double q, double p, double scale) {
    const double c0 = -r * q * p, c1 = r * q + r * p + q * p, c2 = -(r + q + p);
    pair.a.twist = S(-scale);
    pair.a.bend = S(-scale - scale * c2);
    pair.a.x0 = S(scale * c0);
    pair.a.x1 = S(scale * (c0 + c1 + c2 + 1));
  }
  Random random_;
};

/// Returns the sign right after a root.
int rational_sign_after(const RationalPolynomial& p, const Rational& root_end) {
  const Sturm sturm(p);
  Rational step = 1;
  while (sturm.roots_in(root_end, root_end + step) > 0) step /= 16;
  return value(p, root_end + step).sign();
}

Rational moved(const Rational& s, double t0, double t1) {
  return Rational(t0) + s * (Rational(t1) - Rational(t0));
}

/// Compares every root of a pair with rational arithmetic; returns their number.
template <class S>
int check_roots(const Pair<S>& pair, CurveStats& stats) {
  const SegmentRoots found = segment_roots(pair.a, pair.b, &stats), back = segment_roots(pair.b, pair.a);
  const RationalPolynomial p = rational_difference(pair.a, pair.b);
  EXPECT_EQ(found.equal, p.empty()) << pair.text();
  EXPECT_EQ(back.count, found.count) << pair.text();
  if (p.empty()) return 0;
  const Sturm sturm(p);
  const int at_start = value(p, 0).is_zero() ? 1 : 0, at_end = value(p, 1).is_zero() ? 1 : 0;
  EXPECT_EQ(found.count, sturm.roots_in(0, 1) - at_end + at_start) << pair.text();
  if (testing::Test::HasFailure()) return 0;
  for (int i = 0; i < found.count; ++i) {
    const CurveRoot& root = found.roots[i];
    const Rational begin(root.begin), end(root.end);
    if (root.isolated && begin == end) {
      EXPECT_TRUE(value(p, begin).is_zero()) << pair.text();
      EXPECT_EQ(root.after, rational_sign_after(p, begin)) << pair.text();
    } else if (root.isolated) {
      // One root, not at an end: the sign there is that after the root. The start may be a root of its own.
      EXPECT_EQ(sturm.roots_in(begin, end), 1) << pair.text();
      EXPECT_EQ(root.after, value(p, end).sign()) << pair.text();
      if (!begin.is_zero()) {
        EXPECT_FALSE(value(p, begin).is_zero()) << pair.text();
      }
    } else {
      const RationalRoot exact = rational_roots(p, 70)[std::size_t(i)];
      EXPECT_TRUE(exact.begin <= end && begin <= exact.end) << pair.text();
      EXPECT_EQ(root.after, rational_sign_after(p, exact.end)) << pair.text();
    }
    if (i > 0) {
      EXPECT_GE(root.begin, found.roots[i - 1].end - (root.isolated ? 0 : 1e-14)) << pair.text();
    }
    EXPECT_EQ(back.roots[i].after, -root.after);
    EXPECT_EQ(back.roots[i].begin, root.begin);
    const TimeEstimate estimate = moment_estimate(pair.a, root);
    for (const Rational& s : {begin, end})
      EXPECT_LE(abs(moved(s, pair.a.t0, pair.a.t1) - Rational(estimate.time)), Rational(estimate.error))
          << pair.text();
  }
  return found.count;
}

/// Returns the sign of the difference of two roots, of polynomials in their own segments.
int rational_order(const RationalPolynomial& p, std::size_t i, double p0, double p1,
                   const RationalPolynomial& q, std::size_t j, double q0, double q1) {
  for (int bits = 60;; bits *= 2) {
    const RationalRoot x = rational_roots(p, bits)[i], y = rational_roots(q, bits)[j];
    const Rational xb = moved(x.begin, p0, p1), xe = moved(x.end, p0, p1), yb = moved(y.begin, q0, q1),
                   ye = moved(y.end, q0, q1);
    if (xe < yb) return -1;
    if (ye < xb) return 1;
    if (x.begin == x.end && y.begin == y.end) return xb < yb ? -1 : xb > yb ? 1 : 0;
    // A common root: q in the share of p's segment.
    const Rational scale = (Rational(p1) - Rational(p0)) / (Rational(q1) - Rational(q0)),
                   shift = (Rational(p0) - Rational(q0)) / (Rational(q1) - Rational(q0));
    RationalPolynomial moved_q, power{1};
    for (const Rational& c : q) {
      moved_q.resize(std::max(moved_q.size(), power.size()), Rational(0));
      for (std::size_t k = 0; k < power.size(); ++k) moved_q[k] += c * power[k];
      RationalPolynomial next(power.size() + 1, Rational(0));
      for (std::size_t k = 0; k < power.size(); ++k) {
        next[k] += power[k] * shift;
        next[k + 1] += power[k] * scale;
      }
      power = next;
    }
    trim(moved_q);
    const RationalPolynomial common = common_divisor(p, moved_q);
    if (common.size() < 2) continue;
    // Equal if both are roots of the common divisor, and it has one root where both are.
    const auto in_share = [&](const Rational& t) {
      return Rational((t - Rational(p0)) / (Rational(p1) - Rational(p0)));
    };
    const Sturm sturm(common);
    const auto roots_in = [&](const Rational& begin, const Rational& end) {
      return sturm.roots_in(begin, end) + (value(common, begin).is_zero() ? 1 : 0);
    };
    const Rational y_begin = in_share(yb), y_end = in_share(ye);
    if (roots_in(x.begin, x.end) == 1 && roots_in(y_begin, y_end) == 1 &&
        roots_in(std::min(x.begin, y_begin), std::max(x.end, y_end)) == 1)
      return 0;
  }
}

template <class S>
struct KnownMoment {
  CurveMoment<S> moment;
  RationalPolynomial p;
};

template <class S>
void check_order(const KnownMoment<S>& x, const KnownMoment<S>& y) {
  const int order = rational_order(x.p, x.moment.root, x.moment.first.t0, x.moment.first.t1, y.p,
                                   y.moment.root, y.moment.first.t0, y.moment.first.t1);
  EXPECT_EQ(compare_moments(x.moment, y.moment), order)
      << text(x.moment.first) << text(x.moment.second) << x.moment.root << " and " << text(y.moment.first)
      << text(y.moment.second) << y.moment.root;
  EXPECT_EQ(compare_moments(y.moment, x.moment), -order);
}

template <class S>
void add_moments(const Pair<S>& pair, std::vector<KnownMoment<S>>& moments) {
  const SegmentRoots found = segment_roots(pair.a, pair.b);
  for (int i = 0; i < found.count; ++i)
    moments.push_back({{pair.a, pair.b, std::uint32_t(i)}, rational_difference(pair.a, pair.b)});
}

template <class S>
void check_random(int count, std::uint64_t seed) {
  Pairs<S> pairs(seed);
  CurveStats stats;
  int roots = 0, several = 0;
  for (int i = 0; i < count && !testing::Test::HasFailure(); ++i) {
    const int here = check_roots(pairs.random(i % Pairs<S>::random_families), stats);
    roots += here;
    several += here > 1 ? 1 : 0;
  }
  EXPECT_GT(roots, count / 3);
  EXPECT_GT(several, count / 50);
  EXPECT_LT(stats.exact, stats.searches / 500) << "the filter decides nearly always";
  testing::Test::RecordProperty("exact", int(stats.exact));
}

TEST(CurveRoots, EqualRationalArithmeticOnRandomPairsOfFloats) {
  check_random<float>(testing_support::slow() ? 1000000 : 100000, 1);
}
TEST(CurveRoots, EqualRationalArithmeticOnRandomPairsOfDoubles) {
  check_random<double>(testing_support::slow() ? 1000000 : 100000, 2);
}

template <class S>
void check_adversarial(int count, std::uint64_t seed) {
  Pairs<S> pairs(seed);
  CurveStats stats;
  int multiple = 0;
  std::vector<KnownMoment<S>> moments;
  for (int i = 0; i < count && !testing::Test::HasFailure(); ++i) {
    const Pair<S> pair = pairs.adversarial(i % Pairs<S>::adversarial_families);
    check_roots(pair, stats);
    const RationalPolynomial p = rational_difference(pair.a, pair.b);
    multiple += p.size() > 2 && common_divisor(p, derivative(p)).size() > 1 ? 1 : 0;
    add_moments(pair, moments);
  }
  EXPECT_GT(multiple, count / 20);
  EXPECT_GT(stats.exact, 0u);
  // Neighbours in the list have other numbers in the same places: 1/2, 1/3 and the like meet often.
  for (std::size_t i = 0; i + 4 < moments.size() && !testing::Test::HasFailure(); ++i)
    for (const std::size_t j : {i + 1, i + 4}) check_order(moments[i], moments[j]);
}

TEST(CurveRoots, EqualRationalArithmeticOnAdversarialPairsOfFloats) {
  check_adversarial<float>(1000, 3);
}
TEST(CurveRoots, EqualRationalArithmeticOnAdversarialPairsOfDoubles) {
  check_adversarial<double>(1000, 4);
}

// A cloth that starts flat: all its vertices meet at one moment, and so do all events.
template <class S>
void check_common_start(std::uint64_t seed) {
  Pairs<S> pairs(seed);
  constexpr int starts_together = 4;
  std::vector<KnownMoment<S>> at_start, later;
  for (int i = 0; i < 60; ++i) {
    const Pair<S> pair = pairs.random(starts_together);
    const SegmentRoots found = segment_roots(pair.a, pair.b);
    ASSERT_GT(found.count, 0);
    EXPECT_EQ(found.roots[0].end, 0);
    EXPECT_EQ(moment_estimate(pair.a, found.roots[0]).error, 0);
    EXPECT_EQ(moment_estimate(pair.a, found.roots[0]).time, pair.a.t0);
    for (std::uint32_t r = 0; r < std::uint32_t(found.count); ++r)
      (r == 0 ? at_start : later).push_back({{pair.a, pair.b, r}, rational_difference(pair.a, pair.b)});
  }
  ASSERT_GT(later.size(), 20u);
  CurveStats stats;
  for (std::size_t i = 0; i + 1 < at_start.size(); ++i) {
    check_order(at_start[i], at_start[i + 1]);
    EXPECT_EQ(compare_moments(at_start[i].moment, at_start[i + 1].moment, &stats), 0);
    EXPECT_EQ(compare_moment_to(at_start[i].moment, at_start[i].moment.first.t0), 0);
  }
  for (std::size_t i = 0; i < later.size(); ++i) {
    EXPECT_EQ(compare_moments(at_start[i].moment, later[i].moment, &stats), -1);
    EXPECT_EQ(compare_moments(later[i].moment, at_start[i].moment, &stats), 1);
  }
  EXPECT_EQ(stats.exact, 0u);
}

TEST(CurveRoots, ACommonStartNeedsNoBigIntegersInFloat) {
  check_common_start<float>(7);
}
TEST(CurveRoots, ACommonStartNeedsNoBigIntegersInDouble) {
  check_common_start<double>(8);
}

template <class S>
void check_signs(std::uint64_t seed) {
  Pairs<S> pairs(seed);
  int zeros = 0;
  for (int i = 0; i < 320 && !testing::Test::HasFailure(); ++i) {
    const Pair<S> pair = i % 2 == 0 ? pairs.random(i % 5) : pairs.adversarial(i % 10);
    Pair<S> other = i % 4 < 2 ? pairs.random(i % 5) : pair;
    if (i % 8 == 0) other.b.x0 = other.a.x0;
    for (CurvedPiece<S>* piece : {&other.a, &other.b}) piece->t0 = pair.a.t0, piece->t1 = pair.a.t1;
    if (i % 4 == 3) other.a.twist = std::nextafter(other.a.twist, S(9));
    const RationalPolynomial p = rational_difference(pair.a, pair.b),
                             q = rational_difference(other.a, other.b);
    const double share =
        i % 3 == 0 ? 0.25 * pairs.generator().below(5) : 0.5 + 0.5 * pairs.generator().unit();
    const double t = std::min(pair.a.t0 + (pair.a.t1 - pair.a.t0) * share, pair.a.t1);
    EXPECT_EQ(compare_at(pair.a, pair.b, t), (rational_value(pair.a, t) - rational_value(pair.b, t)).sign());
    const SegmentRoots found = segment_roots(pair.a, pair.b);
    for (int r = 0; r < found.count; ++r) {
      const CurveMoment<S> moment{pair.a, pair.b, std::uint32_t(r)};
      // The sign at the root: of the common divisor, or near enough to the root that q has one sign.
      int at = 0, after = 0;
      const RationalPolynomial common = q.empty() ? p : common_divisor(p, q);
      for (int bits = 60;; bits *= 2) {
        const RationalRoot root = rational_roots(p, bits)[std::size_t(r)];
        const bool shared =
            value(common, root.end).is_zero() ||
            (root.begin < root.end && common.size() > 1 && Sturm(common).roots_in(root.begin, root.end) > 0);
        if (q.empty()) break;
        if (!shared && (root.begin == root.end || q.size() == 1 ||
                        (Sturm(q).roots_in(root.begin, root.end) == 0 && !value(q, root.begin).is_zero()))) {
          at = value(q, root.end).sign();
          break;
        }
        if (shared && (bits > 100 || root.begin == root.end)) break;
      }
      if (!q.empty())
        after = at != 0 ? at : rational_sign_after(q, rational_roots(p, 120)[std::size_t(r)].end);
      EXPECT_EQ(compare_at_moment(other.a, other.b, moment), at) << pair.text() << other.text();
      EXPECT_EQ(compare_after_moment(other.a, other.b, moment), after) << pair.text() << other.text();
      zeros += at == 0 ? 1 : 0;
      // Against doubles next to it, and the crossing of two lines through such a point.
      const RationalRoot root = rational_roots(p, 120)[std::size_t(r)];
      const double hint = moment_estimate(pair.a, found.roots[r]).time;
      for (const double near : {hint, std::nextafter(hint, 1e9), std::nextafter(hint, -1e9)}) {
        const Rational low = moved(root.begin, pair.a.t0, pair.a.t1),
                       high = moved(root.end, pair.a.t0, pair.a.t1);
        if (low < Rational(near) && Rational(near) < high) continue;  // closer than 2^-120
        const int order = high < Rational(near) || (high == Rational(near) && low < high) ? -1
                          : low > Rational(near)                                          ? 1
                          : low == high                                                   ? 0
                                                                                          : 1;
        EXPECT_EQ(compare_moment_to(moment, near), order) << pair.text();
        const Crossing<S> crossing{{near, 0, S(1), S(2), PieceKind::ray},
                                   {near, 0, S(1), S(-3), PieceKind::ray}};
        EXPECT_EQ(compare_moment_to(moment, crossing), order) << pair.text();
      }
    }
  }
  EXPECT_GT(zeros, 30);
}

TEST(CurveRoots, SignsAtAndAfterRootsAreExactInFloat) {
  check_signs<float>(5);
}
TEST(CurveRoots, SignsAtAndAfterRootsAreExactInDouble) {
  check_signs<double>(6);
}

// An effect on all vertices alike leaves no trace in any certificate: the difference is a line, to the last
// bit.
TEST(CurveRoots, PureGravityCancels) {
  Random random(7);
  const float bend = bend_of_acceleration<float>(-9.81, 1.0 / 30);
  for (int i = 0; i < 2000; ++i) {
    const CurvedPiece<float> a{0.1, 0.1 + 1.0 / 30, float(random.unit()), float(random.unit()), bend, 0},
        b{0.1, 0.1 + 1.0 / 30, float(random.unit()), float(random.unit()), bend, 0};
    const RationalPolynomial p = rational_difference(a, b);
    EXPECT_LE(p.size(), 2u);
    const SegmentRoots found = segment_roots(a, b);
    const Crossing<float> lines{{a.t0, a.t1, a.x0, a.x1, PieceKind::chord},
                                {b.t0, b.t1, b.x0, b.x1, PieceKind::chord}};
    ASSERT_LE(found.count, 1);
    if (found.count == 1) {
      EXPECT_EQ(compare_moment_to(CurveMoment<float>{a, b, 0}, lines), 0);
    } else {
      EXPECT_GE(compare_at(a, b, a.t0) * compare_at(a, b, a.t1), 0);
    }
  }
}

template <class S>
void check_positions(std::uint64_t seed) {
  Pairs<S> pairs(seed);
  RoundingStats stats;
  const double shares[] = {0, 1, 0.5, 0.25, 0.1, 1.0 / 3, 0.7, 1e-12, 1 - 1e-12};
  for (int i = 0; i < 10000 && !testing::Test::HasFailure(); ++i) {
    const CurvedPiece<S> piece = i % 3 == 0 ? pairs.adversarial(i % 10).a : pairs.random(i % 5).a;
    const double share =
        i % 2 == 0 ? shares[pairs.generator().below(9)] : 0.5 + 0.5 * pairs.generator().unit();
    const double t = std::clamp(piece.t0 + (piece.t1 - piece.t0) * share, piece.t0, piece.t1);
    const S rounded = round_piece(piece, t, &stats);
    const Rational twice = rational_value(piece, t) * 2;
    EXPECT_TRUE(testing_support::is_nearest_even_by(
        rounded, [&](S a, S b) { return twice.compare(Rational(double(a)) + Rational(double(b))); }))
        << text(piece) << " at " << t << " is " << rounded;
  }
  EXPECT_LT(stats.exact, stats.values / 10);
}

TEST(RoundCurve, PositionsAreCorrectlyRounded) {
  check_positions<float>(8);
  check_positions<double>(9);
}

// A chord is a curve without bend, and positions of lists are those of single pieces.
TEST(RoundCurve, EqualsChordsAndSinglePieces) {
  Random random(10);
  std::vector<float> x0(60), x1(60), bend(60), twist(60), none(60, 0.0F), out(60), chord(60),
      listed(60, 7.0F);
  for (std::size_t i = 0; i < 60; ++i)
    x0[i] = float(random.unit()), x1[i] = float(random.unit()), bend[i] = float(random.unit()),
    twist[i] = float(random.unit());
  const std::uint32_t vertices[] = {3, 11, 3};
  for (const double t : {0.2, 0.35, 0.55, 0.6, 1.2}) {
    round_curve<float>(x0.data(), x1.data(), none.data(), nullptr, 60, 0.2, 1.2, t, out.data());
    round_chord(x0.data(), x1.data(), 60, 0.2, 1.2, t, chord.data());
    EXPECT_EQ(out, chord);
    round_curve(x0.data(), x1.data(), bend.data(), twist.data(), 60, 0.2, 1.2, t, out.data());
    round_curve_vertices(x0.data(), x1.data(), bend.data(), twist.data(), vertices, 3, 0.2, 1.2, t,
                         listed.data());
    for (std::size_t i = 0; i < 60; ++i) {
      EXPECT_EQ(out[i], round_piece(CurvedPiece<float>{0.2, 1.2, x0[i], x1[i], bend[i], twist[i]}, t));
      EXPECT_EQ(listed[i], i / 3 == 3 || i / 3 == 11 ? out[i] : 7.0F);
    }
  }
  EXPECT_THROW(round_curve<float>(x0.data(), x1.data(), bend.data(), nullptr, 60, 0.2, 0.2, 0.2, out.data()),
               std::invalid_argument);
  EXPECT_THROW(round_curve<float>(x0.data(), x1.data(), bend.data(), nullptr, 60, 0.2, 1.2, 1.3, out.data()),
               std::invalid_argument);
}

// The bulge bounds the distance from the chord, and is reached but for a fifth.
TEST(CurvedPiece, BulgeBoundsTheCurve) {
  Pairs<float> pairs(11);
  for (int i = 0; i < 300; ++i) {
    const CurvedPiece<float> piece = pairs.random(i % 5).a;
    const Bulge<float> bound = bulge(piece.bend, piece.twist);
    double least = 0, most = 0;
    for (int k = 0; k <= 64; ++k) {
      const Rational s(k, 64), chord = Rational(double(piece.x0)) * (1 - s) + Rational(double(piece.x1)) * s;
      const Rational x =
          value(rational_difference(piece, CurvedPiece<float>{piece.t0, piece.t1, 0, 0, 0, 0}), s);
      EXPECT_LE(x, chord + Rational(bound.upper));
      EXPECT_GE(x, chord + Rational(bound.lower));
      const double above = (x - chord).convert_to<double>();
      least = std::min(least, above);
      most = std::max(most, above);
    }
    if (piece.twist == 0.0F) {
      EXPECT_NEAR(most - least, bound.upper - bound.lower, 1e-6);
    }
  }
}

TEST(CurvedPiece, VelocitiesAtTheEndsMakeTheCubic) {
  float bend = 0, twist = 0;
  // x(t) = t^3 - t on [1, 3]: velocities 2 and 26.
  bend_by_velocities(0.0F, 24.0F, 2.0, 26.0, 2.0, bend, twist);
  const CurvedPiece<float> piece{1, 3, 0, 24, bend, twist};
  for (const double t : {1.0, 1.25, 2.0, 2.5, 3.0}) EXPECT_EQ(round_piece(piece, t), float(t * t * t - t));
  // x(t) = 5 - 4.905 t^2 on [0, 2].
  const CurvedPiece<double> thrown{0, 2, 5, 5 - 4 * 4.905, bend_of_acceleration<double>(-9.81, 2), 0};
  EXPECT_NEAR(round_piece(thrown, 0.5), 5 - 4.905 * 0.25, 1e-14);
}

}  // namespace
}  // namespace kbvh::test::curve_roots_test
