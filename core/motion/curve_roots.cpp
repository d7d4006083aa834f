#include "core/motion/curve_roots.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/assert.hpp"
#include "core/motion/algebraic_time.hpp"
#include "core/motion/exact_line.hpp"

namespace kbvh {
namespace {

/// Covers underflow in sums of a few products.
constexpr double kLeast = 0x1p-1000;

/// a - b, exact: g(s) = start (1 - s) + end s + s (1 - s) (bend + twist s).
struct CurveDifference {
  DoubleDouble start, end, bend, twist;

  /// At least as large as any Bernstein coefficient, but for rounding.
  double size() const {
    return std::fabs(start.hi) + std::fabs(end.hi) + std::fabs(bend.hi) + std::fabs(twist.hi);
  }
};

template <class S>
CurveDifference curve_difference(const CurvedPiece<S>& a, const CurvedPiece<S>& b) {
  const auto exact = [](S x, S y) { return two_diff(static_cast<double>(x), static_cast<double>(y)); };
  return {exact(a.x0, b.x0), exact(a.x1, b.x1), exact(a.bend, b.bend), exact(a.twist, b.twist)};
}

bool is_zero(DoubleDouble x) {
  return x.hi == 0;  // a difference that is not zero never rounds to zero
}

/// The factor h of a difference g that has no root at 0 or 1: g = h, s h, (1 - s) h or s (1 - s) h. On 0 < s
/// < 1 both have the same sign. Bernstein coefficients in double, each with an error of at most `error`.
struct Factor {
  double b[4];
  int degree;
  double error;
};

/// Derives the factor. Every coefficient takes at most six operations on numbers of at most 2 `size`, each
/// with a relative error of 2^-53, and leaves out lo parts of at most 2^-53 `size` in all: 16 * 2^-53 covers
/// them.
Factor factor(const CurveDifference& g) {
  const double start = g.start.hi, end = g.end.hi, bend = g.bend.hi, twist = g.twist.hi;
  const double error = 0x1p-49 * g.size() + kLeast;
  const bool zero_start = is_zero(g.start), zero_end = is_zero(g.end);
  if (zero_start && zero_end) return {{bend, bend + twist}, 1, error};
  if (zero_start) return {{end + bend, end + 0.5 * (bend + twist), end}, 2, error};
  if (zero_end) return {{start, start + 0.5 * bend, start + bend + twist}, 2, error};
  const double way = end - start;
  return {{start, start + (way + bend) / 3, end - (way - bend - twist) / 3, end}, 3, error};
}

/// Returns 0 if the value may be zero.
int certain_sign(double value, double error) {
  return value > error ? 1 : value < -error ? -1 : 0;
}

/// Evaluates at s by de Casteljau's algorithm; the derivative, too.
double value_at(const Factor& h, double s, double* derivative = nullptr) {
  double b[4] = {h.b[0], h.b[1], h.b[2], h.b[3]};
  for (int n = h.degree; n > 1; --n)
    for (int i = 0; i < n; ++i) b[i] += (b[i + 1] - b[i]) * s;
  if (h.degree == 0) return b[0];
  if (derivative != nullptr) *derivative = h.degree * (b[1] - b[0]);
  return b[0] + (b[1] - b[0]) * s;
}

/// Splits Bernstein coefficients at `share` into those of both parts.
void split(const double* b, int degree, double share, double* left, double* right) {
  double rest[4] = {b[0], b[1], b[2], b[3]};
  left[0] = rest[0];
  right[degree] = rest[degree];
  for (int n = degree; n > 0; --n) {
    for (int i = 0; i < n; ++i) rest[i] = rest[i] * (1 - share) + rest[i + 1] * share;
    left[degree - n + 1] = rest[0];
    right[n - 1] = rest[n - 1];
  }
}

/// Returns the number of sign variations of coefficients, whatever the signs of the uncertain ones are;
/// negative if that matters.
int variations(const double* b, int degree, double error) {
  int count = 0, last = certain_sign(b[0], error), uncertain = 0;
  if (last == 0 || certain_sign(b[degree], error) == 0) return -1;
  for (int i = 1; i <= degree; ++i) {
    const int sign = certain_sign(b[i], error);
    if (sign == 0) {
      ++uncertain;
      continue;
    }
    // One uncertain sign between two different ones adds no variation.
    if (uncertain > 1 || (uncertain == 1 && sign == last)) return -1;
    count += sign != last ? 1 : 0;
    last = sign;
    uncertain = 0;
  }
  return count;
}

/// Narrows an interval whose ends have certain and different signs, and that contains one root.
CurveRoot narrowed(const Factor& h, double begin, double end) {
  // The rounding of de Casteljau's algorithm: three levels of two operations.
  const double error = 2 * h.error;
  double lo = begin, hi = end, x = 0.5 * (lo + hi), slope = 0;
  const int first = value_at(h, begin) > 0 ? 1 : -1;
  for (int i = 0; i < 60; ++i) {
    const double value = value_at(h, x, &slope);
    const int sign = certain_sign(value, error);
    if (sign == 0) break;
    (sign == first ? lo : hi) = x;
    const double step = x - value / slope;
    const double next = step > lo && step < hi ? step : 0.5 * (lo + hi);
    if (next <= lo || next >= hi) break;
    if (std::fabs(next - x) <= 0x1p-52 * x) {
      x = next;
      break;
    }
    x = next;
  }
  value_at(h, x, &slope);
  double reach = std::max(2 * error / std::fabs(slope), 0x1p-51 * x);
  if (!(reach < 1)) reach = 1;
  for (;; reach *= 4) {
    const double below = std::max(x - reach, lo), above = std::min(x + reach, hi);
    // lo and hi have certain signs: the search ends there.
    if ((below == lo || certain_sign(value_at(h, below), error) == first) &&
        (above == hi || certain_sign(value_at(h, above), error) == -first))
      return {below, above, -first, true};
  }
}

/// Appends the roots of h in (0, 1): Descartes' rule for Bernstein coefficients, with bisection. Returns
/// false if the filter cannot decide.
bool append_certain_roots(const Factor& h, SegmentRoots& found) {
  struct Part {
    double begin, end, b[4];
    int depth;
  };
  // A place of at most 4 bits in each part: 13 levels are exact in double.
  constexpr int deepest = 13;
  constexpr double places[] = {0.5, 0.4375, 0.5625, 0.375, 0.625};
  Part parts[deepest + 2];
  int count = 1;
  parts[0] = {0, 1, {h.b[0], h.b[1], h.b[2], h.b[3]}, 0};
  while (count > 0) {
    const Part part = parts[--count];
    // Each split adds less than the first coefficients' error.
    const double error = h.error * (1 + part.depth);
    const int changes = variations(part.b, h.degree, error);
    if (changes == 0) continue;
    if (changes == 1) {
      const double lowest = 2 * h.error;
      if (certain_sign(value_at(h, part.begin), lowest) == 0 ||
          certain_sign(value_at(h, part.end), lowest) == 0)
        return false;
      found.roots[found.count++] = narrowed(h, part.begin, part.end);
      continue;
    }
    if (part.depth == deepest) return false;
    bool done = false;
    for (const double place : places) {
      Part left{part.begin, 0, {}, part.depth + 1}, right{0, part.end, {}, part.depth + 1};
      split(part.b, h.degree, place, left.b, right.b);
      if (certain_sign(right.b[0], error + h.error) == 0) continue;
      left.end = right.begin = part.begin + (part.end - part.begin) * place;
      parts[count++] = right;  // the left one is next: roots are found in order
      parts[count++] = left;
      done = true;
      break;
    }
    if (!done) return false;
  }
  return true;
}

// ---- exact forms, on big integers

using Coefficients = std::array<Dyadic, 4>;

/// Returns the coefficients of s^i of a - b.
template <class S>
Coefficients exact_coefficients(const CurvedPiece<S>& a, const CurvedPiece<S>& b) {
  const auto exact = [](S x, S y) { return Dyadic(static_cast<double>(x)) - Dyadic(static_cast<double>(y)); };
  const Dyadic start = exact(a.x0, b.x0), end = exact(a.x1, b.x1), bend = exact(a.bend, b.bend),
               twist = exact(a.twist, b.twist);
  return {start, end - start + bend, twist - bend, -twist};
}

/// Returns the coefficients of t^i, up to one positive factor, from those of s^i, s = (t - t0) / (t1 - t0).
Coefficients in_time(const Coefficients& c, double t0, double t1) {
  constexpr int binomial[4][4] = {{1, 0, 0, 0}, {1, 1, 0, 0}, {1, 2, 1, 0}, {1, 3, 3, 1}};
  const Dyadic start(t0), duration = Dyadic(t1) - start;
  std::array<Dyadic, 4> back{Dyadic(1.0), -start, start * start, -(start * start * start)};
  std::array<Dyadic, 4> scale{duration * duration * duration, duration * duration, duration, Dyadic(1.0)};
  Coefficients result;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      result[j] = result[j] + c[i] * scale[i] * back[i - j] * Dyadic(double(binomial[i][j]));
  return result;
}

/// The roots of a polynomial of s in [0, 1), ascending.
std::vector<AlgebraicTime> exact_roots(const Polynomial& p) {
  std::vector<AlgebraicTime> roots;
  if (p.sign_at(0, 0) == 0) roots.emplace_back(DyadicTime{0, 0});
  append_inner_roots(p, roots);
  std::sort(roots.begin(), roots.end(),
            [](const AlgebraicTime& x, const AlgebraicTime& y) { return x.compare_to(y) < 0; });
  return roots;
}

/// Returns the sign of p right after a time; p must not be zero.
int sign_after(const Polynomial& p, const AlgebraicTime& t) {
  for (Polynomial q = p;; q = q.derivative()) {
    if (const int sign = t.sign(q)) return sign;
    KBVH_ASSERT(q.degree() > 0);
  }
}

template <class S>
SegmentRoots roots_by_integers(const CurvedPiece<S>& a, const CurvedPiece<S>& b) {
  const Coefficients coefficients = exact_coefficients(a, b);
  const Polynomial p = Polynomial::from(coefficients);
  SegmentRoots found;
  for (AlgebraicTime& root : exact_roots(p)) {
    root.refine(60);
    const double begin = root.begin(), end = root.end();
    found.roots[found.count++] = {begin, end, sign_after(p, root), begin == end};
  }
  return found;
}

/// A root's place between two dyadic values of s: no other root of the difference lies between, or at an end,
/// unless the ends are equal and the root.
struct Place {
  DyadicTime begin, end;
};

template <class S>
Place place_of(const CurveMoment<S>& x) {
  const SegmentRoots known = segment_roots(x.first, x.second);
  KBVH_ASSERT(int(x.root) < known.count);
  const CurveRoot& root = known.roots[x.root];
  if (root.isolated) return {DyadicTime(Dyadic(root.begin)), DyadicTime(Dyadic(root.end))};
  std::vector<AlgebraicTime> all = exact_roots(Polynomial::from(exact_coefficients(x.first, x.second)));
  for (unsigned bits = 64;; bits *= 2) {
    bool apart = true;
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i].refine(bits);
      apart = apart && (i == 0 || compare(all[i - 1].exact_end(), all[i].exact_begin()) < 0);
    }
    if (apart) return {all[x.root].exact_begin(), all[x.root].exact_end()};
  }
}

