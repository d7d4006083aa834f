#pragma once
#include <vector>

namespace kbvh::theory {

/// Least squares of log y = log c + e log x.
struct PowerFit {
  double exponent = 0;
  double low = 0, high = 0;  ///< 95% confidence interval of the exponent (Student's t, points - 2 degrees)
  double constant = 0;       ///< c
  std::vector<double> residuals;  ///< of each point: y / fit - 1
};

/// Fits a power law. Throws std::invalid_argument on fewer than three points, lists of unlike length, values
/// that are not positive, or points with a single x.
PowerFit fit_power(const std::vector<double>& x, const std::vector<double>& y);

/// y = c x with the c that minimises the squares of y / (c x) - 1.
struct ProportionalFit {
  double constant = 0;
  double worst = 0;               ///< largest |y / (c x) - 1|
  std::vector<double> residuals;  ///< of each point: y / (c x) - 1
};

/// Fits a proportionality. Throws std::invalid_argument on lists of unlike length, empty lists, and values
/// that are not positive.
ProportionalFit fit_proportional(const std::vector<double>& x, const std::vector<double>& y);

/// Returns the two-sided 95% quantile of Student's t with this many degrees of freedom (at least 1), to four
/// digits.
double student_t95(std::size_t degrees);

/// Returns n log2 n.
double n_log_n(double n);

}  // namespace kbvh::theory
