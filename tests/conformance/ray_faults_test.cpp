// The suite of rays can fail: a strategy in its simplest form, without a fault and with one seeded fault
// each.

#include <gtest/gtest.h>

#include "core/contract/registry.hpp"
#include "core/topology/probe_traversal.hpp"
#include "tests/conformance/ray_check.hpp"

namespace kbvh::test::ray_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  open_slabs,         // boxes are open sets: rays along their sides are dropped
  narrow_slabs,       // the slabs are rounded inwards
  closest_not_kept,   // the first hit stays, even if a closer one is found
  closest_not_exact,  // hits are compared by rounded parameters; the last of equal ones counts
  early_limit,        // anything beyond nine tenths of the closest hit is left out
  length_forgotten,   // rays have no end
  last_body_only,     // the search starts over with each body
  stale_boxes,        // boxes are those of the first frame
  one_triangle,       // only the first triangle of each polygon is tested
  untested,           // a primitive whose leaf is entered counts as any hit
  hidden_early,       // a body is hidden where its box begins beyond half of the closest hit
  hidden_unsorted,    // bodies in scene order: the first hidden one ends the search
  hidden_for_all,     // a body that the first ray does not enter is hidden from all rays
};

/// The slabs of a box without any slack, in the scene's scalar.
template <class S>
bool meets(const Ray<S>& ray, const Box<S>& box, double limit, Fault fault) {
  S first = 0, last = S(limit);
  for (int axis = 0; axis < 3; ++axis) {
    const S inverse = 1 / ray.direction[axis];
    S enter = (box.lower[axis] - ray.origin[axis]) * inverse;
    S leave = (box.upper[axis] - ray.origin[axis]) * inverse;
    if (inverse < 0) std::swap(enter, leave);
    if (fault == Fault::narrow_slabs) {
      enter *= enter > 0 ? S(1.0001) : S(0.9999);
      leave *= leave > 0 ? S(0.9999) : S(1.0001);
    }
    first = enter > first ? enter : first;
    last = leave < last ? leave : last;
    if (fault == Fault::open_slabs && !(enter < leave)) return false;
  }
  return fault == Fault::open_slabs ? first < last : first <= last;
}

template <class S, Fault fault>
class Simple : public CountedStrategy<S>,
               public AnswersRays<S>,
               public AnswersSelfPairs,
               public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  Simple(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params&)
      : CountedStrategy<S>(scene, motion), topologies_(std::move(topologies)) {}
  std::size_t bytes() const override { return 0; }

 protected:
  void reset_to(double) override { refit(); }
  void advance_to(double) override {
    if (fault != Fault::stale_boxes) refit();
  }
  void follow_plans(double, std::span<const PlanChange<S>>) override {}
  QueryStatus find_candidates(double, PairBuffer&, const Budget&) override { return {}; }

  void find_hits(double, const RayProbes<S>& asked) override {
    for (std::size_t i = 0; i < asked.size(); ++i) {
      Ray<S> ray = asked.rays[i];
      if (fault == Fault::length_forgotten) ray.length = std::numeric_limits<S>::infinity();
      asked.hits[i] = {};
      find_hit(ray, asked.query, asked.hits[i]);
      if (i == 0) first_entered_ = entered_;
    }
  }

 private:
  void find_hit(const Ray<S>& ray, RayQuery query, RayHit& hit) {
    const auto limit = [&] {
      if (query == RayQuery::any && hit) return -1.0;
      return limit_of(ray, hit) * (hit && fault == Fault::hidden_early ? 0.5 : 1);
    };
    entered_.assign(topologies_.size(), false);
    const auto enter = [&](std::uint32_t body, bool = false) {
      entered_[body] = true;
      if (fault == Fault::hidden_for_all && !first_entered_.empty() && !first_entered_[body]) return false;
      if (fault == Fault::last_body_only) hit = {};
      follow(ray, query, body, 0, hit);
      return false;
    };
    const auto box_of = [&](std::uint32_t body) {
      return topologies_[body].empty() ? Box<S>{} : boxes_[body][0];
    };
    if (fault == Fault::hidden_unsorted) {
      for (std::uint32_t body = 0; body < topologies_.size(); ++body) {
        double near = 0;
        if (this->scene_.primitives(body).kind != PrimitiveKind::polygons || topologies_[body].empty())
          continue;
        if (RaySlabs(line_of(ray)).meet(box_of(body), std::numeric_limits<double>::infinity(), near) &&
            !RaySlabs::within(near, limit()))
          return;
        enter(body);
      }
      return;
    }
    // Uses the bodies' boxes from the time when they were made.
    order_.start(this->scene_, &RayProbes<S>::meets, box_of);
    using Reach = decltype(limit);
    struct Search {
      RaySlabs boxes;
      Reach reach;
      RaySlabs box_test() const { return boxes; }
      double limit() const { return reach(); }
    };
    order_.follow(Search{RaySlabs(line_of(ray)), limit}, enter);
  }

  static RayLine line_of(const Ray<S>& ray) {
    RayLine line{};
    for (int axis = 0; axis < 3; ++axis) {
      line.origin[axis] = double(ray.origin[axis]);
      line.direction[axis] = double(ray.direction[axis]);
    }
    return line;
  }
  static double limit_of(const Ray<S>& ray, const RayHit& hit) {
    return hit ? hit.parameter * (fault == Fault::early_limit ? 0.9 : 1.000001) + 1e-30 : double(ray.length);
  }

  void refit() {
    boxes_.resize(topologies_.size());
    for (std::uint32_t body = 0; body < topologies_.size(); ++body) {
      const Topology& topology = topologies_[body];
      boxes_[body].assign(topology.size(), {});
      for (std::uint32_t node = topology.size(); node-- > 0;) {
        const TopologyNode content = topology.nodes[node];
        for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
          boxes_[body][node].extend(content.is_leaf()
                                        ? primitive_box(this->scene_.primitives(body)[topology.primitives[k]],
                                                        this->sampled_.positions(body))
                                        : boxes_[body][k]);
      }
    }
  }

  void follow(const Ray<S>& ray, RayQuery query, std::uint32_t body, std::uint32_t node, RayHit& hit) {
    if (query == RayQuery::any && hit) return;
    const double limit = limit_of(ray, hit);
    const bool own = fault == Fault::open_slabs || fault == Fault::narrow_slabs;
    double near = 0;
    if (!(own ? meets(ray, boxes_[body][node], limit, fault)
              : RaySlabs(line_of(ray)).meet(boxes_[body][node], limit, near)))
      return;
    const Topology& topology = topologies_[body];
    const TopologyNode content = topology.nodes[node];
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
      if (content.is_leaf())
        decide(ray, query, body, topology.primitives[k], hit);
      else
        follow(ray, query, body, k, hit);
  }

  void decide(const Ray<S>& ray, RayQuery query, std::uint32_t body, std::uint32_t primitive, RayHit& hit) {
    if (fault == Fault::untested && query == RayQuery::any) {
      hit = {body, primitive, 0};
      return;
    }
    // Tests both again, so that RaySearch does the exact comparison.
    TriangleTestStats stats;
    RaySearch<S> search(ray, RayQuery::closest);
    const auto offer = [&](std::uint32_t b, std::uint32_t p) {
      PolygonTriangles polygon = this->scene_.primitives(b).triangles(p);
      if (fault == Fault::one_triangle) polygon = polygon.first();
      search.offer(b, p, polygon, this->sampled_.positions(b), stats);
    };
    offer(body, primitive);
    if (!search.hit()) return;
    if (hit && fault == Fault::closest_not_kept) return;
    if (hit && fault == Fault::closest_not_exact) {
      if (search.hit().parameter <= hit.parameter) hit = search.hit();
      return;
    }
    if (hit) offer(hit.body, hit.primitive);
    hit = search.hit();
  }

  Topologies topologies_;
  std::vector<std::vector<Box<S>>> boxes_;
  BodyOrder order_;
  std::vector<bool> entered_, first_entered_;  ///< [body], by the current ray and by the first one
};