/// Makes an exact number from a polynomial and the place of one of its roots. Roots at the segment's ends,
/// which the place may touch, are divided out.
AlgebraicTime exact_time(Polynomial p, const Place& place, const DyadicTime& first, const DyadicTime& last) {
  if (compare(place.begin, place.end) == 0) return AlgebraicTime(place.begin);
  for (const DyadicTime* end : {&first, &last})
    p.divide_out(end->numerator, Polynomial::Integer(1) << end->exponent);
  return AlgebraicTime(p, place.begin, place.end);
}

template <class S>
AlgebraicTime in_share(const CurveMoment<S>& x) {
  return exact_time(Polynomial::from(exact_coefficients(x.first, x.second)), place_of(x), {0, 0}, {1, 0});
}

template <class S>
AlgebraicTime in_seconds(const CurveMoment<S>& x) {
  const double t0 = x.first.t0, t1 = x.first.t1;
  const DyadicTime start{Dyadic(t0)}, last{Dyadic(t1)};
  const auto moved = [&](const DyadicTime& s) {
    const unsigned exponent = std::max(start.exponent, last.exponent);
    const Polynomial::Integer begin = start.numerator << (exponent - start.exponent),
                              end = last.numerator << (exponent - last.exponent);
    return DyadicTime{(begin << s.exponent) + (end - begin) * s.numerator, exponent + s.exponent};
  };
  const Place place = place_of(x);
  return exact_time(Polynomial::from(in_time(exact_coefficients(x.first, x.second), t0, t1)),
                    {moved(place.begin), moved(place.end)}, start, last);
}

