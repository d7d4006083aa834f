#include "core/families/wide/wide_ray_runner.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace kbvh {

namespace {

/// Copies of corners are kept if there are at least this many rays for each leaf of a body: fewer rays meet
/// too few leaves a second time.
constexpr double rays_per_leaf = 0.25;
/// Fewer rays of a block are followed one by one.
constexpr int least_of_a_packet = 16;

/// Returns a number of the scalar that is not below x.
template <class S>
S at_least(double x) {
  const S rounded = S(x);
  return double(rounded) < x ? std::nextafter(rounded, std::numeric_limits<S>::infinity()) : rounded;
}

/// Returns a ray in the form that the traversal reads. Without branches that depend on its direction, which
/// no processor would predict.
template <class S>
WideRay<S> wide_ray(const Ray<S>& ray) {
  WideRay<S> wide{};
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const S direction = ray.direction[axis];
    S inverse = 1 / direction;
    // Too small to be inverted: the axis rejects nothing (see RaySlabs).
    if (direction != 0 && std::isinf(inverse)) inverse = std::numeric_limits<S>::quiet_NaN();
    // Rows hold lower, and upper with the other sign.
    const std::uint32_t back = std::signbit(inverse) ? 3 : 0;
    wide.enter_row[axis] = axis + back;
    wide.leave_row[axis] = axis + 3 - back;
    wide.add[axis] = -std::copysign(S(1), inverse) * ray.origin[axis];
    wide.scale[axis] = std::abs(inverse);
  }
  wide.limit = ray.length;
  const S size[3] = {std::abs(ray.direction[0]), std::abs(ray.direction[1]), std::abs(ray.direction[2])};
  std::uint32_t along = size[1] > size[0] ? 1 : 0;
  along = size[2] > std::max(size[0], size[1]) ? 2 : along;
  constexpr std::uint32_t cyclic[5] = {0, 1, 2, 0, 1};
  for (std::uint32_t k = 0; k < 3; ++k) {
    wide.axes[k] = cyclic[(along + 1) % 3 + k];
    wide.origin[k] = ray.origin[wide.axes[k]];
  }
  const S steep = ray.direction[along];
  wide.steepness = size[along];
  wide.sign = std::copysign(S(1), steep);
  if (steep != 0)
    for (std::uint32_t k = 0; k < 2; ++k) wide.shear[k] = ray.direction[wide.axes[k]] / steep;
  return wide;
}

}  // namespace

template <class S>
void WideRayRunner<S>::prepare(const WideRayBodies<S>& all, std::size_t rays) {
  all_ = &all;
  stats_ = {};
  screen_tests_ = 0;
  deepen({256, 256, 256});
  packet_searches_.reserve(WideRayBlock<S>::size);
  if (++stamp_ == 0) {
    for (OfBody& one : of_bodies_) std::fill(one.copies.begin(), one.copies.end(), WideLeafCopy{});
    stamp_ = 1;
  }
  of_bodies_.resize(all.sides.size());
  for (const std::uint32_t body : all.ids) prepare_body(body, rays);
  all_bodies_.job = {};
  if (all.ids.empty()) return;
  all_bodies_.kernel = wide_ray_kernels<S>(all.tree->kernels()).follow(all.tree->width());
  all_bodies_.job = job_in(*all.tree);
  all_bodies_.job.decide = [](void* context, std::uint32_t primitive, const S*) {
    auto& one = *static_cast<WideRayRunner*>(context);
    return one.follow(one.enter(one.all_->ids[primitive]).search, 0, one.stack_);
  };
}

template <class S>
void WideRayRunner<S>::prepare_body(std::uint32_t body, std::size_t rays) {
  OfBody& one = of_bodies_[body];
  const WideProbeSide<S>& side = all_->sides[body];
  const WideTree<S>& tree = *side.hierarchy;
  const Primitives& primitives = all_->scene.primitives(body);
  one.entered = false;
  one.rays = 0;
  one.search.kernel = wide_ray_kernels<S>(tree.kernels()).follow(tree.width());
  one.search.together = wide_ray_kernels<S>(tree.kernels()).together(tree.width());
  WideRayJob<S>& job = one.search.job;
  job = job_in(*side.hierarchy);
  if (side.child_bounds != nullptr) job.tree.child_bounds = side.child_bounds;
  job.offsets = primitives.offsets.data();
  job.vertices = primitives.vertices.data();
  job.triangle_corners = tree.triangle_corners();
  job.stale = side.stale;
  job.make = [](void* context, std::uint32_t node) {
    const auto& runner = *static_cast<WideRayRunner*>(context);
    runner.all_->make(runner.body_, node);
  };
  job.decide = [](void* context, std::uint32_t primitive, const S* corners) {
    return static_cast<WideRayRunner*>(context)->decide(primitive, corners);
  };
  job.row = std::max(4U, tree.padded_leaf_size());
  job.stamp = stamp_;
  if (tree.leaf_size() == 1 || double(rays) < rays_per_leaf * tree.leaf_count()) return;
  if (one.copies.size() < tree.leaf_count()) one.copies.resize(tree.leaf_count());
  const std::size_t numbers = std::size_t(9) * job.row * tree.leaf_count();
  if (one.corners.size() < numbers) one.corners.resize(numbers);
  job.copies = one.copies.data();
  job.copied = one.corners.data();
}

