#include "core/families/wide/wide_probes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/geometry/ray_box.hpp"
#include "core/topology/builders.hpp"

namespace kbvh {

namespace {

/// The tree over bodies is rebuilt when its boxes have grown by this factor.
constexpr double bodies_worn_out = 1.5;

/// Returns a number of the scalar that is not below x.
template <class S>
S at_least(double x) {
  const S rounded = S(x);
  return double(rounded) < x ? std::nextafter(rounded, std::numeric_limits<S>::infinity()) : rounded;
}

template <class S>
WideRay<S> wide_ray(const Ray<S>& ray) {
  WideRay<S> wide{};
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const S direction = ray.direction[axis];
    S inverse = 1 / direction;
    // Too small to be inverted: the axis rejects nothing (see RaySlabs).
    if (direction != 0 && std::isinf(inverse)) inverse = std::numeric_limits<S>::quiet_NaN();
    // Rows hold lower, and upper with the other sign.
    const bool back = std::signbit(inverse);
    wide.enter_row[axis] = back ? axis + 3 : axis;
    wide.leave_row[axis] = back ? axis : axis + 3;
    wide.add[axis] = back ? ray.origin[axis] : -ray.origin[axis];
    wide.scale[axis] = back ? -inverse : inverse;
    wide.origin[axis] = ray.origin[axis];
    wide.direction[axis] = direction;
  }
  wide.limit = ray.length;
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
WideProbes<S>::WideProbes(const SceneView<S>& scene, const SampledMotion<S>& motion)
    : scene_(scene), motion_(motion) {}
template <class S>
WideProbes<S>::~WideProbes() = default;

template <class S>
void WideProbes<S>::refit_bodies() {
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
void WideProbes<S>::follow(const WideTree<S>& tree, WideRayJob<S>& job, std::vector<WideRayItem<S>>& stack) {
  const WideLeafLists leaves = tree.leaf_lists();
  job.ray = &ray_;
  job.first_entry = leaves.first_entry;
  job.end_entry = leaves.end_entry;
  job.entries = leaves.primitives;
  job.context = this;
  stack.resize(std::max<std::size_t>(stack.size(), 256));
  stack[0] = {S(0), 0};
  job.depth = 1;
  const auto kernel = wide_ray_kernels<S>(tree.kernels()).follow(tree.width());
  for (;;) {
    job.stack = stack.data();
    job.room = stack.size();
    kernel(job);
    if (job.depth == 0 || job.over) break;
    stack.resize(2 * stack.size());
  }
  tests_ += job.tests;
}

template <class S>
bool WideProbes<S>::enter(std::uint32_t body) {
  const WideProbeSide<S>& side = sides_[body];
  const Primitives& primitives = scene_.primitives(body);
  motion_.fetch_all(body);
  body_ = body;
  WideRayJob<S> job{};
  job.tree = side.hierarchy->arrays();
  if (side.child_bounds != nullptr) job.tree.child_bounds = side.child_bounds;
  job.offsets = primitives.offsets.data();
  job.vertices = primitives.vertices.data();
  job.triangle_corners = side.hierarchy->triangle_corners();
  job.positions = motion_.positions(body);
  job.stale = side.stale;
  job.make = [](void* context, std::uint32_t node) {
    auto& rays = *static_cast<WideProbes*>(context);
    rays.make_(rays.make_context_, rays.body_, node);
  };
  job.decide = [](void* context, std::uint32_t primitive) {
    auto& rays = *static_cast<WideProbes*>(context);
    const double limit = rays.search_->limit();
    const bool over =
        rays.search_->offer(rays.body_, primitive, rays.scene_.primitives(rays.body_).triangles(primitive),
                            rays.motion_.positions(rays.body_), *rays.stats_);
    if (rays.search_->limit() != limit) rays.ray_.limit = at_least<S>(rays.search_->limit());
    return over;
  };
  const std::uint64_t tests_before = tests_;
  follow(*side.hierarchy, job, stack_);
  work_[body].tests += tests_ - tests_before;
  ++work_[body].rays;
  return job.over;
}

template <class S>
std::uint64_t WideProbes<S>::screen(std::span<const Ray<S>> rays) {
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
void WideProbes<S>::run(const RayProbes<S>& asked, TriangleTestStats& stats) {
  refit_bodies();
  stats_ = &stats;
  const std::span<const Ray<S>> rays = asked.rays;
  for (std::size_t begin = 0; begin < rays.size(); begin += WideRayBlock<S>::size) {
    const std::size_t count = std::min(rays.size() - begin, WideRayBlock<S>::size);
    std::uint64_t met = screen(rays.subspan(begin, count));
    std::fill_n(asked.hits.begin() + std::ptrdiff_t(begin), count, RayHit{});
    for (; met != 0; met &= met - 1) {
      const std::size_t i = begin + std::size_t(std::countr_zero(met));
      RaySearch<S> search = asked.search(i);
      search_ = &search;
      ray_ = wide_ray(rays[i]);
      if (ids_.size() == 1) {
        enter(ids_[0]);
      } else {
        WideRayJob<S> job{};
        job.tree = bodies_.arrays();
        job.decide = [](void* context, std::uint32_t primitive) {
          auto& all = *static_cast<WideProbes*>(context);
          return all.enter(all.ids_[primitive]);
        };
        follow(bodies_, job, body_stack_);
      }
      asked.take(i, search);
    }
  }
  search_ = nullptr;
}

template <class S>
template <class Search>
void WideProbes<S>::search_body(std::uint32_t body, Search& search, TriangleTestStats& stats) {
  const WideProbeSide<S>& side = sides_[body];
  const Primitives& primitives = scene_.primitives(body);
  WideTree<S>& hierarchy = *side.hierarchy;
  const WideArrays<S> arrays = hierarchy.arrays();
  const S* const bounds = side.child_bounds != nullptr ? side.child_bounds : arrays.child_bounds;
  const std::size_t width = hierarchy.width();
  const S* const positions = motion_.positions(body);
  const auto boxes = search.box_test();
  nodes_.assign(1, 0);
  while (!nodes_.empty()) {
    const std::uint32_t number = nodes_.back();
    nodes_.pop_back();
    if (side.stale != nullptr && side.stale[number] != 0) make_(make_context_, body, number);
    const WideNode node = arrays.nodes[number];
    const S* const rows = bounds + number * lane_scalars(hierarchy.width());
    tests_ += node.count;
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      Box<S> box;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = rows[axis * width + lane];
        box.upper[axis] = -rows[(axis + 3) * width + lane];
      }
      double near = 0;
      if (!boxes.meet(box, search.limit(), near)) continue;
      if (lane >= node.leaf_count) {
        nodes_.push_back(node.first_child + lane - node.leaf_count);
        continue;
      }
      for (const std::uint32_t primitive : hierarchy.leaf_primitives(node.first_leaf + lane))
        if (search.offer(body, primitive, primitives.triangles(primitive), positions, stats)) return;
    }
  }
}

template <class S>
template <class Kind>
void WideProbes<S>::run_by_body(const Kind& probes, TriangleTestStats& stats) {
  entered_.assign(sides_.size(), 0);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    auto search = probes.search(i);
    const auto boxes = search.box_test();
    for (std::uint32_t body = 0; body < sides_.size(); ++body) {
      if (!Kind::meets(scene_.primitives(body).kind) || sides_[body].hierarchy->empty()) continue;
      double near = 0;
      ++tests_;
      if (!boxes.meet(sides_[body].root_box(), search.limit(), near)) continue;
      if (std::exchange(entered_[body], 1) == 0) motion_.fetch_all(body);
      search_body(body, search, stats);
    }
    probes.take(i, search);
  }
}

template <class S>
void WideProbes<S>::run(const Probes<S>& probes, TriangleTestStats& stats, std::uint64_t& tests,
                        RayBodies* bodies) {
  work_.assign(sides_.size(), {});
  tests_ = 0;
  if (const auto* rays = std::get_if<RayProbes<S>>(&probes)) {
    run(*rays, stats);
    if (bodies != nullptr) count_bodies(rays->rays, *bodies);
  } else {
    run_by_body(std::get<BallProbes<S>>(probes), stats);
  }
  tests += tests_;
}

template <class S>
void WideProbes<S>::count_bodies(std::span<const Ray<S>> rays, RayBodies& bodies) const {
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    if (work_[ids_[i]].rays != 0) {
      ++bodies.entered;
      continue;
    }
    const Box<S> box = sides_[ids_[i]].root_box();
    const bool met = std::any_of(rays.begin(), rays.end(), [&](const Ray<S>& ray) {
      double near = 0;
      return RaySearch<S>(ray, RayQuery::any).box_test().meet(box, double(ray.length), near);
    });
    ++(met ? bodies.hidden : bodies.unmet);
  }
}

template <class S>
std::size_t WideProbes<S>::bytes() const {
  return bodies_.bytes() +
         (primitives_.offsets.capacity() + primitives_.vertices.capacity() + ids_.capacity()) *
             sizeof(std::uint32_t) +
         corners_.capacity() * sizeof(S) + sides_.capacity() * sizeof(WideProbeSide<S>) +
         work_.capacity() * sizeof(RayWork) +
         (body_stack_.capacity() + stack_.capacity()) * sizeof(WideRayItem<S>) +
         nodes_.capacity() * sizeof(std::uint32_t) + entered_.capacity();
}

template class WideProbes<float>;
template class WideProbes<double>;

}  // namespace kbvh