bool same_numbers(DoubleDouble a, DoubleDouble b) {
  return a.hi == b.hi && a.lo == b.lo;
}
/// Returns whether two differences are equal up to their sign: they have the same roots.
bool same_roots(const CurveDifference& f, const CurveDifference& g) {
  const auto negated = [](DoubleDouble x) { return DoubleDouble{-x.hi, -x.lo}; };
  if (same_numbers(f.start, g.start) && same_numbers(f.end, g.end) && same_numbers(f.bend, g.bend) &&
      same_numbers(f.twist, g.twist))
    return true;
  return same_numbers(f.start, negated(g.start)) && same_numbers(f.end, negated(g.end)) &&
         same_numbers(f.bend, negated(g.bend)) && same_numbers(f.twist, negated(g.twist));
}

template <class S>
TimeEstimate estimate_of(const CurveMoment<S>& x) {
  const SegmentRoots known = segment_roots(x.first, x.second);
  KBVH_ASSERT(int(x.root) < known.count);
  return moment_estimate(x.first, known.roots[x.root]);
}

template <class S>
bool one_segment(const CurvedPiece<S>& a, const CurvedPiece<S>& b) {
  return a.t0 == b.t0 && a.t1 == b.t1;
}

bool is_point(const CurveRoot& root) {
  return root.begin == root.end;
}
/// Returns whether the root is the beginning of the segment, as where curves start together.
bool at_start(const CurveRoot& root) {
  return root.end == 0;
}