template <class S>
WideRayJob<S> WideRayRunner<S>::job_in(WideTree<S>& tree) {
  const WideLeafLists leaves = tree.leaf_lists();
  WideRayJob<S> job{};
  job.ray = rays_;
  job.tree = tree.arrays();
  job.first_entry = leaves.first_entry;
  job.end_entry = leaves.end_entry;
  job.entries = leaves.primitives;
  job.context = this;
  return job;
}

template <class S>
bool WideRayRunner<S>::follow(Traversal& search, std::uint32_t from, std::vector<WideRayItem<S>>& stack) {
  WideRayJob<S>& job = search.job;
  stack[0] = {S(0), from};
  job.depth = 1;
  job.over = false;
  for (;;) {
    job.stack = stack.data();
    job.room = stack.size();
    search.kernel(job);
    if (job.depth == 0 || job.over) return job.over;
    stack.resize(2 * stack.size());
  }
}

template <class S>
bool WideRayRunner<S>::pack(std::span<const Ray<S>> rays, std::uint64_t met) {
  if (all_->ids.size() != 1 || std::popcount(met) < least_of_a_packet) return false;
  const Ray<S>& one = rays[std::size_t(std::countr_zero(met))];
  for (std::uint64_t left = met; left != 0; left &= left - 1)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S direction = rays[std::size_t(std::countr_zero(left))].direction[axis];
      if (!(std::abs(direction) >= 4 * std::numeric_limits<S>::min()) ||
          std::signbit(direction) != std::signbit(one.direction[axis]))
        return false;
    }
  constexpr S infinity = std::numeric_limits<S>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    packet_.least_add[axis] = packet_.least_scale[axis] = infinity;
    packet_.most_add[axis] = packet_.most_scale[axis] = -infinity;
  }
  for (std::size_t i = 0; i < WideRayPacket<S>::size; ++i) {
    const bool followed = (met >> i & 1) != 0;
    if (followed) rays_[i] = wide_ray(rays[i]);
    packet_.limit[i] = followed ? rays_[i].limit : S(-1);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S add = packet_.add[axis][i] = followed ? rays_[i].add[axis] : S(0);
      const S scale = packet_.scale[axis][i] = followed ? rays_[i].scale[axis] : S(1);
      if (!followed) continue;
      packet_.least_add[axis] = std::min(packet_.least_add[axis], add);
      packet_.most_add[axis] = std::max(packet_.most_add[axis], add);
      packet_.least_scale[axis] = std::min(packet_.least_scale[axis], scale);
      packet_.most_scale[axis] = std::max(packet_.most_scale[axis], scale);
    }
  }
  const WideRay<S>& first = rays_[std::countr_zero(met)];
  std::copy_n(first.enter_row, 3, packet_.enter_row);
  std::copy_n(first.leave_row, 3, packet_.leave_row);
  packet_.searching = std::uint32_t(std::popcount(met));
  packet_.rays = rays_;
  return true;
}

template <class S>
void WideRayRunner<S>::follow_packet() {
  OfBody& body = enter(all_->ids[0]);
  body.rays += packet_.searching - 1;
  Traversal& search = body.search;
  WidePacketJob<S> job{};
  job.single = &search.job;
  job.packet = &packet_;
  packet_stack_[0] = {S(0), 0, WidePacketItem<S>::no_box};
  job.depth = 1;
  while (job.depth > 0) {
    if (job.depth + max_items_per_step > packet_stack_.size()) packet_stack_.resize(2 * packet_stack_.size());
    job.stack = packet_stack_.data();
    job.room = packet_stack_.size();
    search.together(job);
    for (; job.alone != 0; job.alone &= job.alone - 1) {
      const auto i = std::size_t(std::countr_zero(job.alone));
      search.job.ray = rays_ + i;
      const bool over = follow(search, job.item, stack_);
      packet_.limit[i] = over ? S(-1) : rays_[i].limit;
      packet_.searching -= over ? 1U : 0U;
    }
  }
  search.job.ray = rays_;
}

