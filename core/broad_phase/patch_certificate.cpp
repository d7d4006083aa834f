#include "core/broad_phase/patch_certificate.hpp"

#include <algorithm>
#include <cmath>

#include "core/geometry/predicates.hpp"

namespace kbvh {
namespace {

/// Bounds the rounding of sums of products of at most three factors, which are exact numbers or differences
/// of two, relative to the sum of the products' magnitudes: at most 9 roundings each, and as many in that
/// sum.
constexpr double relative = 20.0 * 0x1p-53;
/// Bounds the error by underflow: 2^-1075 a product, which is multiplied by at most one difference.
constexpr double absolute = filter::absolute3d;

/// A sum of products, and that of their magnitudes.
struct Sum {
  double value, permanent;
  Sum operator+(const Sum& other) const { return {value + other.value, permanent + other.permanent}; }
  int sign() const { return sign_beyond(value, relative * permanent + absolute); }
};

/// Returns axis . (a x b).
Sum determinant(const std::array<double, 3>& axis, const double* a, const double* b) {
  const double xy = a[0] * b[1], yx = a[1] * b[0], yz = a[1] * b[2], zy = a[2] * b[1], zx = a[2] * b[0],
               xz = a[0] * b[2];
  return {axis[0] * (yz - zy) + axis[1] * (zx - xz) + axis[2] * (xy - yx),
          std::fabs(axis[0]) * (std::fabs(yz) + std::fabs(zy)) +
              std::fabs(axis[1]) * (std::fabs(zx) + std::fabs(xz)) +
              std::fabs(axis[2]) * (std::fabs(xy) + std::fabs(yx))};
}

/// The plane of projection: two of the three coordinates, after a point was moved along the axis until the
/// third is 0, times the axis' component there.
struct Plane {
  explicit Plane(const std::array<double, 3>& along) : axis(along) {
    for (int k = 1; k < 3; ++k)
      if (std::fabs(axis[std::size_t(k)]) > std::fabs(axis[std::size_t(dropped)])) dropped = k;
    kept[0] = (dropped + 1) % 3;
    kept[1] = (dropped + 2) % 3;
  }
  /// Returns coordinate i of a difference of two points.
  Sum at(const double* d, int i) const {
    const double across = axis[std::size_t(dropped)] * d[kept[i]];
    const double along = axis[std::size_t(kept[i])] * d[dropped];
    return {across - along, std::fabs(across) + std::fabs(along)};
  }
  const std::array<double, 3>& axis;
  int dropped = 0, kept[2];
};

/// Returns the sign of axis . ((b - a) x (c - a)).
template <class S>
int rest_sign(const std::array<double, 3>& axis, const S* a, const S* b, const S* c) {
  double d[3], e[3];
  for (std::size_t k = 0; k < 3; ++k) {
    d[k] = double(b[k]) - double(a[k]);
    e[k] = double(c[k]) - double(a[k]);
  }
  return determinant(axis, d, e).sign();
}

/// Combines the signs of the Bernstein coefficients of a polynomial into that of the polynomial on [0, 1].
int common(int a, int b, int c) {
  return a == b && b == c && a != undecided_sign ? a : 0;
}

}  // namespace

template <class S>
typename PatchCertificate<S>::Moving PatchCertificate<S>::difference(std::uint32_t to,
                                                                     std::uint32_t from) const {
  Moving result;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t a = std::size_t(4) * from + k, b = std::size_t(4) * to + k;
    result.begin[k] = double(begin_[b]) - double(begin_[a]);
    result.end[k] = end_ == nullptr ? result.begin[k] : double(end_[b]) - double(end_[a]);
  }
  return result;
}

template <class S>
int PatchCertificate<S>::turn(const Axis& axis, const Moving& a, const Moving& b) const {
  const int first = determinant(axis, a.begin, b.begin).sign();
  if (end_ == nullptr) return common(first, first, first);
  if (first == undecided_sign) return 0;
  const Sum middle = determinant(axis, a.begin, b.end) + determinant(axis, a.end, b.begin);
  return common(first, middle.sign(), determinant(axis, a.end, b.end).sign());
}

