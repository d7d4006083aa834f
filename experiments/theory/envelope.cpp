#include "experiments/theory/envelope.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

namespace kbvh::theory {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double smallest = std::numeric_limits<double>::min();

int sign(double x) {
  return (x > 0) - (x < 0);
}
int sign(const Rational& x) {
  return x.sign();
}

/// Four doubles as integers in one unit, a power of two, so that differences need no common denominators.
struct Integers {
  Integers(double a, double b, double c, double d) {
    const double numbers[4] = {a, b, c, d};
    int exponents[4], unit = std::numeric_limits<int>::max();
    std::int64_t mantissas[4];
    for (int i = 0; i < 4; ++i) {
      mantissas[i] = std::int64_t(std::ldexp(std::frexp(numbers[i], &exponents[i]), 53));
      if (mantissas[i] == 0) continue;
      const int zeros = std::countr_zero(std::uint64_t(mantissas[i]));
      mantissas[i] >>= zeros;
      exponents[i] += zeros;
      unit = std::min(unit, exponents[i]);
    }
    for (int i = 0; i < 4; ++i) {
      values[i] = mantissas[i];
      if (mantissas[i] != 0) values[i] <<= exponents[i] - unit;
    }
  }
  Integer values[4];
};

/// Returns the position of one vertex on its plan.
Rational value_at(const StoredPlans& plans, std::uint32_t vertex, int axis, double t) {
  const auto lerp = [t](double t0, double t1, double x0, double x1) -> Rational {
    if (x0 == x1) return exact(x0);
    return exact(x0) + (exact(x1) - exact(x0)) * (exact(t) - exact(t0)) / (exact(t1) - exact(t0));
  };
  const auto along = [&](const std::vector<double>& times, const auto& at) -> Rational {
    const std::size_t k = std::size_t(std::upper_bound(times.begin(), times.end(), t) - times.begin());
    if (k == 0) return exact(at(0));
    if (times[k - 1] == t || k == times.size()) return exact(at(k - 1));
    return lerp(times[k - 1], times[k], at(k - 1), at(k));
  };
  const auto own = plans.own.find(vertex);
  if (own == plans.own.end())
    return along(plans.times, [&](std::size_t k) {
      return plans.positions[3 * (k * plans.vertex_count + vertex) + std::size_t(axis)];
    });
  const OwnKnots& knots = own->second;
  const auto at = [&](std::size_t k) { return knots.positions[3 * k + std::size_t(axis)]; };
  if (t <= knots.times.back()) return along(knots.times, at);
  return exact(at(knots.times.size() - 1)) +
         exact(knots.velocity[axis]) * (exact(t) - exact(knots.times.back()));
}

}  // namespace

Rational exact(double x) {
  if (!std::isfinite(x)) throw std::invalid_argument("no rational: " + std::to_string(x));
  if (x == 0) return 0;
  int exponent = 0;
  const auto mantissa = static_cast<long long>(std::ldexp(std::frexp(x, &exponent), 53));
  exponent -= 53;
  Integer numerator = mantissa, denominator = 1;
  if (exponent >= 0)
    numerator <<= exponent;
  else
    denominator <<= -exponent;
  return Rational(numerator, denominator);
}

Rational meeting_fraction(double a0, double a1, double b0, double b1) {
  const Integers n(a0, a1, b0, b1);
  const Integer p = n.values[0] - n.values[2], q = n.values[3] - n.values[1];
  if (p.sign() * q.sign() < 0 || p + q == 0) throw std::invalid_argument("coordinates do not meet");
  const Integer whole = p + q;
  return whole.sign() > 0 ? Rational(p, whole) : Rational(Integer(-p), Integer(-whole));
}

Rational meeting_time(const ExactLine& a, const ExactLine& b) {
  const Rational slope = a.slope - b.slope;
  if (slope == 0) throw std::invalid_argument("parallel lines do not meet");
  // a.x0 + a.slope (t - a.t0) = b.x0 + b.slope (t - b.t0)
  return (b.x0 - a.x0 + a.slope * a.t0 - b.slope * b.t0) / slope;
}

