#include "core/families/wide/wide_rays.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/topology/builders.hpp"

namespace kbvh {

namespace {

/// The tree over bodies is rebuilt when its boxes have grown by this factor.
constexpr double bodies_worn_out = 1.5;
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

template <class S>
double summed_area(const WideHierarchy<S>& hierarchy) {
  double sum = 0;
  for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node)
    if (!hierarchy.topology().nodes[node].is_leaf()) sum += surface_area(hierarchy.box(node));
  return sum;
}

}  // namespace

template <class S>
void WideRays<S>::refit_bodies() {
  const auto has_polygons = [&](std::uint32_t body) {
    return scene_.primitives(body).kind == PrimitiveKind::polygons && !sides_[body].hierarchy->empty();
  };
  // Bodies may become empty, or get their first primitive.
  std::size_t next = 0;
  bool same = true;
  for (std::uint32_t body = 0; body < sides_.size(); ++body)
    if (has_polygons(body)) same = same && next < ids_.size() && ids_[next++] == body;
  same = same && next == ids_.size();
  if (!same) {
    ids_.clear();
    primitives_ = {};
    for (std::uint32_t body = 0; body < sides_.size(); ++body)
      if (has_polygons(body)) {
        const auto i = std::uint32_t(ids_.size());
        primitives_.add(std::vector<std::uint32_t>{2 * i, 2 * i + 1});
        ids_.push_back(body);
      }
    corners_.assign(6 * ids_.size() + 1, S(0));
    built_area_ = -1;
  }
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const Box<S> box = sides_[ids_[i]].root_box();
    std::copy_n(box.lower, 3, corners_.data() + 6 * i);
    std::copy_n(box.upper, 3, corners_.data() + 6 * i + 3);
  }
  const auto build = [&] {
    bodies_.assign(build_topology(primitives_, corners_.data(),
                                  {.method = BuildMethod::median, .width = 8, .leaf_size = 1}),
                   primitives_, active_kernel_set());
  };
  if (built_area_ < 0) build();
  if (ids_.empty()) return;
  bodies_.refit(corners_.data());
  if (ids_.size() <= 8) {  // one node, whatever its children
    built_area_ = 0;
    return;
  }
  const double area = summed_area(bodies_);
  if (built_area_ < 0) built_area_ = area;
  if (area <= bodies_worn_out * built_area_) return;
  build();
  bodies_.refit(corners_.data());
  built_area_ = summed_area(bodies_);
}

template <class S>
void WideRays<S>::prepare(std::size_t rays) {
  if (++stamp_ == 0) {
    for (OfBody& one : of_bodies_) std::fill(one.copies.begin(), one.copies.end(), WideLeafCopy{});
    stamp_ = 1;
  }
  of_bodies_.resize(sides_.size());
  for (const std::uint32_t body : ids_) {
    OfBody& one = of_bodies_[body];
    const WideProbeSide<S>& side = sides_[body];
    const WideTree<S>& tree = *side.hierarchy;
    const Primitives& primitives = scene_.primitives(body);
    one.entered = false;
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
      const auto& all = *static_cast<WideRays*>(context);
      all.make_(all.body_, node);
    };
    job.decide = [](void* context, std::uint32_t primitive, const S* corners) {
      return static_cast<WideRays*>(context)->decide(primitive, corners);
    };
    job.row = std::max(4U, tree.padded_leaf_size());
    job.stamp = stamp_;
    if (tree.leaf_size() == 1 || double(rays) < rays_per_leaf * tree.leaf_count()) continue;
    if (one.copies.size() < tree.leaf_count()) one.copies.resize(tree.leaf_count());
    const std::size_t numbers = std::size_t(9) * job.row * tree.leaf_count();
    if (one.corners.size() < numbers) one.corners.resize(numbers);
    job.copies = one.copies.data();
    job.copied = one.corners.data();
  }
  all_bodies_.job = {};
  if (ids_.empty()) return;
  all_bodies_.kernel = wide_ray_kernels<S>(bodies_.kernels()).follow(bodies_.width());
  all_bodies_.job = job_in(bodies_);
  all_bodies_.job.decide = [](void* context, std::uint32_t primitive, const S*) {
    auto& all = *static_cast<WideRays*>(context);
    return all.follow(all.enter(all.ids_[primitive]).search, 0, all.stack_);
  };
}