template <class S>
bool PatchCertificate<S>::goes_on(const Axis& axis, const FaceSide& first, const FaceSide& second) const {
  const Moving a = difference(first.to, first.from), b = difference(second.to, second.from);
  if (turn(axis, a, b) != 0) return true;
  // Forwards: the product of the directions in the plane of projection is positive, also if that is scaled.
  const Plane plane(axis);
  const auto product = [&plane](const double* x, const double* y) {
    Sum sum{0, 0};
    for (int i = 0; i < 2; ++i) {
      const Sum p = plane.at(x, i), q = plane.at(y, i);
      sum = sum + Sum{p.value * q.value, p.permanent * q.permanent};
    }
    return sum;
  };
  const int at_begin = product(a.begin, b.begin).sign();
  if (at_begin != 1 || end_ == nullptr) return at_begin == 1;
  return (product(a.begin, b.end) + product(a.end, b.begin)).sign() == 1 && product(a.end, b.end).sign() == 1;
}

template <class S>
bool PatchCertificate<S>::apart(const Axis& axis, const FaceSide& a, const FaceSide& b) const {
  const auto beside = [&](const FaceSide& line, const FaceSide& other) {
    const Moving along = difference(line.to, line.from);
    const int side = turn(axis, along, difference(other.from, line.from));
    return side != 0 && side == turn(axis, along, difference(other.to, line.from));
  };
  return beside(a, b) || beside(b, a);
}

template <class S>
bool PatchCertificate<S>::turns_right(const Axis& axis, std::span<const FaceSide> loop) const {
  // A loop that never touches itself turns in the same direction at all times: the beginning decides.
  Sum area{0, 0};
  for (const FaceSide& side : loop)
    area = area + determinant(axis, difference(side.from, loop[0].from).begin,
                              difference(side.to, loop[0].from).begin);
  const double bound = (relative + double(loop.size()) * 0x1p-52) * area.permanent;
  return area.value < -(bound + double(loop.size()) * absolute);
}

template <class S>
bool PatchCertificate<S>::find_axis(std::span<const FaceSide> contour, Axis& axis) const {
  axis = {0, 0, 0};
  if (contour.empty()) return false;
  const std::uint32_t origin = contour[0].from;
  for (const FaceSide& side : contour) {
    const Moving a = difference(side.from, origin), b = difference(side.to, origin);
    const auto add = [&axis](const double* x, const double* y) {
      axis[0] += x[1] * y[2] - x[2] * y[1];
      axis[1] += x[2] * y[0] - x[0] * y[2];
      axis[2] += x[0] * y[1] - x[1] * y[0];
    };
    add(a.begin, b.begin);
    if (end_ != nullptr) add(a.end, b.end);
  }
  const double largest = std::max({std::fabs(axis[0]), std::fabs(axis[1]), std::fabs(axis[2])});
  if (!(largest > absolute)) return false;
  for (double& x : axis) x /= largest;
  return true;
}

template <class S>
bool PatchCertificate<S>::normals_agree(const ElementLeaves<S>& faces, std::uint32_t padded,
                                        std::uint32_t node, const Axis& axis) {
  const auto point = [this](std::uint32_t v) { return begin_ + std::size_t(4) * v; };
  nodes_.assign(1, node);
  while (!nodes_.empty()) {
    const WideNode& at = faces.tree.nodes[nodes_.back()];
    nodes_.pop_back();
    for (std::uint32_t leaf = at.first_leaf; leaf < at.first_leaf + at.leaf_count; ++leaf) {
      const std::uint32_t* const corners = faces.corners + std::size_t(3) * leaf * padded;
      const std::uint32_t count = faces.end_entry[leaf] - faces.first_entry[leaf];
      for (std::uint32_t lane = 0; lane < count; ++lane) {
        const std::uint32_t a = corners[lane], b = corners[padded + lane], c = corners[2 * padded + lane];
        if (end_ != nullptr ? turn(axis, difference(b, a), difference(c, a)) != 1
                            : rest_sign(axis, point(a), point(b), point(c)) != 1)
          return false;
      }
    }
    for (std::uint32_t c = 0; c < std::uint32_t(at.count - at.leaf_count); ++c)
      nodes_.push_back(at.first_child + c);
  }
  return true;
}