template <Fault fault>
struct With {
  template <class S>
  using Strategy = Simple<S, fault>;
};

/// Returns the first violation on some scenes, in float and double.
template <Fault fault>
std::string first_violation() {
  Info info;
  info.id = "simple";
  info.guarantee = Guarantee::approximate;  // of pairs, which it does not find
  const StrategyEntry entry = make_entry<With<fault>::template Strategy>(info);
  const BuilderConfig builder{.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  std::uint64_t hits = 0;
  for (const char* name : {"soups", "polygons", "sheets", "integer_ties"}) {
    const auto in_float = synthetic_scene<float>(name);
    Truth<float> truth;
    if (std::string found = rays_violation(entry, in_float, builder, {}, truth, hits); !found.empty())
      return found;
    const auto in_double = synthetic_scene<double>(name);
    Truth<double> truth_in_double;
    if (std::string found = rays_violation(entry, in_double, builder, {}, truth_in_double, hits);
        !found.empty())
      return found;
  }
  EXPECT_GT(hits, 200U);
  return {};
}

TEST(RayFaults, ASoundStrategyPasses) {
  EXPECT_EQ(first_violation<Fault::none>(), "");
}

TEST(RayFaults, EverySeededFaultIsCaught) {
  EXPECT_NE(first_violation<Fault::open_slabs>(), "");
  EXPECT_NE(first_violation<Fault::narrow_slabs>(), "");
  EXPECT_NE(first_violation<Fault::closest_not_kept>(), "");
  EXPECT_NE(first_violation<Fault::closest_not_exact>(), "");
  EXPECT_NE(first_violation<Fault::early_limit>(), "");
  EXPECT_NE(first_violation<Fault::length_forgotten>(), "");
  EXPECT_NE(first_violation<Fault::last_body_only>(), "");
  EXPECT_NE(first_violation<Fault::stale_boxes>(), "");
  EXPECT_NE(first_violation<Fault::one_triangle>(), "");
  EXPECT_NE(first_violation<Fault::untested>(), "");
}

TEST(RayFaults, EveryWrongTestOfHiddenBodiesIsCaught) {
  EXPECT_NE(first_violation<Fault::hidden_early>(), "");
  EXPECT_NE(first_violation<Fault::hidden_unsorted>(), "");
  EXPECT_NE(first_violation<Fault::hidden_for_all>(), "");
}

}  // namespace
}  // namespace kbvh::test::ray_faults_test