ExactMotion::ExactMotion(const StoredPlans& plans, double begin, double until)
    : vertex_count_(plans.vertex_count) {
  std::set<double> bends{begin, until};
  double beyond = until + 1;
  const auto add = [&](const std::vector<double>& times) {
    for (double t : times) {
      if (t > begin && t < until) bends.insert(t);
      if (t > until) beyond = std::min(beyond, t);
    }
  };
  add(plans.times);
  for (const auto& [vertex, knots] : plans.own) add(knots.times);
  last_row_ = bends.size() - 1;
  bends.insert(beyond);
  times_.assign(bends.begin(), bends.end());
  rows_.resize(times_.size());
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    const double t = times_[row];
    const auto k = std::find(plans.times.begin(), plans.times.end(), t);
    rows_[row].rounded.resize(std::size_t(3) * vertex_count_);
    if (k != plans.times.end() && plans.own.empty()) {
      const double* stored =
          plans.positions.data() + 3 * std::size_t(k - plans.times.begin()) * vertex_count_;
      for (std::uint32_t v = 0; v < vertex_count_; ++v)
        for (std::size_t axis = 0; axis < 3; ++axis)
          rows_[row].rounded[axis * vertex_count_ + v] = stored[3 * v + axis];
      continue;
    }
    std::vector<Rational>& values = rows_[row].values;
    values.resize(std::size_t(3) * vertex_count_);
    bool rounded = false;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::uint32_t v = 0; v < vertex_count_; ++v) {
        const std::size_t at = axis * vertex_count_ + v;
        values[at] = value_at(plans, v, int(axis), t);
        rows_[row].rounded[at] = static_cast<double>(values[at]);
        rounded = rounded || exact(rows_[row].rounded[at]) != values[at];
      }
    if (!rounded) values.clear();
  }
}

void ExactMotion::difference(std::size_t row, std::size_t a, std::size_t b, double& d, double& error) const {
  const Row& r = rows_[row];
  const double x = r.rounded[a], y = r.rounded[b];
  d = x - y;
  error = r.values.empty() ? epsilon * std::abs(d) : 4 * epsilon * (std::abs(x) + std::abs(y));
}

int ExactMotion::compare(std::size_t row, int axis, std::uint32_t a, std::uint32_t b) const {
  const std::size_t first = std::size_t(axis) * vertex_count_;
  const Row& r = rows_[row];
  // A difference of doubles has the correct sign; conversions to double are off by less than this.
  const double x = r.rounded[first + a], y = r.rounded[first + b], d = x - y;
  if (r.values.empty() || std::abs(d) > 4 * epsilon * (std::abs(x) + std::abs(y)) + smallest) return sign(d);
  return sign(Rational(r.values[first + a] - r.values[first + b]));
}

int ExactMotion::compare(const When& when, int axis, std::uint32_t a, std::uint32_t b) const {
  if (a == b) return 0;
  const std::size_t row = when.row;
  if (when.u == 0) return compare(row, axis, a, b);
  const std::size_t first = std::size_t(axis) * vertex_count_;
  double d0, d1, e0, e1;
  difference(row, first + a, first + b, d0, e0);
  difference(row + 1, first + a, first + b, d1, e1);
  if (rows_[row].values.empty() && rows_[row + 1].values.empty() && sign(d0) * sign(d1) >= 0)
    return d0 != 0 ? sign(d0) : sign(d1);
  const double d = (1 - when.hint) * d0 + when.hint * d1;
  if (std::abs(d) > e0 + e1 + 8 * epsilon * (std::abs(d0) + std::abs(d1)) + smallest) return sign(d);
  if (rows_[row].values.empty() && rows_[row + 1].values.empty()) {
    const double *r0 = rows_[row].rounded.data() + first, *r1 = rows_[row + 1].rounded.data() + first;
    const Integers n(r0[a], r0[b], r1[a], r1[b]);
    const Integer &part = numerator(when.u), &whole = denominator(when.u);
    return Integer((whole - part) * (n.values[0] - n.values[1]) + part * (n.values[2] - n.values[3])).sign();
  }
  const Rational exact0 = value(row, first + a) - value(row, first + b);
  const Rational exact1 = value(row + 1, first + a) - value(row + 1, first + b);
  return sign(Rational(exact0 + when.u * (exact1 - exact0)));
}