template <class S>
void PatchCertificate<S>::list_extents(std::span<const FaceSide> contour, const Axis& axis) {
  // Relative to a corner of the contour, so that its motion and its distance from 0 do not count.
  const Plane plane(axis);
  const std::uint32_t origin = contour[0].from;
  points_.resize(contour.size());
  extents_.resize(contour.size());
  for (std::size_t i = 0; i < contour.size(); ++i) {
    const Moving d = difference(contour[i].from, origin);
    for (int k = 0; k < 2; ++k) {
      const Sum at_begin = plane.at(d.begin, k), at_end = plane.at(d.end, k);
      const double error = relative * std::max(at_begin.permanent, at_end.permanent) + absolute;
      points_[i].low[k] = std::min(at_begin.value, at_end.value) - error;
      points_[i].high[k] = std::max(at_begin.value, at_end.value) + error;
    }
  }
  for (std::size_t i = 0; i < contour.size(); ++i) {
    const Extent &from = points_[i], &to = points_[next_[i]];
    for (int k = 0; k < 2; ++k) {
      extents_[i].low[k] = std::min(from.low[k], to.low[k]);
      extents_[i].high[k] = std::max(from.high[k], to.high[k]);
    }
    extents_[i].side = std::uint32_t(i);
  }
}

template <class S>
bool PatchCertificate<S>::contour_is_simple(std::span<const FaceSide> contour, const Axis& axis) {
  if (contour.empty()) return false;
  next_.resize(contour.size());
  std::uint32_t others = 0;  // loops that may turn to the left
  for (std::size_t begin = 0, end = 0; begin < contour.size(); begin = end) {
    while (contour[end].to != contour[begin].from) {
      next_[end] = std::uint32_t(end + 1);
      ++end;
    }
    next_[end++] = std::uint32_t(begin);
    // A single loop winds around no point more than once, in whichever direction.
    const bool alone = begin == 0 && end == contour.size();
    if (!alone && !turns_right(axis, contour.subspan(begin, end - begin)) && ++others > 1) return false;
  }
  for (std::size_t i = 0; i < contour.size(); ++i)
    if (!goes_on(axis, contour[i], contour[next_[i]])) return false;
  list_extents(contour, axis);
  double extent[2];
  for (int k = 0; k < 2; ++k) {
    double low = extents_[0].low[k], high = extents_[0].high[k];
    for (const Extent& one : extents_) {
      low = std::min(low, one.low[k]);
      high = std::max(high, one.high[k]);
    }
    extent[k] = high - low;
  }
  const int sorted = extent[1] > extent[0] ? 1 : 0;
  std::sort(extents_.begin(), extents_.end(), [sorted](const Extent& a, const Extent& b) {
    return a.low[sorted] != b.low[sorted] ? a.low[sorted] < b.low[sorted] : a.side < b.side;
  });
  // Long motions make all extents overlap; a search is cheaper then.
  std::uint64_t left = 4096 + 64 * std::uint64_t(contour.size());
  for (std::size_t i = 0; i < extents_.size(); ++i) {
    const Extent& a = extents_[i];
    for (std::size_t j = i + 1; j < extents_.size() && extents_[j].low[sorted] <= a.high[sorted]; ++j) {
      if (left-- == 0) return false;
      const Extent& b = extents_[j];
      if (b.low[1 - sorted] > a.high[1 - sorted] || a.low[1 - sorted] > b.high[1 - sorted]) continue;
      if (next_[a.side] == b.side || next_[b.side] == a.side) continue;
      if (!apart(axis, contour[a.side], contour[b.side])) return false;
    }
  }
  return true;
}

template <class S>
bool PatchCertificate<S>::holds(const ElementLeaves<S>& faces, std::uint32_t padded, std::uint32_t node,
                                std::span<const FaceSide> contour) {
  Axis axis;
  return find_axis(contour, axis) && normals_agree(faces, padded, node, axis) &&
         contour_is_simple(contour, axis);
}

template <class S>
std::size_t PatchCertificate<S>::bytes() const {
  return (nodes_.capacity() + next_.capacity()) * sizeof(std::uint32_t) +
         (points_.capacity() + extents_.capacity()) * sizeof(Extent);
}

template class PatchCertificate<float>;
template class PatchCertificate<double>;

}  // namespace kbvh
