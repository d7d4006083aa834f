#include "core/families/blend/reduced_model.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace kbvh {
namespace {

constexpr std::size_t block = 192;  // coordinates that are processed together

/// Positions of some keyframes, relative to rest and translation: [coordinate of a block][keyframe].
template <class S>
class Offsets {
 public:
  Offsets(const FlightPlans<S>& plans, const std::vector<S>& rest, const std::vector<double>& translations,
          std::vector<std::size_t> keyframes)
      : plans_(plans),
        rest_(rest),
        translations_(translations),
        keyframes_(std::move(keyframes)),
        values_(block * keyframes_.size()) {}

  std::size_t coordinates() const { return std::size_t(3) * plans_.keyframed_count(); }
  std::size_t keyframes() const { return keyframes_.size(); }
  /// Calls work(first coordinate, count, values) for each block.
  template <class Work>
  void for_blocks(const Work& work) {
    for (std::size_t first = 0; first < coordinates(); first += block) {
      const std::size_t count = std::min(block, coordinates() - first);
      for (std::size_t j = 0; j < keyframes_.size(); ++j) {
        const S* const positions = plans_.keyframe(keyframes_[j]) + first;
        const double* const translation = &translations_[3 * keyframes_[j]];
        for (std::size_t i = 0; i < count; ++i)
          values_[i * keyframes_.size() + j] =
              double(positions[i]) - translation[i % 3] - double(rest_[first + i]);
      }
      work(first, count, values_.data());
    }
  }

 private:
  const FlightPlans<S>& plans_;
  const std::vector<S>& rest_;
  const std::vector<double>& translations_;
  std::vector<std::size_t> keyframes_;
  std::vector<double> values_;
};

/// Returns the mean position of all vertices at each keyframe, [keyframe][3].
template <class S>
std::vector<double> mean_positions(const FlightPlans<S>& plans) {
  const std::size_t vertices = plans.keyframed_count();
  std::vector<double> means(3 * plans.keyframe_count(), 0);
  for (std::size_t k = 0; k < plans.keyframe_count(); ++k) {
    const S* const positions = plans.keyframe(k);
    double sum[3] = {0, 0, 0};
    for (std::size_t i = 0; i < 3 * vertices; ++i) sum[i % 3] += double(positions[i]);
    for (std::size_t d = 0; d < 3; ++d) means[3 * k + d] = sum[d] / double(vertices);
  }
  return means;
}

/// Returns the mean over all keyframes of the positions without their translation.
template <class S>
std::vector<S> mean_shape(const FlightPlans<S>& plans, const std::vector<double>& translations) {
  const std::size_t count = std::size_t(3) * plans.keyframed_count();
  std::vector<double> sums(count, 0);
  for (std::size_t k = 0; k < plans.keyframe_count(); ++k)
    for (std::size_t i = 0; i < count; ++i)
      sums[i] += double(plans.keyframe(k)[i]) - translations[3 * k + i % 3];
  std::vector<S> rest(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) rest[i] = S(sums[i] / double(plans.keyframe_count()));
  return rest;
}

/// Returns the indices of at most `most` of `count` keyframes, evenly spaced, the first and the last among
/// them.
std::vector<std::size_t> spaced(std::size_t count, std::size_t most) {
  std::vector<std::size_t> chosen;
  const std::size_t taken = std::min(count, most);
  for (std::size_t i = 0; i < taken; ++i) chosen.push_back(taken == 1 ? 0 : i * (count - 1) / (taken - 1));
  return chosen;
}

/// Returns the inner products of all pairs of keyframes, [keyframe][keyframe].
template <class S>
std::vector<double> gram_matrix(Offsets<S>& offsets) {
  const std::size_t n = offsets.keyframes();
  std::vector<double> gram(n * n, 0);
  offsets.for_blocks([&](std::size_t /*first*/, std::size_t count, const double* values) {
    for (std::size_t i = 0; i < count; i += 3) {
      const double *const x = values + i * n, *const y = x + n, *const z = y + n;
      for (std::size_t a = 0; a < n; ++a) {
        double* const to = &gram[a * n];
        const double xa = x[a], ya = y[a], za = z[a];
        for (std::size_t b = a; b < n; ++b) to[b] += xa * x[b] + ya * y[b] + za * z[b];
      }
    }
  });
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b < a; ++b) gram[a * n + b] = gram[b * n + a];
  return gram;
}