int ExactMotion::compare_meetings(std::size_t row, int axis, std::uint32_t r, std::uint32_t c,
                                  std::uint32_t d) const {
  const std::size_t first = std::size_t(axis) * vertex_count_;
  double u[2], error[2];
  const std::uint32_t who[2] = {c, d};
  for (int i = 0; i < 2; ++i) {
    double p, q, ep, eq;
    difference(row, first + r, first + who[i], p, ep);
    difference(row + 1, first + who[i], first + r, q, eq);
    // Differences of one sign: the quotient's error is at most the larger of their errors over their sum,
    // doubled to cover second-order terms.
    const double sum = std::abs(p + q);
    u[i] = p / (p + q);
    error[i] = sum > 16 * (ep + eq) + smallest ? 2 * (ep + eq) / sum + 8 * epsilon
                                               : std::numeric_limits<double>::infinity();
  }
  if (u[0] + error[0] + error[1] < u[1]) return -1;
  if (u[1] + error[0] + error[1] < u[0]) return 1;
  if (rows_[row].values.empty() && rows_[row + 1].values.empty()) {
    const Row &r0 = rows_[row], &r1 = rows_[row + 1];
    if (r0.rounded[first + c] == r0.rounded[first + d] && r1.rounded[first + c] == r1.rounded[first + d])
      return 0;
  }
  const When x = meeting(row, axis, r, c), y = meeting(row, axis, r, d);
  return sign(Rational(x.u - y.u));
}

When ExactMotion::meeting(std::size_t row, int axis, std::uint32_t r, std::uint32_t c) const {
  const std::size_t first = std::size_t(axis) * vertex_count_;
  const Row &r0 = rows_[row], &r1 = rows_[row + 1];
  When when{row, 0, 0};
  if (r0.values.empty() && r1.values.empty()) {
    when.u = meeting_fraction(r0.rounded[first + r], r1.rounded[first + r], r0.rounded[first + c],
                              r1.rounded[first + c]);
  } else {
    const Rational p = value(row, first + r) - value(row, first + c);
    const Rational q = value(row + 1, first + c) - value(row + 1, first + r);
    if (sign(p) * sign(q) < 0 || p + q == 0) throw std::invalid_argument("coordinates do not meet");
    when.u = p / (p + q);
  }
  when.hint = static_cast<double>(when.u);
  return when;
}

When ExactMotion::locate(const Rational& time) const {
  if (time < exact(times_.front()) || time >= exact(times_.back()))
    throw std::out_of_range("time " + std::to_string(static_cast<double>(time)) + " is outside of [" +
                            std::to_string(times_.front()) + ", " + std::to_string(times_.back()) + ")");
  std::size_t low = 0, high = times_.size() - 1;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (exact(times_[middle]) <= time ? low : high) = middle;
  }
  When when{low, (time - exact(times_[low])) / (exact(times_[low + 1]) - exact(times_[low])), 0};
  when.hint = static_cast<double>(when.u);
  return when;
}

void EnvelopeReport::add(const EnvelopeReport& other) {
  if (violation.empty()) violation = other.violation;
  bounds += other.bounds;
  logged += other.logged;
  net += other.net;
  envelope += other.envelope;
  canonical += other.canonical;
  several_steps += other.several_steps;
  choices += other.choices;
  pieces += other.pieces;
  over_lambda += other.over_lambda;
  most_breakpoints = std::max(most_breakpoints, other.most_breakpoints);
  fullest = std::max(fullest, other.fullest);
}

namespace {

/// One side of one node: a vertex is ahead if it is further out on this side.
class BoundCheck {
 public:
  BoundCheck(const ExactMotion& motion, const std::vector<std::uint32_t>& below, std::uint32_t node,
             std::uint32_t side, EnvelopeReport& report)
      : motion_(&motion),
        below_(&below),
        node_(node),
        side_(side),
        axis_(int(side / 2)),
        out_(side % 2 == 1 ? 1 : -1),
        report_(&report) {}

