#include "core/continuous/impact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kbvh {
namespace {

/// The filter's verdict on an interval of time.
enum class Verdict : std::uint8_t { free, touches, open };

/// Unit roundoff.
constexpr double u = 0x1p-53;

/// A cell of the subdivision: Bernstein coefficients over the cell of three times the cubic f = n . r, whose
/// roots are the times at which the four points are coplanar, and along each axis of the quadratics n = a x
/// b, x and y, as computed by `Numbers`.
struct Cell {
  double f[4];
  double n[3][3], x[3][3], y[3][3];  ///< [coefficient][axis]
  double begin, length;
  int depth;
};

/// Bounds on the error of every coefficient at depth 0, and the increase per halving.
///
/// A coefficient of a quadratic is a sum of at most four products of two differences. No term takes part in
/// more than 5 roundings, and the sum of their magnitudes is at most twice `area`, the permanent of the
/// largest magnitudes of the differences; halved, that is 10 u area. Half the sum of two coefficients, which
/// are at most `area` in magnitude, adds u area each time, twice for the farthest coefficient: 2 u area per
/// halving. Likewise the cubic: 11 roundings of terms that sum to at most 3 `volume`, and 3 halvings of 3 u
/// volume each. A small surplus covers the rounding of the bounds themselves, and sums of up to three
/// quadratics (`slack`). Underflow adds less than the constants: magnitudes are at most 2e100.
struct Bounds {
  double area[3];
  double volume;
  double quadratic(int axis, int depth) const { return (16 + 3 * depth) * u * area[axis] + 1e-300; }
  double cubic(int depth) const { return (48 + 12 * depth) * u * volume + 1e-190; }
};

/// Each pair of differences a, b, r at t = 0 and 1; exact_impact.cpp defines their use.
struct Differences {
  double a[2][3], b[2][3], r[2][3];
};

/// Computes the Bernstein coefficients of the cross product of two linearly moving vectors.
void cross(const double (&a)[2][3], const double (&b)[2][3], double (&out)[3][3]) {
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out[0][k] = a[0][i] * b[0][j] - a[0][j] * b[0][i];
    out[1][k] = 0.5 * ((a[0][i] * b[1][j] - a[0][j] * b[1][i]) + (a[1][i] * b[0][j] - a[1][j] * b[0][i]));
    out[2][k] = a[1][i] * b[1][j] - a[1][j] * b[1][i];
  }
}

