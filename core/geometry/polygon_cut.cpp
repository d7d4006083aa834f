#include "core/geometry/polygon_cut.hpp"

#include <algorithm>
#include <limits>
#include <tuple>
#include <vector>

#include "core/base/assert.hpp"
#include "core/geometry/projected_polygon.hpp"

namespace kbvh {
namespace {

/// Returns where the lexicographically smallest rotation of n items begins; item(i) is item i. O(n).
template <class Item>
std::size_t smallest_rotation(std::size_t n, const Item& item) {
  std::size_t i = 0, j = 1, same = 0;
  while (i < n && j < n && same < n) {
    const std::uint32_t a = item((i + same) % n), b = item((j + same) % n);
    if (a == b) {
      ++same;
      continue;
    }
    (a > b ? i : j) += same + 1;
    if (i == j) ++j;
    same = 0;
  }
  return std::min(i, j);
}

/// How suitable a corner is for cutting off; smaller is better.
enum class Rank : std::uint8_t {
  clean,    ///< an ear whose diagonal avoids all other corners
  touched,  ///< an ear with a corner on its diagonal
  flat,     ///< no area
  convex,   ///< turns with the polygon, but is not an ear
  any,
};

}  // namespace

class PolygonCutter::Work {
 public:
  template <class S>
  PolygonCut cut(std::span<const std::uint32_t> ids, const S* positions) {
    KBVH_ASSERT(ids.size() > 3);
    const bool reversed = order(ids);
    points_.clear();
    for (const std::uint32_t id : ids_)
      for (std::size_t axis = 0; axis < 3; ++axis)
        points_.push_back(double(positions[std::size_t(3) * id + axis]));
    corners_.clear();
    PolygonCut result;
    polygon_.take(points_);
    if (polygon_.has_area()) {
      if (is_convex())
        cut_fan();
      else
        result.crosses = cut_ears();
    } else {
      result.crosses = !polygon_.is_straight();
      cut_fan();
    }
    if (reversed)
      for (std::size_t i = 0; i < corners_.size(); i += 3) std::swap(corners_[i], corners_[i + 2]);
    result.bent = polygon_.bent();
    result.corners = corners_;
    return result;
  }

 private:
  /// Puts the ids into an order that depends neither on the first corner nor on the direction: the
  /// smallest rotation of the list or its reverse. Returns whether the direction is reversed.
  bool order(std::span<const std::uint32_t> ids) {
    const std::size_t n = ids.size();
    const auto there = [&](std::size_t i) { return ids[i]; };
    const auto back = [&](std::size_t i) { return ids[n - 1 - i]; };
    const std::size_t first = smallest_rotation(n, there), first_back = smallest_rotation(n, back);
    ids_.clear();
    for (std::size_t i = 0; i < n; ++i) ids_.push_back(there((first + i) % n));
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t id = back((first_back + i) % n);
      if (id == ids_[i]) continue;
      if (id > ids_[i]) return false;
      for (; i < n; ++i) ids_[i] = back((first_back + i) % n);
      return true;
    }
    return false;
  }

  int turn(std::size_t a, std::size_t b, std::size_t c) { return polygon_.turn(a, b, c); }

  void add_triangle(std::size_t a, std::size_t b, std::size_t c) {
    for (const std::size_t corner : {a, b, c}) corners_.push_back(ids_[corner]);
  }
  void cut_fan() {
    for (std::size_t i = 1; i + 1 < ids_.size(); ++i) add_triangle(0, i, i + 1);
  }

  /// Returns whether the polygon is strictly convex: it turns at each corner, and all corners lie on one side
  /// of the first edge, in the order of their directions from the first corner.
  bool is_convex() {
    const std::size_t n = ids_.size();
    for (std::size_t i = 0; i < n; ++i)
      if (turn(i, (i + 1) % n, (i + 2) % n) <= 0) return false;
    for (std::size_t i = 2; n > 4 && i + 1 < n; ++i)
      if (turn(0, i, i + 1) <= 0 || turn(0, 1, i + 1) <= 0) return false;
    return true;
  }