template <class S>
WideRayJob<S> WideRays<S>::job_in(WideTree<S>& tree) {
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
bool WideRays<S>::follow(Traversal& search, std::uint32_t from, std::vector<WideRayItem<S>>& stack) {
  WideRayJob<S>& job = search.job;
  if (stack.empty()) stack.resize(256);
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
bool WideRays<S>::pack(std::span<const Ray<S>> rays, std::uint64_t met) {
  if (ids_.size() != 1 || std::popcount(met) < least_of_a_packet) return false;
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
void WideRays<S>::follow_packet() {
  Traversal& search = enter(ids_[0]).search;
  work_[ids_[0]].rays += packet_.searching - 1;
  if (packet_stack_.empty()) packet_stack_.resize(256);
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
auto WideRays<S>::enter(std::uint32_t body) -> OfBody& {
  OfBody& one = of_bodies_[body];
  if (!one.entered) {
    one.entered = true;
    motion_.fetch_all(body);
    one.search.job.positions = motion_.positions(body);
  }
  body_ = body;
  ++work_[body].rays;
  return one;
}

template <class S>
bool WideRays<S>::decide(std::uint32_t primitive, const S* corners) {
  static constexpr std::uint32_t in_order[3] = {0, 1, 2};
  WideRay<S>& ray = *of_bodies_[body_].search.job.ray;
  RaySearch<S>& search = *searches_[&ray - rays_];
  const double limit = search.limit();
  const bool over = corners != nullptr
                        ? search.offer(body_, primitive, PolygonTriangles(in_order), corners, *stats_)
                        : search.offer(body_, primitive, scene_.primitives(body_).triangles(primitive),
                                       motion_.positions(body_), *stats_);
  if (search.limit() != limit) ray.limit = at_least<S>(search.limit());
  return over;
}

template <class S>
std::uint64_t WideRays<S>::screen(std::span<const Ray<S>> rays) {
  if (ids_.empty()) return 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      block_.origin[axis][i] = rays[i].origin[axis];
      block_.direction[axis][i] = rays[i].direction[axis];
    }
    block_.length[i] = rays[i].length;
  }
  const WideArrays<S> bodies = bodies_.arrays();
  const std::uint64_t asked = ~std::uint64_t(0) >> (WideRayBlock<S>::size - rays.size());
  const std::uint64_t met =
      asked &
      wide_ray_kernels<S>(bodies_.kernels()).screen(block_, bodies.child_bounds, bodies.nodes[0].count);
  tests_ += std::uint64_t(std::popcount(asked & ~met)) * bodies.nodes[0].count;
  return met;
}

template <class S>
void WideRays<S>::answer(const RayProbes<S>& asked, std::span<const WideProbeSide<S>> sides,
                         const WideBoxMaker& make, std::span<RayWork> work, TriangleTestStats& stats,
                         std::uint64_t& tests) {
  sides_ = sides;
  make_ = make;
  work_ = work;
  stats_ = &stats;
  tests_ = 0;
  refit_bodies();
  const std::span<const Ray<S>> rays = asked.rays;
  prepare(rays.size());
  for (std::size_t begin = 0; begin < rays.size(); begin += WideRayBlock<S>::size) {
    const std::size_t count = std::min(rays.size() - begin, WideRayBlock<S>::size);
    std::uint64_t met = screen(rays.subspan(begin, count));
    std::fill_n(asked.hits.begin() + std::ptrdiff_t(begin), count, RayHit{});
    if (pack(rays.subspan(begin, count), met)) {
      packet_searches_.clear();
      packet_searches_.reserve(WideRayBlock<S>::size);
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
      if (ids_.size() == 1)
        follow(enter(ids_[0]).search, 0, stack_);
      else
        follow(all_bodies_, 0, body_stack_);
      asked.take(i, search);
    }
  }
  for (const std::uint32_t body : ids_) tests_ += work_[body].tests = of_bodies_[body].search.job.tests;
  tests += tests_ + all_bodies_.job.tests;
}

template <class S>
void WideRays<S>::count_bodies(std::span<const Ray<S>> rays, RayBodies& bodies) const {
  for (const std::uint32_t body : ids_) {
    if (work_[body].rays != 0) {
      ++bodies.entered;
      continue;
    }
    const Box<S> box = sides_[body].root_box();
    const bool met = std::any_of(rays.begin(), rays.end(), [&](const Ray<S>& ray) {
      double near = 0;
      return RaySearch<S>(ray, RayQuery::any).box_test().meet(box, double(ray.length), near);
    });
    ++(met ? bodies.hidden : bodies.unmet);
  }
}

template <class S>
std::size_t WideRays<S>::bytes() const {
  std::size_t total = bodies_.bytes() +
                      (primitives_.offsets.capacity() + primitives_.vertices.capacity() + ids_.capacity()) *
                          sizeof(std::uint32_t) +
                      corners_.capacity() * sizeof(S) + of_bodies_.capacity() * sizeof(OfBody) +
                      (body_stack_.capacity() + stack_.capacity()) * sizeof(WideRayItem<S>) +
                      packet_stack_.capacity() * sizeof(WidePacketItem<S>) +
                      packet_searches_.capacity() * sizeof(RaySearch<S>);
  for (const OfBody& one : of_bodies_)
    total += one.corners.capacity() * sizeof(S) + one.copies.capacity() * sizeof(WideLeafCopy);
  return total;
}

template class WideRays<float>;
template class WideRays<double>;

}  // namespace kbvh