template <class S>
auto WideRayRunner<S>::enter(std::uint32_t body) -> OfBody& {
  OfBody& one = of_bodies_[body];
  if (!one.entered) {
    one.entered = true;
    all_->motion.fetch_all(body);
    one.search.job.positions = all_->motion.positions(body);
  }
  body_ = body;
  ++one.rays;
  return one;
}

template <class S>
bool WideRayRunner<S>::decide(std::uint32_t primitive, const S* corners) {
  static constexpr std::uint32_t in_order[3] = {0, 1, 2};
  WideRay<S>& ray = *of_bodies_[body_].search.job.ray;
  RaySearch<S>& search = *searches_[&ray - rays_];
  const double limit = search.limit();
  const bool over = corners != nullptr
                        ? search.offer(body_, primitive, PolygonTriangles(in_order), corners, stats_)
                        : search.offer(body_, primitive, all_->scene.primitives(body_).triangles(primitive),
                                       all_->motion.positions(body_), stats_);
  if (search.limit() != limit) ray.limit = at_least<S>(search.limit());
  return over;
}

template <class S>
std::uint64_t WideRayRunner<S>::screen(std::span<const Ray<S>> rays) {
  if (all_->ids.empty()) return 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      block_.origin[axis][i] = rays[i].origin[axis];
      block_.direction[axis][i] = rays[i].direction[axis];
    }
    block_.length[i] = rays[i].length;
  }
  const WideArrays<S> bodies = all_->tree->arrays();
  const std::uint64_t asked = ~std::uint64_t(0) >> (WideRayBlock<S>::size - rays.size());
  const std::uint64_t met =
      asked &
      wide_ray_kernels<S>(all_->tree->kernels()).screen(block_, bodies.child_bounds, bodies.nodes[0].count);
  screen_tests_ += std::uint64_t(std::popcount(asked & ~met)) * bodies.nodes[0].count;
  return met;
}

template <class S>
void WideRayRunner<S>::answer(const RayProbes<S>& asked, std::size_t first, std::size_t last) {
  const std::span<const Ray<S>> rays = asked.rays;
  for (std::size_t begin = first; begin < last; begin += WideRayBlock<S>::size) {
    const std::size_t count = std::min(last - begin, WideRayBlock<S>::size);
    std::uint64_t met = screen(rays.subspan(begin, count));
    std::fill_n(asked.hits.begin() + std::ptrdiff_t(begin), count, RayHit{});
    if (pack(rays.subspan(begin, count), met)) {
      packet_searches_.clear();
      for (std::uint64_t left = met; left != 0; left &= left - 1) {
        const auto i = std::size_t(std::countr_zero(left));
        packet_searches_.push_back(asked.search(begin + i));
        searches_[i] = &packet_searches_.back();
      }
      follow_packet();
      for (; met != 0; met &= met - 1) {
        const auto i = std::size_t(std::countr_zero(met));
        asked.take(begin + i, *searches_[i]);
      }
      continue;
    }
    for (; met != 0; met &= met - 1) {
      const std::size_t i = begin + std::size_t(std::countr_zero(met));
      RaySearch<S> search = asked.search(i);
      searches_[0] = &search;
      rays_[0] = wide_ray(rays[i]);
      if (all_->ids.size() == 1)
        follow(enter(all_->ids[0]).search, 0, stack_);
      else
        follow(all_bodies_, 0, body_stack_);
      asked.take(i, search);
    }
  }
}

template <class S>
void WideRayRunner<S>::deepen(const Depths& depths) {
  const auto grow = [](auto& stack, std::size_t size) {
    if (stack.size() < size) stack.resize(size);
  };
  grow(body_stack_, depths.of_bodies);
  grow(stack_, depths.in_body);
  grow(packet_stack_, depths.of_packets);
}

template <class S>
std::size_t WideRayRunner<S>::bytes() const {
  std::size_t total = sizeof(*this) + of_bodies_.capacity() * sizeof(OfBody) +
                      (body_stack_.capacity() + stack_.capacity()) * sizeof(WideRayItem<S>) +
                      packet_stack_.capacity() * sizeof(WidePacketItem<S>) +
                      packet_searches_.capacity() * sizeof(RaySearch<S>);
  for (const OfBody& one : of_bodies_)
    total += one.corners.capacity() * sizeof(S) + one.copies.capacity() * sizeof(WideLeafCopy);
  return total;
}

template class WideRayRunner<float>;
template class WideRayRunner<double>;

}  // namespace kbvh