double dot(const double (&a)[3], const double (&b)[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void largest(const double (&a)[2][3], double (&out)[3]) {
  for (int k = 0; k < 3; ++k) out[k] = std::max(std::fabs(a[0][k]), std::fabs(a[1][k]));
}

/// Halves the cubic: `first` may be the cell itself.
void halve(const double (&f)[4], double (&first)[4], double (&second)[4]) {
  const double f01 = 0.5 * (f[0] + f[1]), f12 = 0.5 * (f[1] + f[2]), f23 = 0.5 * (f[2] + f[3]);
  const double f012 = 0.5 * (f01 + f12), f123 = 0.5 * (f12 + f23), centre = 0.5 * (f012 + f123);
  const double f0 = f[0], f3 = f[3];
  first[0] = f0, first[1] = f01, first[2] = f012, first[3] = centre;
  second[0] = centre, second[1] = f123, second[2] = f23, second[3] = f3;
}
void halve(const double (&q)[3][3], double (&first)[3][3], double (&second)[3][3]) {
  for (int k = 0; k < 3; ++k) {
    const double q0 = q[0][k], q2 = q[2][k];
    const double q01 = 0.5 * (q0 + q[1][k]), q12 = 0.5 * (q[1][k] + q2), centre = 0.5 * (q01 + q12);
    first[0][k] = q0, first[1][k] = q01, first[2][k] = centre;
    second[0][k] = centre, second[1][k] = q12, second[2][k] = q2;
  }
}

/// Tests whether all coefficients are beyond the bound, on one side.
bool nowhere_zero(const double (&f)[4], double bound) {
  const double low = std::min(std::min(f[0], f[1]), std::min(f[2], f[3]));
  const double high = std::max(std::max(f[0], f[1]), std::max(f[2], f[3]));
  return low > bound || high < -bound;
}
bool changes_sign(const double (&f)[4], double bound) {
  return (f[0] > bound && f[3] < -bound) || (f[0] < -bound && f[3] > bound);
}

class Filter {
 public:
  Filter(Contact::Kind kind, const MovingPoints& points) : faces_(kind == Contact::Kind::vertex_face) {
    Differences d;
    for (int end = 0; end < 2; ++end) {
      const double* const* p = end == 0 ? points.begin : points.end;
      for (int k = 0; k < 3; ++k) {
        d.a[end][k] = faces_ ? p[2][k] - p[1][k] : p[1][k] - p[0][k];
        d.b[end][k] = faces_ ? p[3][k] - p[1][k] : p[3][k] - p[2][k];
        d.r[end][k] = faces_ ? p[0][k] - p[1][k] : p[2][k] - p[0][k];
      }
    }
    Cell& cell = cells_[0];
    cross(d.a, d.b, cell.n);
    for (int k = 0; k < 3; ++k) twice_[k] = 2 * cell.n[1][k];
    cell.f[0] = 3 * dot(cell.n[0], d.r[0]);
    cell.f[1] = dot(cell.n[0], d.r[1]) + dot(twice_, d.r[0]);
    cell.f[2] = dot(twice_, d.r[1]) + dot(cell.n[2], d.r[0]);
    cell.f[3] = 3 * dot(cell.n[2], d.r[1]);
    cell.begin = 0;
    cell.length = 1;
    cell.depth = 0;
    double a[3], b[3], r[3];
    largest(d.a, a);
    largest(d.b, b);
    largest(d.r, r);
    bounds_.volume = 0;
    double ab[3];
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      ab[k] = a[i] * b[j] + a[j] * b[i];
      bounds_.volume += ab[k] * r[k];
    }
    if (nowhere_zero(cell.f, bounds_.cubic(0))) {
      impact_ = {};
      verdict_ = Verdict::free;
      return;
    }
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      // One bound for n, x, y, and sums of them.
      bounds_.area[k] = ab[k] + (a[i] * r[j] + a[j] * r[i]) + (r[i] * b[j] + r[j] * b[i]);
    }
    if (faces_)
      cross(d.a, d.r, cell.x);
    else
      cross(d.r, d.a, cell.x);
    cross(d.r, d.b, cell.y);
    verdict_ = decide();
  }

  Verdict verdict() const { return verdict_; }
  const Impact& impact() const { return impact_; }

 private:
  static constexpr int most_halvings = 24, most_cells = 96;

  /// Visits cells from the earliest on, until one certainly contains a contact or is undecided.
  Verdict decide() {
    int count = 1, examined = 0;
    while (count > 0) {
      Cell& cell = cells_[count - 1];
      if (++examined > most_cells) return Verdict::open;
      const Verdict verdict = examine(cell);
      if (verdict == Verdict::free) {
        --count;
      } else if (verdict == Verdict::touches) {
        return first_root(cell);
      } else {
        if (cell.depth == most_halvings) return Verdict::open;
        cells_[count] = cell;
        Cell &second = cells_[count - 1], &first = cells_[count++];
        halve(cell.f, first.f, second.f);
        halve(cell.n, first.n, second.n);
        halve(cell.x, first.x, second.x);
        halve(cell.y, first.y, second.y);
        first.length = second.length = 0.5 * first.length;
        second.begin = first.begin + first.length;
        ++first.depth;
        ++second.depth;
      }
    }
    return Verdict::free;
  }

  /// At contact n and all its shares have the same sign: two of opposite signs exclude a contact. If all have
  /// one sign, every root of the cubic is a contact.
  Verdict examine(const Cell& cell) const {
    const double bound = bounds_.cubic(cell.depth);
    if (nowhere_zero(cell.f, bound)) return Verdict::free;
    const bool crossing = changes_sign(cell.f, bound);
    bool inside = false;
    for (int k = 0; k < 3; ++k) {
      const double beyond = bounds_.quadratic(k, cell.depth);
      int positive = 0, negative = 0, shares = 0;
      const auto add = [&](double q0, double q1, double q2) {
        positive += std::min(std::min(q0, q1), q2) > beyond ? 1 : 0;
        negative += std::max(std::max(q0, q1), q2) < -beyond ? 1 : 0;
        ++shares;
      };
      const double n[3] = {cell.n[0][k], cell.n[1][k], cell.n[2][k]};
      const double x[3] = {cell.x[0][k], cell.x[1][k], cell.x[2][k]};
      const double y[3] = {cell.y[0][k], cell.y[1][k], cell.y[2][k]};
      add(n[0], n[1], n[2]);
      add(x[0], x[1], x[2]);
      add(y[0], y[1], y[2]);
      if (faces_) {
        add(n[0] - x[0] - y[0], n[1] - x[1] - y[1], n[2] - x[2] - y[2]);
      } else {
        add(n[0] - x[0], n[1] - x[1], n[2] - x[2]);
        add(n[0] - y[0], n[1] - y[1], n[2] - y[2]);
      }
      if (positive > 0 && negative > 0) return Verdict::free;
      inside = inside || positive == shares || negative == shares;
    }
    return crossing && inside ? Verdict::touches : Verdict::open;
  }

  /// Encloses the first root of the cubic in a cell in which every root is a contact and at least one exists.
  Verdict first_root(const Cell& cell) {
    struct Piece {
      double f[4], begin, length;
      int depth;
    };
    Piece pieces[most_halvings + 2];
    std::copy(std::begin(cell.f), std::end(cell.f), std::begin(pieces[0].f));
    pieces[0].begin = cell.begin;
    pieces[0].length = cell.length;
    pieces[0].depth = cell.depth;
    int count = 1;
    while (count > 0) {
      Piece& piece = pieces[count - 1];
      const double bound = bounds_.cubic(piece.depth);
      if (nowhere_zero(piece.f, bound)) {
        --count;
      } else if (piece.length <= impact_width) {
        if (!changes_sign(piece.f, bound)) return Verdict::open;
        impact_ = {true, piece.begin, piece.begin + piece.length};
        return Verdict::touches;
      } else {
        Piece& first = pieces[count++];
        first.begin = piece.begin;
        first.length = piece.length = 0.5 * piece.length;
        piece.begin += first.length;
        first.depth = ++piece.depth;
        halve(piece.f, first.f, piece.f);
      }
    }
    return Verdict::open;
  }

  bool faces_;
  Bounds bounds_;
  Verdict verdict_ = Verdict::open;
  Impact impact_;
  double twice_[3];
  Cell cells_[most_halvings + 2];
};

