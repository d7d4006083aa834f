#pragma once
#ifdef KBVH_THEORY_GMP
#include <boost/multiprecision/gmp.hpp>
#else
#include <boost/multiprecision/cpp_int.hpp>
#endif
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "experiments/theory/envelope_report.hpp"

namespace kbvh::theory {

/// Exact envelopes of flight plans, computed independently of the kinetic tree under test: from the stored
/// numbers, in rationals, without code of core/families/events or core/motion.
#ifdef KBVH_THEORY_GMP
using Integer = boost::multiprecision::number<boost::multiprecision::gmp_int, boost::multiprecision::et_off>;
using Rational =
    boost::multiprecision::number<boost::multiprecision::gmp_rational, boost::multiprecision::et_off>;
#else
using Integer = boost::multiprecision::cpp_int;
using Rational = boost::multiprecision::cpp_rational;
#endif

/// Converts a finite double to a rational.
Rational exact(double x);

/// Returns the time in [0, 1] at which two coordinates meet that move from a0 to a1 and from b0 to b1: (a0 -
/// b0) / (a0 - b0 + b1
/// - a1). Throws std::invalid_argument if they do not meet, or coincide.
Rational meeting_fraction(double a0, double a1, double b0, double b1);

/// A vertex's own plan: straight lines through the knots, the first of which is the change itself, then a
/// velocity for ever.
struct OwnKnots {
  std::vector<double> times;      ///< seconds, strictly increasing
  std::vector<double> positions;  ///< [knot][3]
  double velocity[3] = {0, 0, 0};
};

/// The stored numbers of one body, widened to double (exactly).
struct StoredPlans {
  std::uint32_t vertex_count = 0;
  std::vector<double> times;              ///< of the keyframes
  std::vector<double> positions;          ///< [keyframe][vertex][3]
  std::map<std::uint32_t, OwnKnots> own;  ///< vertices that left the keyframes
};

/// A time inside a motion: `row` <= time < `row` + 1 in units of its rows, exactly row + u with 0 <= u < 1.
struct When {
  std::size_t row = 0;
  Rational u = 0;
  double hint = 0;  ///< u rounded, for filters only

  bool operator==(const When& other) const { return row == other.row && u == other.u; }
  bool operator<(const When& other) const { return row != other.row ? row < other.row : u < other.u; }
};

/// The line x0 + slope (t - t0) that a coordinate follows.
struct ExactLine {
  Rational t0, x0, slope;
};

/// All coordinates of one body over [begin, until] and one linear step beyond: rows of exact values at every
/// possible bend of any vertex, every coordinate linear in between. Doubles filter, rationals decide.
class ExactMotion {
 public:
  /// Bends are at keyframes and knots; a body rests before its first and after its last keyframe.
  ExactMotion(const StoredPlans& plans, double begin, double until);

  std::size_t last_row() const { return last_row_; }  ///< the row at `until`
  const std::vector<double>& times() const { return times_; }
  std::uint32_t vertex_count() const { return vertex_count_; }

  /// Returns the sign of a - b on an axis at a row.
  int compare(std::size_t row, int axis, std::uint32_t a, std::uint32_t b) const;
  /// Returns the same at any time.
  int compare(const When& when, int axis, std::uint32_t a, std::uint32_t b) const;
  /// Returns the sign of (time when c meets r) - (time when d meets r), both between `row` and the next,
  /// where each is apart from r in the same direction.
  int compare_meetings(std::size_t row, int axis, std::uint32_t r, std::uint32_t c, std::uint32_t d) const;
  When meeting(std::size_t row, int axis, std::uint32_t r, std::uint32_t c) const;
  /// Converts a time to a place between rows. Throws std::out_of_range if it lies outside them.
  When locate(const Rational& time) const;

 private:
  struct Row {
    std::vector<double> rounded;   // [axis][vertex]
    std::vector<Rational> values;  // the same; empty if `rounded` is exact
  };
  Rational value(std::size_t row, std::size_t at) const {
    const Row& r = rows_[row];
    return r.values.empty() ? exact(r.rounded[at]) : r.values[at];
  }
  /// Computes a - b in double with its error bound.
  void difference(std::size_t row, std::size_t a, std::size_t b, double& d, double& error) const;

  std::uint32_t vertex_count_;
  std::size_t last_row_ = 0;
  std::vector<double> times_;
  std::vector<Row> rows_;
};

/// Returns the time at which two different lines meet. Throws std::invalid_argument if they are parallel.
Rational meeting_time(const ExactLine& a, const ExactLine& b);

/// One entry of the log: at `when` the bound of (node, side) passed from one vertex to another. Sides are 2 *
/// axis + (0 lower, 1 upper).
struct BoundChange {
  std::uint32_t node = 0, side = 0;
  std::uint32_t old_vertex = 0, new_vertex = 0;
  When when;
};

/// Marks a bound without a realiser, which is not checked.
inline constexpr std::uint32_t no_bound = 0xffffffff;

/// Vertices below every node, ascending.
using VerticesBelow = std::vector<std::vector<std::uint32_t>>;

/// Proves that, from the first row of the motion to its last, the realisers that start as `start` ([node][6])
/// and change as in the log are the envelope of the vertices below at every time (claim T1), that they change
/// only where they must (T8), and that they end as `end`. Between two neighbouring rows or changes all
/// coordinates are linear, so a realiser that no vertex exceeds at both ends is exceeded nowhere in between.
/// In addition the envelope is computed independently by gift wrapping, from `start` alone, staying with a
/// vertex until it is strictly exceeded; its breakpoints must equal the log's, at equal rational times. `log`
/// is in order of time. O(vertices below) per row and change. A bound that starts as `no_bound` does not
/// exist (BoxTrees store only one per node) and must not change.
EnvelopeReport check_envelopes(const ExactMotion& motion, const VerticesBelow& below,
                               std::span<const std::uint32_t> start, std::span<const BoundChange> log,
                               std::span<const std::uint32_t> end);

}  // namespace kbvh::theory