template <class S>
double largest_of(const std::vector<S>& values) {
  double largest = 0;
  for (const S x : values) largest = std::max(largest, std::abs(double(x)));
  return largest;
}

}  // namespace

template <class S>
ReducedModel<S>::ReducedModel(const FlightPlans<S>& plans, const Settings& settings) {
  const std::size_t keyframes = plans.keyframe_count(), vertices = plans.keyframed_count();
  const std::size_t count = 3 * vertices;
  const std::vector<double> translations = mean_positions(plans);
  rest = mean_shape(plans, translations);

  // Shapes: eigenvectors of the snapshots' inner products give those of their covariance.
  Offsets<S> snapshots(plans, rest, translations, spaced(keyframes, samples));
  const std::size_t n = snapshots.keyframes();
  const std::vector<double> gram = gram_matrix(snapshots);
  const auto size = Eigen::Index(n);
  // long double: Eigen has no packets for it, so that every compiler sums in the same order, and modes and
  // counts are equal in all builds.
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(
      Eigen::Map<const Eigen::MatrixXd>(gram.data(), size, size).cast<long double>());
  const bool decomposed = eigen.info() == Eigen::Success;  // else without modes: the remainder is everything
  const auto variance = [&](std::size_t mode) {
    return double(eigen.eigenvalues()[size - 1 - Eigen::Index(mode)]);
  };
  double tail = 0;
  for (std::size_t m = 0; decomposed && m < n; ++m) tail += std::max(variance(m), 0.0);
  const double enough = settings.tolerance * settings.tolerance * double(n) * double(vertices);
  const double least = 1e-13 * std::max(tail, 0.0);  // below that values are rounding errors
  while (mode_count < std::min<std::size_t>(settings.most_modes, n) && tail > enough &&
         variance(mode_count) > least)
    tail -= variance(mode_count++);
  shapes.assign(mode_count, std::vector<S>(count + 1, 0));
  std::vector<double> factors(n * mode_count);  // [keyframe][mode]
  for (std::size_t m = 0; m < mode_count; ++m)
    for (std::size_t k = 0; k < n; ++k)
      factors[k * mode_count + m] =
          double(eigen.eigenvectors()(Eigen::Index(k), size - 1 - Eigen::Index(m))) / std::sqrt(variance(m));
  std::vector<double> sums(mode_count);
  snapshots.for_blocks([&](std::size_t first, std::size_t many, const double* values) {
    for (std::size_t i = 0; i < many; ++i) {
      std::fill(sums.begin(), sums.end(), 0);
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t m = 0; m < mode_count; ++m)
          sums[m] += values[i * n + k] * factors[k * mode_count + m];
      for (std::size_t m = 0; m < mode_count; ++m) shapes[m][first + i] = S(sums[m]);
    }
  });

  // Coordinates of all keyframes: inner products with the shapes. The rest gives the remainder per vertex.
  coordinates_.assign(keyframes * row(), 0);
  std::vector<double> fields(block * mode_count);  // [coordinate of a block][mode]
  const auto gather = [&](std::size_t first, std::size_t many) {
    for (std::size_t i = 0; i < many; ++i)
      for (std::size_t m = 0; m < mode_count; ++m) fields[i * mode_count + m] = double(shapes[m][first + i]);
  };
  Offsets<S> offsets(plans, rest, translations, spaced(keyframes, keyframes));
  std::vector<double> squares(keyframes, 0);
  offsets.for_blocks([&](std::size_t first, std::size_t many, const double* values) {
    gather(first, many);
    for (std::size_t i = 0; i < many; ++i)
      for (std::size_t k = 0; k < keyframes; ++k) {
        const double value = values[i * keyframes + k];
        double* const to = &coordinates_[k * row() + 4];
        for (std::size_t m = 0; m < mode_count; ++m) to[m] += value * fields[i * mode_count + m];
        squares[k] += value * value;
      }
  });
  // Positions are multiples of their unit of rounding: the remainder has at least about that size.
  const double unit = (largest_of(rest) + largest_of(translations)) * std::numeric_limits<S>::epsilon() +
                      double(std::numeric_limits<S>::min());
  for (std::size_t k = 0; k < keyframes; ++k) {
    double* const to = &coordinates_[k * row()];
    std::copy_n(&translations[3 * k], 3, to);
    double left = squares[k];
    for (std::size_t m = 0; m < mode_count; ++m) left -= to[4 + m] * to[4 + m];
    left = std::max(left, 0.0);
    // Where modes leave little, the difference above is mostly rounding.
    const double rounding =
        double(std::numeric_limits<S>::epsilon()) * std::sqrt(squares[k] / double(vertices));
    to[3] = std::max({std::sqrt(left / double(vertices)), unit, rounding});
  }

  // The remainder itself, whatever the decomposition was worth.
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double sum = 0;
  low.assign(count + 1, 0);
  high.assign(count + 1, 0);
  offsets.for_blocks([&](std::size_t first, std::size_t many, const double* values) {
    gather(first, many);
    for (std::size_t i = 0; i < many; ++i) {
      double least_seen = infinity, most_seen = -infinity;
      for (std::size_t k = 0; k < keyframes; ++k) {
        const double* const at = &coordinates_[k * row()];
        double left = values[i * keyframes + k];
        for (std::size_t m = 0; m < mode_count; ++m) left -= at[4 + m] * fields[i * mode_count + m];
        sum += left * left;
        const double share = left / at[3];
        least_seen = std::min(least_seen, share);
        most_seen = std::max(most_seen, share);
      }
      low[first + i] = S(least_seen);
      high[first + i] = S(most_seen);
    }
  });
  rms = std::sqrt(sum / double(keyframes * vertices));
  measure();
}