/// Tests whether an axis separates the points [0, first) from the others, on one side from t = 0 to t = 1.
bool kept_apart(const MovingPoints& points, int first) {
  for (int k = 0; k < 3; ++k) {
    bool below = true, above = true;
    for (const double* const* p : {points.begin, points.end}) {
      double low[2] = {p[0][k], p[3][k]}, high[2] = {p[0][k], p[3][k]};
      for (int i = 1; i < 3; ++i) {
        const int side = i < first ? 0 : 1;
        low[side] = std::min(low[side], p[i][k]);
        high[side] = std::max(high[side], p[i][k]);
      }
      below = below && high[0] < low[1];
      above = above && low[0] > high[1];
    }
    if (below || above) return true;
  }
  return false;
}

}  // namespace

Impact find_impact(Contact::Kind kind, const MovingPoints& points, ImpactStats* stats) {
  if (stats != nullptr) ++stats->tests;
  const auto filtered = [&](const Impact& impact) {
    if (stats != nullptr) ++stats->filtered;
    return impact;
  };
  if (kept_apart(points, kind == Contact::Kind::vertex_face ? 1 : 2)) return filtered({});
  const Filter filter(kind, points);
  if (filter.verdict() == Verdict::free) return filtered({});
  if (filter.verdict() == Verdict::touches) return filtered(filter.impact());
  if (stats != nullptr) ++stats->exact;
  return find_impact_exact(kind, points);
}

}  // namespace kbvh
