#include "core/families/wide/wide_rays.hpp"

#include <algorithm>

#include "core/topology/builders.hpp"

namespace kbvh {

namespace {

/// The tree over bodies is rebuilt when its boxes have grown by this factor.
constexpr double bodies_worn_out = 1.5;

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
    return all_.scene.primitives(body).kind == PrimitiveKind::polygons &&
           !all_.sides[body].hierarchy->empty();
  };
  // Bodies may become empty, or get their first primitive.
  std::size_t next = 0;
  bool same = true;
  for (std::uint32_t body = 0; body < all_.sides.size(); ++body)
    if (has_polygons(body)) same = same && next < all_.ids.size() && all_.ids[next++] == body;
  same = same && next == all_.ids.size();
  if (!same) {
    all_.ids.clear();
    for (std::uint32_t body = 0; body < all_.sides.size(); ++body)
      if (has_polygons(body)) all_.ids.push_back(body);
    corners_.assign(6 * all_.ids.size() + 1, S(0));
    built_area_ = -1;
  }
  for (std::size_t i = 0; i < all_.ids.size(); ++i) {
    const Box<S> box = all_.sides[all_.ids[i]].root_box();
    std::copy_n(box.lower, 3, corners_.data() + 6 * i);
    std::copy_n(box.upper, 3, corners_.data() + 6 * i + 3);
  }
  if (built_area_ < 0) build_bodies();
  if (all_.ids.empty()) return;
  bodies_.refit(corners_.data());
  if (all_.ids.size() <= 8) {  // one node, whatever its children
    built_area_ = 0;
    return;
  }
  const double area = summed_area(bodies_);
  if (built_area_ < 0) built_area_ = area;
  if (area <= bodies_worn_out * built_area_) return;
  build_bodies();
  bodies_.refit(corners_.data());
  built_area_ = summed_area(bodies_);
}

template <class S>
void WideRays<S>::build_bodies() {
  const std::size_t count = all_.ids.size();
  if (!has_tree_ || items_.size() != count) {
    primitives_ = {};
    for (std::uint32_t i = 0; i < count; ++i) primitives_.add(std::vector<std::uint32_t>{2 * i, 2 * i + 1});
    bodies_.assign(build_topology(primitives_, corners_.data(),
                                  {.method = BuildMethod::median, .width = 8, .leaf_size = 1}),
                   primitives_, active_kernel_set());
    items_.resize(count);
    // The first exchange of primitives between leaves allocates; all are exchanged now.
    order_.assign(bodies_.topology().primitives.rbegin(), bodies_.topology().primitives.rend());
    bodies_.refill(order_, primitives_);
    has_tree_ = true;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const S* const corners = corners_.data() + std::size_t(6) * i;
    Box<S> box;
    std::copy_n(corners, 3, box.lower);
    std::copy_n(corners + 3, 3, box.upper);
    items_[i] = build_item(box, i);
  }
  sort_by_medians(bodies_.topology(), items_);
  for (std::size_t i = 0; i < count; ++i) order_[i] = items_[i].primitive;
  bodies_.refill(order_, primitives_);
}

template <class S>
bool WideRays<S>::can_be_shared() const {
  if (!all_.motion.workers().several()) return false;
  return std::all_of(all_.ids.begin(), all_.ids.end(), [this](std::uint32_t body) {
    return all_.sides[body].stale == nullptr && all_.motion.all_current(body);
  });
}

template <class S>
void WideRays<S>::answer(const RayProbes<S>& asked, std::span<const WideProbeSide<S>> sides,
                         const WideBoxMaker& make, std::span<RayWork> work, TriangleTestStats& stats,
                         std::uint64_t& tests) {
  all_.sides = sides;
  all_.make = make;
  all_.tree = &bodies_;
  work_ = work;
  refit_bodies();
  const Parts cut{asked.size(), rays_at_once};
  std::size_t runners = 1;
  if (cut.parts() > 1 && can_be_shared()) {
    Workers& workers = all_.motion.workers();
    runners = workers.threads();
    if (runners_.size() < runners) runners_.resize(runners);
    workers.for_each(
        runners, [&](std::size_t i, std::uint32_t) { runners_[i].prepare(all_, asked.size() / runners); });
    workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t runner) {
      runners_[runner].answer(asked, cut.begin(part), cut.end(part));
    });
    for (std::size_t i = 0; i < runners; ++i)
      for (std::size_t k = 0; k < runners; ++k) runners_[i].deepen(runners_[k].depths());
  } else {
    if (runners_.empty()) runners_.resize(1);
    runners_[0].prepare(all_, asked.size());
    runners_[0].answer(asked, 0, asked.size());
  }
  for (std::size_t i = 0; i < runners; ++i) {
    const WideRayRunner<S>& runner = runners_[i];
    tests += runner.tests_of_bodies();
    for (const std::uint32_t body : all_.ids) {
      const RayWork own = runner.work(body);
      work_[body].tests += own.tests;
      work_[body].rays += own.rays;
      tests += own.tests;
    }
    stats.tests += runner.stats().tests;
    stats.filtered += runner.stats().filtered;
    stats.exact += runner.stats().exact;
    stats.ray_decisions += runner.stats().ray_decisions;
  }
}

template <class S>
void WideRays<S>::count_bodies(std::span<const Ray<S>> rays, RayBodies& bodies) const {
  for (const std::uint32_t body : all_.ids) {
    if (work_[body].rays != 0) {
      ++bodies.entered;
      continue;
    }
    const Box<S> box = all_.sides[body].root_box();
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
                      (primitives_.offsets.capacity() + primitives_.vertices.capacity() +
                       all_.ids.capacity() + order_.capacity()) *
                          sizeof(std::uint32_t) +
                      corners_.capacity() * sizeof(S) + items_.capacity() * sizeof(BuildItem);
  for (const WideRayRunner<S>& runner : runners_) total += runner.bytes();
  return total;
}

template class WideRays<float>;
template class WideRays<double>;

}  // namespace kbvh
