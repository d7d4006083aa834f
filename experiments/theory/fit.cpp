#include "experiments/theory/fit.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>
#include <string>

namespace kbvh::theory {

namespace {
void check(const std::vector<double>& x, const std::vector<double>& y, std::size_t fewest) {
  if (x.size() != y.size() || x.size() < fewest)
    throw std::invalid_argument("a fit of " + std::to_string(x.size()) + " and " + std::to_string(y.size()) +
                                " values");
  for (const auto* list : {&x, &y})
    for (const double value : *list)
      if (!(value > 0) || !std::isfinite(value))
        throw std::invalid_argument("a fit in logarithms of " + std::to_string(value));
}
}  // namespace

double student_t95(std::size_t degrees) {
  return boost::math::quantile(boost::math::students_t(double(degrees)), 0.975);
}

double n_log_n(double n) {
  return n * std::log2(n);
}

PowerFit fit_power(const std::vector<double>& x, const std::vector<double>& y) {
  check(x, y, 3);
  const double points = double(x.size());
  double mean_x = 0, mean_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += std::log(x[i]) / points;
    mean_y += std::log(y[i]) / points;
  }
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = std::log(x[i]) - mean_x;
    xx += dx * dx;
    xy += dx * (std::log(y[i]) - mean_y);
  }
  if (!(xx > 0)) throw std::invalid_argument("a fit over one place, " + std::to_string(x[0]));
  PowerFit fit;
  fit.exponent = xy / xx;
  const double intercept = mean_y - fit.exponent * mean_x;
  fit.constant = std::exp(intercept);
  double squares = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double off = std::log(y[i]) - intercept - fit.exponent * std::log(x[i]);
    squares += off * off;
    fit.residuals.push_back(std::exp(off) - 1);
  }
  const double half = student_t95(x.size() - 2) * std::sqrt(squares / (points - 2) / xx);
  fit.low = fit.exponent - half;
  fit.high = fit.exponent + half;
  return fit;
}

ProportionalFit fit_proportional(const std::vector<double>& x, const std::vector<double>& y) {
  check(x, y, 1);
  // The sum of (r / c - 1)^2 over ratios r = y / x is least at c = sum r^2 / sum r.
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sum += y[i] / x[i];
    squares += y[i] / x[i] * (y[i] / x[i]);
  }
  ProportionalFit fit;
  fit.constant = squares / sum;
  for (std::size_t i = 0; i < x.size(); ++i) {
    fit.residuals.push_back(y[i] / (fit.constant * x[i]) - 1);
    fit.worst = std::max(fit.worst, std::abs(fit.residuals.back()));
  }
  return fit;
}

}  // namespace kbvh::theory