template <class S>
void ReducedModel<S>::measure() {
  remainder_largest_ = std::max(largest_of(low), largest_of(high));
  for (const std::vector<S>& shape : shapes) shape_largest_.push_back(largest_of(shape));
}

template <class S>
void ReducedModel<S>::at(const FlightPlans<S>& plans, double t, Coordinates& out) const {
  const auto times = plans.keyframe_times();
  const std::size_t k = plans.segment_at(t);
  const double* const first = &coordinates_[k * row()];
  const bool between = k + 1 < times.size() && t > times[k];
  const double* const last = between ? first + row() : first;
  const double share = between ? std::min((t - times[k]) / (times[k + 1] - times[k]), 1.0) : 0;
  out.displaced = 0;
  const auto blend = [&](std::size_t i, double& magnitude) {
    magnitude = std::max(std::abs(first[i]), std::abs(last[i]));
    return (1 - share) * first[i] + share * last[i];
  };
  double size = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    out.translation[d] = first[d] + share * (last[d] - first[d]);  // a step is often far smaller
    out.translated[d] = std::max(std::abs(first[d]), std::abs(last[d]));
    size = std::max(size, std::abs(last[d] - first[d]));
  }
  out.displaced += size;
  out.remainder = blend(3, size);
  out.displaced += size * remainder_largest_;
  out.modes.resize(mode_count);
  for (std::size_t m = 0; m < mode_count; ++m) {
    out.modes[m] = blend(4 + m, size);
    out.displaced += size * shape_largest_[m];
  }
}

template <class S>
void ReducedModel<S>::forget_fields() {
  for (std::vector<S>* field : {&rest, &low, &high}) *field = {};
  shapes = {};
}

template <class S>
std::size_t ReducedModel<S>::bytes() const {
  std::size_t total = (coordinates_.capacity() + shape_largest_.capacity()) * sizeof(double) +
                      (rest.capacity() + low.capacity() + high.capacity()) * sizeof(S);
  for (const auto& shape : shapes) total += shape.capacity() * sizeof(S);
  return total;
}

template struct ReducedModel<float>;
template struct ReducedModel<double>;

}  // namespace kbvh