  /// Sorts corners that are not cut off by one coordinate.
  void sort_corners() {
    sorted_.clear();
    for (std::size_t i = 0; i < ids_.size(); ++i)
      if (!is_cut_off_[i]) sorted_.push_back(std::uint32_t(i));
    std::sort(sorted_.begin(), sorted_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(polygon_.along(a), a) < std::pair(polygon_.along(b), b);
    });
  }

  /// Returns whether certainly no two edges meet except neighbours at their common corner. Then the triangle
  /// of a corner that turns with the polygon lies inside if it contains no other corner, and stays an ear.
  /// Compares edges that overlap in one coordinate.
  bool is_simple() {
    const std::size_t n = ids_.size();
    for (std::size_t i = 0; i < n; ++i)
      if (turn(i, (i + 1) % n, (i + 2) % n) == 0) return false;
    // An edge is listed at the corner where it begins in this coordinate.
    const auto meets_a_later_edge = [&](std::size_t place, std::size_t a, std::size_t b) {
      const double end = std::max(polygon_.along(a), polygon_.along(b)) + 2 * polygon_.slack();
      for (; place < n && !(polygon_.along(sorted_[place]) > end); ++place) {
        const std::size_t c = sorted_[place];
        for (const std::size_t d : {next_[c], previous_[c]}) {
          if (c == a || c == b || d == a || d == b || polygon_.boxes_apart(a, b, c, d)) continue;
          if (turn(a, b, c) * turn(a, b, d) <= 0 && turn(c, d, a) * turn(c, d, b) <= 0) return true;
        }
      }
      return false;
    };
    for (std::size_t place = 0; place < n; ++place) {
      const std::size_t a = sorted_[place];
      for (const std::size_t b : {next_[a], previous_[a]})
        if (!(polygon_.along(b) < polygon_.along(a)) && meets_a_later_edge(place, a, b)) return false;
    }
    return true;
  }

  // ---- Ears
  // -------------------------------------------------------------------------------------------------

  /// Returns the sides of a triangle on whose outer side or line a corner lies: bits 0 to 2 (bits 3 to 5: on
  /// the outer side).
  unsigned sides(const std::size_t (&t)[3], std::size_t corner) {
    unsigned bits = 0;
    for (unsigned side = 0; side < 3; ++side) {
      const int way = turn(t[side], t[(side + 1) % 3], corner);
      if (way <= 0) bits |= 1U << side;
      if (way < 0) bits |= 8U << side;
    }
    return bits;
  }

  Rank rank(std::size_t tip) {
    const std::size_t t[3] = {previous_[tip], tip, next_[tip]};
    const int way = turn(t[0], t[1], t[2]);
    if (way <= 0) return way == 0 ? Rank::flat : Rank::any;
    polygon_.bound(t);
    return simple_ ? rank_among_corners(t) : rank_among_edges(t);
  }

  /// If no edges cross, an edge that enters a triangle has an end in it.
  Rank rank_among_corners(const std::size_t (&t)[3]) {
    auto next =
        std::lower_bound(sorted_.begin(), sorted_.end(), polygon_.bound_begin(),
                         [&](std::uint32_t corner, double at) { return polygon_.along(corner) < at; });
    Rank rank = Rank::clean;
    for (; next != sorted_.end() && !(polygon_.along(*next) > polygon_.bound_end()); ++next) {
      const std::size_t corner = *next;
      if (is_cut_off_[corner] || corner == t[0] || corner == t[1] || corner == t[2] ||
          polygon_.beyond_bound(corner, corner))
        continue;
      const unsigned bits = sides(t, corner);
      if (bits == 0) return Rank::convex;
      if (bits < 8) rank = Rank::touched;
    }
    return rank;
  }

  Rank rank_among_edges(const std::size_t (&t)[3]) {
    bool touched = false;
    for (std::size_t a = t[2]; a != t[0]; a = next_[a]) {
      const std::size_t b = next_[a];
      if (polygon_.beyond_bound(a, b)) continue;
      const unsigned at_a = sides(t, a), at_b = sides(t, b);
      touched = touched || (b != t[0] && at_b < 8 && !polygon_.coincides(b, t));
      if ((at_a & at_b & 7U) != 0) continue;
      int left = 0, right = 0;
      for (const std::size_t corner : t) {
        const int of_edge = turn(a, b, corner);
        left += of_edge > 0 ? 1 : 0;
        right += of_edge < 0 ? 1 : 0;
      }
      if (left != 0 && right != 0) return Rank::convex;
    }
    if (!is_inside(t)) return Rank::convex;
    return touched ? Rank::touched : Rank::clean;
  }

  /// Decides by even-odd whether a triangle that is free of edges lies inside.
  bool is_inside(const std::size_t (&t)[3]) {
    const std::size_t inner = polygon_.place_inside(t);
    bool inside = false;
    std::size_t a = t[0];
    bool left_a = turn(inner, t[1], a) >= 0;
    do {
      const std::size_t b = next_[a];
      const bool left_b = turn(inner, t[1], b) >= 0;
      // Counts crossings of the line through the inner point and the tip. A crossing is ahead of the point if
      // the point lies on the left of an edge that goes to the left.
      if (left_a != left_b && (left_b ? turn(a, b, inner) : turn(b, a, inner)) > 0) inside = !inside;
      a = b;
      left_a = left_b;
    } while (a != t[0]);
    return inside;
  }

  struct Candidate {
    Rank rank;
    std::uint32_t low, high;  ///< ids of the diagonal
    std::size_t tip;
    std::uint32_t version;
    bool operator<(const Candidate& other) const {  // heaps keep the largest first
      return std::tie(rank, low, high, tip) > std::tie(other.rank, other.low, other.high, other.tip);
    }
  };
  void consider(std::size_t tip) {
    const auto [low, high] = std::minmax(ids_[previous_[tip]], ids_[next_[tip]]);
    heap_.push_back({rank(tip), low, high, tip, ++version_[tip]});
    std::push_heap(heap_.begin(), heap_.end());
  }
  void consider_all(std::size_t from) {
    heap_.clear();
    std::size_t tip = from;
    do {
      consider(tip);
      tip = next_[tip];
    } while (tip != from);
  }

  /// Returns whether the polygon crosses itself.
  bool cut_ears() {
    const std::size_t n = ids_.size();
    next_.resize(n);
    previous_.resize(n);
    version_.assign(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
      next_[i] = (i + 1) % n;
      previous_[i] = (i + n - 1) % n;
    }
    is_cut_off_.assign(n, false);
    sort_corners();
    simple_ = is_simple();
    consider_all(0);
    bool crosses = false, all_are_new = true;
    for (std::size_t left = n; left > 3;) {
      std::pop_heap(heap_.begin(), heap_.end());
      const Candidate best = heap_.back();
      heap_.pop_back();
      if (best.version != version_[best.tip]) continue;
      if (!simple_ && best.rank < Rank::flat && !all_are_new && rank(best.tip) != best.rank) {
        consider(best.tip);
        continue;
      }
      if (best.rank > Rank::flat && !crosses) {
        // Cuts elsewhere may have made an ear of a corner that was none when it was considered.
        if (!all_are_new) {
          consider_all(best.tip);
          all_are_new = true;
          continue;
        }
        crosses = true;
      }
      const std::size_t before = previous_[best.tip], after = next_[best.tip];
      add_triangle(before, best.tip, after);
      next_[before] = after;
      previous_[after] = before;
      ++version_[best.tip];
      is_cut_off_[best.tip] = true;
      all_are_new = false;
      if (2 * left < sorted_.size()) sort_corners();
      if (--left == 3) {
        add_triangle(before, after, next_[after]);
        break;
      }
      consider(before);
      consider(after);
    }
    return crosses;
  }

  std::vector<std::uint32_t> ids_;      ///< [corner], in the order that all decisions use
  std::vector<double> points_;          ///< [corner][3]
  std::vector<std::uint32_t> corners_;  ///< the result
  ProjectedPolygon polygon_;
  std::vector<std::size_t> next_, previous_;
  std::vector<std::uint32_t> version_;  ///< [corner]: version of its newest candidate; older ones are ignored
  std::vector<Candidate> heap_;
  std::vector<bool> is_cut_off_;
  std::vector<std::uint32_t> sorted_;  ///< corners by ProjectedPolygon::along; may hold some that are cut off
  bool simple_ = false;
};

PolygonCutter::PolygonCutter() : work_(std::make_unique<Work>()) {}
PolygonCutter::~PolygonCutter() = default;
PolygonCutter::PolygonCutter(PolygonCutter&&) noexcept = default;

template <class S>
PolygonCut PolygonCutter::cut(std::span<const std::uint32_t> ids, const S* positions) {
  return work_->cut(ids, positions);
}

template PolygonCut PolygonCutter::cut(std::span<const std::uint32_t>, const float*);
template PolygonCut PolygonCutter::cut(std::span<const std::uint32_t>, const double*);

}  // namespace kbvh
