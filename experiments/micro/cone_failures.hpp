#pragma once
// The time at which the certificate of a patch fails on a linear segment, and what computing it takes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "patch_tree.hpp"

namespace kbvh::experiments::micro {

/// What one way to certificates takes, and what it certifies.
struct ConeCounts {
  std::uint64_t patches = 0;            ///< patches looked at
  std::uint64_t signs = 0;              ///< of normals and of sides of contours
  std::uint64_t determinants = 0;       ///< as PatchCertificate counts them
  std::uint64_t roots = 0;              ///< polynomials whose roots were isolated
  std::uint64_t failures = 0;           ///< of certificates within segments: events
  std::uint64_t certified_patches = 0;  ///< summed over frames
  std::uint64_t certified_faces = 0;    ///< within certified patches, summed over frames
};

/// A polynomial of degree 2 by its Bernstein coefficients on [0, 1].
struct BernsteinQuadratic {
  double c[3];
  bool positive() const { return c[0] > 0 && c[1] > 0 && c[2] > 0; }
  bool one_sign() const { return positive() || (c[0] < 0 && c[1] < 0 && c[2] < 0); }
  double at(double t) const {
    return (1 - t) * ((1 - t) * c[0] + t * c[1]) + t * ((1 - t) * c[1] + t * c[2]);
  }
  /// Calls take(root) for the roots in (0, 1].
  template <class Take>
  void for_roots(const Take& take) const {
    const double a = c[0] - 2 * c[1] + c[2], b = 2 * (c[1] - c[0]), discriminant = b * b - 4 * a * c[0];
    if (!(discriminant >= 0)) return;
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    for (const double root : {q / a, c[0] / q})
      if (root > 0 && root <= 1) take(root);  // false where a division by 0 made none
  }
};

/// Computes failure times of the certificate that PatchCertificate proves, in double without bounds on
/// rounding: they are counted, not relied on.
class ConeFailure {
 public:
  ConeFailure(const PatchTree& patches, const ClothSegment& segment) : patches_(patches), of_(segment) {}

  static constexpr double never = 2, at_once = 0;
  /// Returns when the certificate of the patch below a node fails, whose axis is chosen for the rest of the
  /// segment from `from` on; relative to this rest. `at_once`: it does not hold at its beginning, so the rest
  /// of the patch is not looked at.
  double time(std::uint32_t node, double from, ConeCounts& counts) {
    from_ = from;
    counts_ = &counts;
    ++counts.patches;
    failure_ = never;
    const std::span<const FaceSide> contour = patches_.contours().of(node);
    if (!find_axis(contour)) return at_once;
    const bool faces = patches_.for_faces(node, [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      const BernsteinQuadratic component = turn(difference(b, a), difference(c, a));
      if (!(component.c[0] > 0)) return false;
      if (!component.positive()) take_roots(component, [](double) { return true; });
      return true;
    });
    return faces && contour_begins_simple(contour) ? failure_ : at_once;
  }
  /// The axis of the last patch.
  const std::array<double, 3>& axis() const { return axis_; }

 private:
  struct Moving {
    std::array<double, 3> begin, end;
  };
  struct Extent {
    double low[2], high[2];
    std::size_t side;
  };
  Moving difference(std::uint32_t to, std::uint32_t from) const {
    Moving result;
    for (std::size_t k = 0; k < 3; ++k) {
      const double first = of_.begin[std::size_t(3) * to + k] - of_.begin[std::size_t(3) * from + k];
      result.end[k] = of_.end[std::size_t(3) * to + k] - of_.end[std::size_t(3) * from + k];
      result.begin[k] = (1 - from_) * first + from_ * result.end[k];
    }
    return result;
  }
  static std::array<double, 3> cross(const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
  double determinant(const std::array<double, 3>& a, const std::array<double, 3>& b) const {
    const std::array<double, 3> normal = cross(a, b);
    return axis_[0] * normal[0] + axis_[1] * normal[1] + axis_[2] * normal[2];
  }
  /// Returns axis . (a x b). Counts all coefficients, also where the first one ends the work on a patch.
  BernsteinQuadratic turn(const Moving& a, const Moving& b) {
    ++counts_->signs;
    counts_->determinants += 4;
    return {{determinant(a.begin, b.begin), 0.5 * (determinant(a.begin, b.end) + determinant(a.end, b.begin)),
             determinant(a.end, b.end)}};
  }
  /// Returns coordinate i of a difference in the plane of projection.
  double across(const std::array<double, 3>& d, std::size_t i) const {
    const std::size_t kept = (dropped_ + 1 + i) % 3;
    return axis_[dropped_] * d[kept] - axis_[kept] * d[dropped_];
  }
  template <class Fails>
  void take_roots(const BernsteinQuadratic& polynomial, const Fails& fails) {
    ++counts_->roots;
    polynomial.for_roots([&](double root) {
      if (root < failure_ && fails(root)) failure_ = root;
    });
  }

  bool find_axis(std::span<const FaceSide> contour) {
    axis_ = {0, 0, 0};
    counts_->determinants += 2 * contour.size();
    for (const FaceSide& side : contour) {
      const Moving a = difference(side.from, contour[0].from), b = difference(side.to, contour[0].from);
      const std::array<double, 3> begin = cross(a.begin, b.begin), end = cross(a.end, b.end);
      for (std::size_t k = 0; k < 3; ++k) axis_[k] += begin[k] + end[k];
    }
    dropped_ = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::fabs(axis_[k]) > std::fabs(axis_[dropped_])) dropped_ = k;
    const double largest = std::fabs(axis_[dropped_]);
    if (!(largest > 1e-100)) return false;
    for (double& x : axis_) x /= largest;
    return true;
  }