  void run(std::uint32_t start, std::span<const BoundChange* const> log, std::uint32_t end) {
    if (!report_->holds()) return;
    ++report_->bounds;
    if (!is_below(start)) return fail("starts with vertex " + std::to_string(start) + ", not below", {});
    if (!prove(start, log, end)) return;
    std::uint64_t choices = 0;
    const auto guided = wrap(start, net_, choices);
    report_->envelope += guided.size();
    report_->net += net_.size();
    count_breakpoints(guided);
    report_->choices += choices;
    report_->canonical += choices == 0 ? guided.size() : wrap(start, {}, choices).size();
    for (std::size_t i = 0; i < std::max(guided.size(), net_.size()); ++i) {
      if (i >= net_.size()) return fail("lacks the envelope's change to " + text(guided[i]), guided[i].when);
      if (i >= guided.size()) return fail("has one change too many, to " + text(net_[i]), net_[i].when);
      if (!(guided[i].when == net_[i].when) || guided[i].vertex != net_[i].vertex)
        return fail("changes to " + text(net_[i]) + ", the envelope to " + text(guided[i]), net_[i].when);
    }
  }

 private:
  struct Step {
    When when;
    std::uint32_t vertex;
  };
  static std::string text(const Step& step) { return std::to_string(step.vertex); }

  void count_breakpoints(const std::vector<Step>& steps) {
    const std::size_t most = below_->size() - 1;
    report_->pieces += motion_->last_row();
    for (std::size_t i = 0; i < steps.size();) {
      std::size_t next = i;
      while (next < steps.size() && steps[next].when.row == steps[i].when.row) ++next;
      const std::size_t breakpoints = next - i;
      report_->over_lambda += breakpoints > most;
      report_->most_breakpoints = std::max<std::uint64_t>(report_->most_breakpoints, breakpoints);
      if (most >= 7) report_->fullest = std::max(report_->fullest, double(breakpoints) / double(most));
      i = next;
    }
  }

  bool is_below(std::uint32_t vertex) const {
    return std::binary_search(below_->begin(), below_->end(), vertex);
  }
  int ahead(std::size_t row, std::uint32_t a, std::uint32_t b) const {
    return out_ * motion_->compare(row, axis_, a, b);
  }
  int ahead(const When& when, std::uint32_t a, std::uint32_t b) const {
    return out_ * motion_->compare(when, axis_, a, b);
  }

  void fail(const std::string& what, const When& when) {
    if (!report_->violation.empty()) return;
    report_->violation = "node " + std::to_string(node_) + " side " + std::to_string(side_) + " " + what +
                         " at row " + std::to_string(when.row) + " + " + std::to_string(when.hint);
  }
  bool outermost(std::uint32_t realiser, const When& when) {
    for (std::uint32_t v : *below_)
      if (ahead(when, v, realiser) > 0) {
        fail("is realised by " + std::to_string(realiser) + ", exceeded by " + std::to_string(v), when);
        return false;
      }
    return true;
  }

  /// Checks the log as a piecewise linear function: correct at both ends of every piece, and each entry a
  /// gain.
  bool prove(std::uint32_t realiser, std::span<const BoundChange* const> log, std::uint32_t end) {
    net_.clear();
    std::size_t next = 0;
    for (std::size_t row = 0; row <= motion_->last_row(); ++row) {
      if (!outermost(realiser, {row, 0, 0})) return false;
      while (next < log.size() && log[next]->when.row == row) {
        const When& when = log[next]->when;
        if (row == motion_->last_row() && when.u != 0) break;
        const std::uint32_t before = realiser;
        std::uint64_t steps = 0;
        for (; next < log.size() && log[next]->when == when; ++next, ++steps) {
          const BoundChange& change = *log[next];
          if (change.old_vertex != realiser)
            return fail("passes from " + std::to_string(change.old_vertex) + ", not from its realiser " +
                            std::to_string(realiser),
                        when),
                   false;
          if (!is_below(change.new_vertex))
            return fail("passes to " + std::to_string(change.new_vertex) + ", not below", when), false;
          // Right after the instant means: further out at the next row, because the two lines meet only here.
          if (ahead(when, change.new_vertex, realiser) != 0 ||
              ahead(row + 1, change.new_vertex, realiser) <= 0)
            return fail("gains nothing by " + std::to_string(change.new_vertex) + " for " +
                            std::to_string(realiser),
                        when),
                   false;
          realiser = change.new_vertex;
        }
        report_->logged += steps;
        report_->several_steps += steps - 1;
        if (realiser != before) net_.push_back({when, realiser});
        if (when.u != 0 && !outermost(realiser, when)) return false;
      }
      // Remaining entries lie later, or out of order.
      if (next < log.size() && log[next]->when.row <= row)
        return fail("has an entry out of order or past the end", log[next]->when), false;
    }
    if (next < log.size()) return fail("has an entry past the end", log[next]->when), false;
    if (realiser != end)
      return fail("ends with " + std::to_string(end) + " instead of " + std::to_string(realiser),
                  {motion_->last_row(), 0, 0}),
             false;
    return true;
  }