/// Orders two roots of one segment by their intervals; no value where these do not tell.
std::optional<int> order_of(const CurveRoot& p, const CurveRoot& q) {
  if (p.end < q.begin) return -1;
  if (q.end < p.begin) return 1;
  if (is_point(p) && is_point(q)) return 0;
  // An isolated root lies in the interior of its interval, unless that is a point.
  if (p.isolated && q.isolated && p.end == q.begin) return -1;
  if (p.isolated && q.isolated && q.end == p.begin) return 1;
  return {};
}

}  // namespace

template <class S>
SegmentRoots segment_roots(const CurvedPiece<S>& a, const CurvedPiece<S>& b, CurveStats* stats) {
  KBVH_ASSERT(one_segment(a, b));
  if (stats != nullptr) ++stats->searches;
  const CurveDifference g = curve_difference(a, b);
  SegmentRoots found;
  if (g.size() == 0) {
    found.equal = true;
    return found;
  }
  const Factor h = factor(g);
  const int first = certain_sign(h.b[0], h.error);
  if (is_zero(g.start) && first != 0) found.roots[found.count++] = {0, 0, first, true};
  if (first != 0 && append_certain_roots(h, found)) return found;
  if (stats != nullptr) ++stats->exact;
  return roots_by_integers(a, b);
}

template <class S>
TimeEstimate moment_estimate(const CurvedPiece<S>& piece, const CurveRoot& root) {
  if (at_start(root)) return {piece.t0, 0};
  const double duration = piece.t1 - piece.t0;
  const double time = piece.t0 + duration * (0.5 * (root.begin + root.end));
  // CurveDifference, sum, product and final sum each have at most one rounding error.
  const double error = duration * (0.5 * (root.end - root.begin)) +
                       (std::fabs(piece.t0) + std::fabs(piece.t1) + duration) * 0x1p-51;
  return {std::clamp(time, piece.t0, piece.t1), error * (1 + 0x1p-40)};
}

template <class S>
int compare_at(const CurvedPiece<S>& a, const CurvedPiece<S>& b, double t) {
  KBVH_ASSERT(one_segment(a, b) && t >= a.t0 && t <= a.t1);
  const CurveDifference g = curve_difference(a, b);
  if (g.size() == 0) return 0;
  if (t == a.t0) return sign_of(g.start.hi);
  if (t == a.t1) return sign_of(g.end.hi);
  const double s = (t - a.t0) / (a.t1 - a.t0), rest = 1 - s;
  const double value = g.start.hi * rest + g.end.hi * s + s * rest * (g.bend.hi + g.twist.hi * s);
  // s is off by 3 * 2^-53, and the derivative is at most 4 `size`.
  if (std::fabs(value) > 0x1p-48 * g.size() + kLeast) return sign_of(value);
  const DyadicTime time{Dyadic(t)};
  return Polynomial::from(in_time(exact_coefficients(a, b), a.t0, a.t1))
      .sign_at(time.numerator, time.exponent);
}

