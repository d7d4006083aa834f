#include "core/topology/builder_over_time.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "core/topology/median_tree.hpp"

namespace kbvh {
namespace {

template <class S>
class SplitterOverTime {
 public:
  SplitterOverTime(const Primitives& primitives, std::span<const S* const> positions)
      : times_(positions.size()) {
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      if (primitives.alive(p)) order_.push_back(p);
    boxes_.reserve(times_ * primitives.count());
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      for (const S* const at : positions) {
        Box<S> box;
        if (primitives.alive(p))
          for (const std::uint32_t v : primitives[p]) box.extend(at + std::size_t(3) * v);
        boxes_.push_back(box);
      }
  }

  /// Uses the order of the time whose halves have the least surface over all times.
  void median_split(std::uint32_t begin, std::uint32_t middle, std::uint32_t end) {
    best_.assign(order_.begin() + begin, order_.begin() + end);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t time = 0; time < times_; ++time) {
      sort(begin, middle, end, time);
      const double cost = surface(begin, middle) + surface(middle, end);
      if (!(cost < least)) continue;
      least = cost;
      best_.assign(order_.begin() + begin, order_.begin() + end);
    }
    std::copy(best_.begin(), best_.end(), order_.begin() + begin);
  }

  std::vector<std::uint32_t> take_order() { return std::move(order_); }

 private:
  const Box<S>& box(std::uint32_t primitive, std::size_t time) const {
    return boxes_[times_ * primitive + time];
  }
  /// Returns twice the centre of a box along an axis.
  double centre(std::uint32_t primitive, std::size_t time, std::size_t axis) const {
    return double(box(primitive, time).lower[axis]) + double(box(primitive, time).upper[axis]);
  }
  void sort(std::uint32_t begin, std::uint32_t middle, std::uint32_t end, std::size_t time) {
    double longest = -1;
    std::size_t axis = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      double lower = std::numeric_limits<double>::infinity(), upper = -lower;
      for (std::uint32_t i = begin; i < end; ++i) {
        lower = std::min(lower, centre(order_[i], time, a));
        upper = std::max(upper, centre(order_[i], time, a));
      }
      if (upper - lower > longest) longest = upper - lower, axis = a;
    }
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       const double at_a = centre(a, time, axis), at_b = centre(b, time, axis);
                       return at_a != at_b ? at_a < at_b : a < b;
                     });
  }
  double surface(std::uint32_t begin, std::uint32_t end) {
    bounds_.assign(times_, Box<S>{});
    for (std::uint32_t i = begin; i < end; ++i)
      for (std::size_t time = 0; time < times_; ++time) bounds_[time].extend(box(order_[i], time));
    double sum = 0;
    for (const Box<S>& bound : bounds_) sum += surface_area(bound);
    return sum;
  }

  std::size_t times_;
  std::vector<std::uint32_t> order_, best_;
  std::vector<Box<S>> boxes_;  ///< [primitive][time]
  std::vector<Box<S>> bounds_;
};

}  // namespace

template <class S>
Topology build_topology_over_time(const Primitives& primitives, std::span<const S* const> positions,
                                  const BuilderConfig& config) {
  if (positions.empty()) throw std::invalid_argument("a tree over time needs positions at one time at least");
  check_builder(config);
  SplitterOverTime<S> splitter(primitives, positions);
  const auto count = std::uint32_t(primitives.count() - primitives.removed_count);
  Topology topology;
  topology.width = config.width;
  topology.leaf_size = config.leaf_size;
  if (count == 0) return topology;
  topology = MedianTree(splitter, config).build(count);
  topology.primitives = splitter.take_order();
  sort_leaves(topology);
  topology.perfect = is_perfect(topology);
  return topology;
}

template Topology build_topology_over_time(const Primitives&, std::span<const float* const>,
                                           const BuilderConfig&);
template Topology build_topology_over_time(const Primitives&, std::span<const double* const>,
                                           const BuilderConfig&);

}  // namespace kbvh