  /// Computes the envelope independently: from the realiser to the first vertex that strictly overtakes it;
  /// among several, the one that is furthest out afterwards. Among equals the guide's next choice, else the
  /// smallest id.
  std::vector<Step> wrap(std::uint32_t realiser, std::span<const Step> guide, std::uint64_t& choices) {
    std::vector<Step> steps;
    for (std::size_t row = 0; row <= motion_->last_row(); ++row)
      for (;;) {
        best_.clear();
        for (std::uint32_t v : *below_) {
          if (ahead(row + 1, v, realiser) <= 0) continue;
          int order = best_.empty() ? -1 : motion_->compare_meetings(row, axis_, realiser, v, best_[0]);
          if (order == 0) order = -ahead(row + 1, v, best_[0]);
          if (order < 0) best_.clear();
          if (order <= 0) best_.push_back(v);
        }
        if (best_.empty()) break;
        const When when = motion_->meeting(row, axis_, realiser, best_[0]);
        if (row == motion_->last_row() && when.u != 0) break;
        std::uint32_t chosen = best_[0];
        if (best_.size() > 1) ++choices;
        if (steps.size() < guide.size() &&
            std::find(best_.begin(), best_.end(), guide[steps.size()].vertex) != best_.end())
          chosen = guide[steps.size()].vertex;
        realiser = chosen;
        steps.push_back({when, realiser});
      }
    return steps;
  }

  const ExactMotion* motion_;
  const std::vector<std::uint32_t>* below_;
  std::uint32_t node_, side_;
  int axis_, out_;
  EnvelopeReport* report_;
  std::vector<Step> net_;
  std::vector<std::uint32_t> best_;
};

}  // namespace

EnvelopeReport check_envelopes(const ExactMotion& motion, const VerticesBelow& below,
                               std::span<const std::uint32_t> start, std::span<const BoundChange> log,
                               std::span<const std::uint32_t> end) {
  EnvelopeReport report;
  const std::size_t bounds = 6 * below.size();
  if (start.size() != bounds || end.size() != bounds)
    throw std::invalid_argument("realisers for " + std::to_string(start.size()) + " and " +
                                std::to_string(end.size()) + " bounds, not " + std::to_string(bounds));
  std::vector<std::vector<const BoundChange*>> by_bound(bounds);
  for (const BoundChange& change : log) {
    if (change.node >= below.size() || change.side >= 6) {
      report.violation = "an entry for node " + std::to_string(change.node) + ", which does not exist";
      return report;
    }
    by_bound[6 * std::size_t(change.node) + change.side].push_back(&change);
  }
  for (std::size_t i = 1; i < log.size(); ++i)
    if (log[i].when < log[i - 1].when) {
      report.violation = "entry " + std::to_string(i) + " of the log is earlier than the one before";
      return report;
    }
  for (std::uint32_t node = 0; node < below.size(); ++node)
    for (std::uint32_t side = 0; side < 6; ++side) {
      const std::size_t at = 6 * std::size_t(node) + side;
      if (start[at] == no_bound && end[at] == no_bound && by_bound[at].empty()) continue;
      BoundCheck(motion, below[node], node, side, report).run(start[at], by_bound[at], end[at]);
    }
  return report;
}

}  // namespace kbvh::theory