template <class S>
int compare_moments(const CurveMoment<S>& x, const CurveMoment<S>& y, CurveStats* stats) {
  if (one_segment(x.first, y.first)) {
    if (same_roots(curve_difference(x.first, x.second), curve_difference(y.first, y.second)))
      return (x.root > y.root) - (x.root < y.root);
    const SegmentRoots of_x = segment_roots(x.first, x.second), of_y = segment_roots(y.first, y.second);
    if (const std::optional<int> order = order_of(of_x.roots[x.root], of_y.roots[y.root])) return *order;
    if (stats != nullptr) ++stats->exact;
    return in_share(x).compare_to(in_share(y));
  }
  if (x.first.t1 <= y.first.t0) return -1;
  if (y.first.t1 <= x.first.t0) return 1;
  const TimeEstimate p = estimate_of(x), q = estimate_of(y);
  const double apart = p.time - q.time;
  if (std::fabs(apart) > (p.error + q.error) * (1 + 0x1p-40)) return sign_of(apart);
  return in_seconds(x).compare_to(in_seconds(y));
}

template <class S>
int compare_moment_to(const CurveMoment<S>& x, double t) {
  if (t < x.first.t0) return 1;
  if (t >= x.first.t1) return -1;
  const TimeEstimate estimate = estimate_of(x);
  const double apart = estimate.time - t;
  if (estimate.error == 0) return sign_of(apart);
  if (std::fabs(apart) > estimate.error * (1 + 0x1p-40)) return sign_of(apart);
  return in_seconds(x).compare_to(DyadicTime{Dyadic(t)});
}

template <class S>
int compare_moment_to(const CurveMoment<S>& x, const Crossing<S>& crossing) {
  const TimeEstimate p = estimate_of(x), q = crossing_estimate(crossing);
  const double apart = p.time - q.time;
  if (std::fabs(apart) > (p.error + q.error) * (1 + 0x1p-40)) return sign_of(apart);
  // The line that is zero at the crossing and rises.
  const ExactLine g = exact_difference(crossing.loser, crossing.winner);
  const Dyadic rising[2] = {g.slope.sign() > 0 ? g.constant : -g.constant,
                            g.slope.sign() > 0 ? g.slope : -g.slope};
  return in_seconds(x).sign(Polynomial::from(rising));
}

template <class S>
int compare_at_moment(const CurvedPiece<S>& a, const CurvedPiece<S>& b, const CurveMoment<S>& moment) {
  KBVH_ASSERT(one_segment(a, b) && one_segment(a, moment.first));
  const CurveDifference g = curve_difference(a, b);
  if (g.size() == 0 || same_roots(g, curve_difference(moment.first, moment.second))) return 0;
  const SegmentRoots known = segment_roots(moment.first, moment.second);
  const CurveRoot& root = known.roots[moment.root];
  if (at_start(root)) return sign_of(g.start.hi);
  const double s = 0.5 * (root.begin + root.end), rest = 1 - s;
  const double value = g.start.hi * rest + g.end.hi * s + s * rest * (g.bend.hi + g.twist.hi * s);
  if (std::fabs(value) > (0x1p-48 + 4 * (root.end - root.begin)) * g.size() + kLeast) return sign_of(value);
  return in_share(moment).sign(Polynomial::from(exact_coefficients(a, b)));
}

template <class S>
int compare_after_moment(const CurvedPiece<S>& a, const CurvedPiece<S>& b, const CurveMoment<S>& moment) {
  if (const int sign = compare_at_moment(a, b, moment)) return sign;
  if (curve_difference(a, b).size() == 0) return 0;
  if (same_roots(curve_difference(a, b), curve_difference(moment.first, moment.second)))
    return segment_roots(a, b).roots[moment.root].after;
  // If both start together, the factor's first coefficient is the slope of their difference.
  if (at_start(segment_roots(moment.first, moment.second).roots[moment.root])) {
    const Factor h = factor(curve_difference(a, b));
    if (const int sign = certain_sign(h.b[0], h.error)) return sign;
  }
  return sign_after(Polynomial::from(exact_coefficients(a, b)), in_share(moment));
}

#define KBVH_INSTANTIATE(S)                                                                            \
  template SegmentRoots segment_roots(const CurvedPiece<S>&, const CurvedPiece<S>&, CurveStats*);      \
  template TimeEstimate moment_estimate(const CurvedPiece<S>&, const CurveRoot&);                      \
  template int compare_at(const CurvedPiece<S>&, const CurvedPiece<S>&, double);                       \
  template int compare_moments(const CurveMoment<S>&, const CurveMoment<S>&, CurveStats*);             \
  template int compare_moment_to(const CurveMoment<S>&, double);                                       \
  template int compare_moment_to(const CurveMoment<S>&, const Crossing<S>&);                           \
  template int compare_at_moment(const CurvedPiece<S>&, const CurvedPiece<S>&, const CurveMoment<S>&); \
  template int compare_after_moment(const CurvedPiece<S>&, const CurvedPiece<S>&, const CurveMoment<S>&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