  /// Two sides of which the second begins where the first ends: fail where they point in opposite directions.
  bool take_neighbours(const FaceSide& first, const FaceSide& second) {
    const Moving a = difference(first.to, first.from), b = difference(second.to, second.from);
    const BernsteinQuadratic side = turn(a, b);
    if (side.one_sign()) return true;
    ++counts_->signs;
    counts_->determinants += 4;
    BernsteinQuadratic forwards{{0, 0, 0}};
    for (std::size_t i = 0; i < 2; ++i) {
      const double x[] = {across(a.begin, i), across(a.end, i)}, y[] = {across(b.begin, i), across(b.end, i)};
      forwards.c[0] += x[0] * y[0];
      forwards.c[1] += 0.5 * (x[0] * y[1] + x[1] * y[0]);
      forwards.c[2] += x[1] * y[1];
    }
    if (forwards.positive()) return true;
    if (side.c[0] == 0 && !(forwards.c[0] > 0)) return false;
    if (side.c[0] == 0 && side.c[1] == 0 && side.c[2] == 0)
      take_roots(forwards, [](double) { return true; });
    else
      take_roots(side, [&](double t) { return !(forwards.at(t) > 0); });
    return true;
  }

  /// Two other sides: fail where neither lies on one side of the line through the other.
  bool take_others(const FaceSide& a, const FaceSide& b) {
    BernsteinQuadratic ends[2][2];  // [line][end of the other side]
    for (std::size_t line = 0; line < 2; ++line) {
      const FaceSide &of = line == 0 ? a : b, &other = line == 0 ? b : a;
      const Moving along = difference(of.to, of.from);
      ends[line][0] = turn(along, difference(other.from, of.from));
      ends[line][1] = turn(along, difference(other.to, of.from));
      if (ends[line][0].one_sign() && ends[line][1].one_sign() && ends[line][0].c[0] * ends[line][1].c[0] > 0)
        return true;
    }
    const auto beside = [&](std::size_t line, double t) {
      const double x = ends[line][0].at(t), y = ends[line][1].at(t);
      return (x > 0 && y > 0) || (x < 0 && y < 0);
    };
    if (!beside(0, 0) && !beside(1, 0)) return false;
    for (std::size_t line = 0; line < 2; ++line)
      for (const BernsteinQuadratic& end : ends[line])
        if (!end.one_sign()) take_roots(end, [&](double t) { return !beside(1 - line, t); });
    return true;
  }

  /// Returns whether the contour is simple at the beginning; takes the times at which it fails later.
  bool contour_begins_simple(std::span<const FaceSide> contour) {
    next_.resize(contour.size());
    int others = 0;  // loops that turn to the left
    for (std::size_t begin = 0, end = 0; begin < contour.size(); begin = end) {
      double area = 0;
      for (end = begin; end == begin || contour[end - 1].to != contour[begin].from; ++end) {
        next_[end] = contour[end].to == contour[begin].from ? begin : end + 1;
        area += determinant(difference(contour[end].from, contour[begin].from).begin,
                            difference(contour[end].to, contour[begin].from).begin);
      }
      if (begin == 0 && end == contour.size()) break;  // a single loop may turn in either direction
      counts_->determinants += end - begin;
      if (!(area < 0) && ++others > 1) return false;
    }
    for (std::size_t i = 0; i < contour.size(); ++i)
      if (!take_neighbours(contour[i], contour[next_[i]])) return false;
    return others_begin_apart(contour);
  }

  /// The same for sides that are no neighbours, of which those with overlapping extents are compared, up to
  /// the number at which PatchCertificate gives up.
  bool others_begin_apart(std::span<const FaceSide> contour) {
    counts_->determinants += contour.size();
    extents_.clear();
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
    for (std::size_t i = 0; i < contour.size(); ++i) {
      Extent extent{{1e300, 1e300}, {-1e300, -1e300}, i};
      for (const std::uint32_t end : {contour[i].from, contour[i].to}) {
        const Moving d = difference(end, contour[0].from);
        for (std::size_t k = 0; k < 2; ++k)
          for (const double x : {across(d.begin, k), across(d.end, k)}) {
            extent.low[k] = std::min(extent.low[k], x);
            extent.high[k] = std::max(extent.high[k], x);
          }
      }
      for (std::size_t k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], extent.low[k]);
        high[k] = std::max(high[k], extent.high[k]);
      }
      extents_.push_back(extent);
    }
    const std::size_t sorted = high[1] - low[1] > high[0] - low[0] ? 1 : 0;
    std::sort(extents_.begin(), extents_.end(), [sorted](const Extent& a, const Extent& b) {
      return a.low[sorted] != b.low[sorted] ? a.low[sorted] < b.low[sorted] : a.side < b.side;
    });
    std::uint64_t left = 4096 + 64 * std::uint64_t(contour.size());
    for (std::size_t i = 0; i < extents_.size(); ++i)
      for (std::size_t j = i + 1; j < extents_.size() && extents_[j].low[sorted] <= extents_[i].high[sorted];
           ++j) {
        if (left-- == 0) return false;
        const Extent &a = extents_[i], &b = extents_[j];
        if (b.low[1 - sorted] > a.high[1 - sorted] || a.low[1 - sorted] > b.high[1 - sorted]) continue;
        if (next_[a.side] == b.side || next_[b.side] == a.side) continue;
        if (!take_others(contour[a.side], contour[b.side])) return false;
      }
    return true;
  }

  const PatchTree& patches_;
  const ClothSegment& of_;
  double from_ = 0, failure_ = never;
  ConeCounts* counts_ = nullptr;
  std::array<double, 3> axis_{};
  std::size_t dropped_ = 0;
  std::vector<std::size_t> next_;
  std::vector<Extent> extents_;
};

}  // namespace kbvh::experiments::micro
