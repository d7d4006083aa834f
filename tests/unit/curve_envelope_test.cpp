// Envelopes of curves over a segment: at frames and between them every realiser is extremal in rational
// arithmetic, no change is superfluous, a missing change is found, and worst cases have as many pieces as
// Davenport-Schinzel sequences of their order allow.

#include "core/families/envelope/curve_envelope.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/topology/builders.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/rational_curves.hpp"
#include "tests/support/vertices_below.hpp"

namespace kbvh::test::curve_envelope_test {
namespace {

/// One body's hierarchy, and the vertices below each side.
template <class S>
struct Sides {
  WideHierarchy<S> hierarchy;
  std::vector<std::vector<std::uint32_t>> below;  ///< [slot]: places; empty for slots without a box

  Sides(const Body<S>& body, const BuilderConfig& builder) {
    hierarchy.assign(build_topology(body.primitives, body.plans.keyframe(0), builder), body.primitives,
                     active_kernel_set());
    const Topology& topology = hierarchy.topology();
    below.resize(hierarchy.node_count() * lane_scalars(topology.width));
    const auto vertices = vertices_below(hierarchy);
    for (std::uint32_t node = 0; node < topology.size(); ++node) {
      if (hierarchy.wide_parent(node) == WideHierarchy<S>::no_node) continue;
      for (std::uint32_t row = 0; row < 6; ++row)
        for (const std::uint32_t vertex : vertices[node])
          below[hierarchy.row_place(node, row)].push_back(3 * vertex + row % 3);
    }
  }
  bool is_lower(std::size_t slot) const {
    const std::size_t width = hierarchy.topology().width;
    return slot % lane_scalars(std::uint32_t(width)) < 3 * width;
  }
};

template <class S>
SegmentCurves<S> curves_in(const FlightPlans<S>& plans, std::size_t k) {
  return {plans.keyframe_times()[k],
          plans.keyframe_times()[k + 1],
          plans.keyframe(k),
          plans.keyframe(k + 1),
          plans.bends(k),
          plans.twists(k)};
}

/// Returns the rank of each place at t among those of the same axis.
template <class S>
std::vector<std::uint32_t> ranks_at(const SegmentCurves<S>& curves, std::size_t places, double t) {
  std::vector<std::uint32_t> result(places);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<Rational> values;
    for (std::size_t place = axis; place < places; place += 3)
      values.push_back(rational_value(curves.piece(std::uint32_t(place)), Rational(t)));
    const std::vector<std::uint32_t> rank = ranks(values);
    for (std::size_t i = 0; i < rank.size(); ++i) result[3 * i + axis] = rank[i];
  }
  return result;
}

/// Returns the number of sides whose realiser is not extremal.
template <class S>
std::uint64_t not_extremal(const Sides<S>& sides, const std::vector<std::uint32_t>& rank,
                           const WideRealisers& realisers) {
  std::uint64_t found = 0;
  for (std::size_t slot = 0; slot < sides.below.size(); ++slot) {
    const std::vector<std::uint32_t>& below = sides.below[slot];
    const bool lower = sides.is_lower(slot);
    found += std::any_of(below.begin(), below.end(), [&](std::uint32_t place) {
      const std::uint32_t realised = rank[realisers[slot]];
      return lower ? rank[place] < realised : rank[place] > realised;
    });
  }
  return found;
}

struct Findings {
  std::uint64_t stores = 0, not_extremal = 0, without_one_store = 0;
};

/// Plays the envelopes of all curved segments of a scene, and checks them at `instants` times in each. Then
/// applies all stores but the middle one again, by their exact times.
template <class S>
Findings play(const Scene<S>& scene, const BuilderConfig& builder, int instants) {
  Findings found;
  Random random(3);
  for (const Body<S>& body : scene.bodies) {
    const FlightPlans<S>& plans = body.plans;
    if (!plans.curved() || body.primitives.count() == 0) continue;
    Sides<S> sides(body, builder);
    const std::size_t places = std::size_t(3) * plans.vertex_count();
    CurveEnvelope<S> envelope;
    envelope.assign(sides.hierarchy);
    WideRealisers realisers;
    find_realisers(sides.hierarchy, plans.keyframe(0), realisers);
    for (std::size_t k = 0; k + 1 < plans.keyframe_count(); ++k) {
      if (!plans.curved_in(k)) {
        find_realisers(sides.hierarchy, plans.keyframe(k + 1), realisers);
        continue;
      }
      const SegmentCurves<S> curves = curves_in(plans, k);
      const WideRealisers at_begin = realisers;
      envelope.make(sides.hierarchy, realisers, curves);
      const auto& stores = envelope.stores();
      found.stores += stores.size();
      std::vector<double> times{curves.t0, curves.t1};
      for (int i = 0; i < instants; ++i)
        times.push_back(curves.t0 + (curves.t1 - curves.t0) * (0.5 + 0.5 * random.unit()));
      // Next to changes.
      for (std::size_t i = 0; i < stores.size(); i += 1 + stores.size() / 4)
        times.push_back(std::clamp(stores[i].time, curves.t0, curves.t1));
      std::sort(times.begin(), times.end());
      const std::size_t lost = stores.size() / 2;
      for (const double t : times) {
        envelope.advance(t, realisers);
        const std::vector<std::uint32_t> rank = ranks_at(curves, places, t);
        found.not_extremal += not_extremal(sides, rank, realisers);
        WideRealisers due = at_begin, without = at_begin;
        for (std::size_t i = 0; i < stores.size(); ++i) {
          const CurveMoment<S> moment{curves.piece(stores[i].realiser), curves.piece(stores[i].before),
                                      stores[i].root};
          if (compare_moment_to(moment, t) > 0) continue;
          due[stores[i].slot] = stores[i].realiser;
          if (i != lost) without[stores[i].slot] = stores[i].realiser;
        }
        EXPECT_TRUE(std::equal(due.begin(), due.end(), realisers.begin()))
            << "a store was not carried out at its time";
        found.without_one_store += not_extremal(sides, rank, without);
      }
      // A store begins where its predecessor ends, and its vertex is ahead right after it.
      WideRealisers present = at_begin;
      for (const auto& store : stores) {
        EXPECT_EQ(present[store.slot], store.before);
        present[store.slot] = store.realiser;
        const CurveMoment<S> moment{curves.piece(store.realiser), curves.piece(store.before), store.root};
        EXPECT_EQ(compare_at_moment(moment.first, moment.second, moment), 0);
        const int ahead = compare_after_moment(moment.first, moment.second, moment);
        EXPECT_EQ(ahead, sides.is_lower(store.slot) ? -1 : 1);
      }
    }
  }
  return found;
}

template <class S>
void check_scenes() {
  std::uint64_t stores = 0, without = 0;
  for (const std::string& name : curved_scene_names()) {
    const Scene<S> scene = curved_scene<S>(name).scene;
    for (const std::uint32_t width : {2u, 8u}) {
      const Findings found =
          play(scene, {.method = BuildMethod::median, .width = width, .leaf_size = width / 2}, 2);
      EXPECT_EQ(found.not_extremal, 0u) << name << ", width " << width;
      stores += found.stores;
      without += found.without_one_store;
    }
  }
  EXPECT_GT(stores, 500u);
  EXPECT_GT(without, 20u) << "missing stores are not found";
}

TEST(CurveEnvelope, RealisersAreExtremalAtAndBetweenFramesInFloat) {
  check_scenes<float>();
}
TEST(CurveEnvelope, RealisersAreExtremalAtAndBetweenFramesInDouble) {
  check_scenes<double>();
}

/// Returns the number of stores of the upper x side of one box around vertices on these curves.
std::size_t pieces_above(const std::vector<CurvedPiece<double>>& curves) {
  // Two leaves with the same vertices: the box of the root has no side of its own.
  const Body<double> body = net_of_curves(curves, 2);
  Sides<double> sides(body, {.method = BuildMethod::median, .width = 2, .leaf_size = 1});
  CurveEnvelope<double> envelope;
  envelope.assign(sides.hierarchy);
  WideRealisers realisers;
  find_realisers(sides.hierarchy, body.plans.keyframe(0), realisers);
  envelope.make(sides.hierarchy, realisers, curves_in(body.plans, 0));
  std::size_t slot = 0;
  while (sides.below[slot].empty() || sides.is_lower(slot) || sides.below[slot].front() % 3 != 0) ++slot;
  const auto& stores = envelope.stores();
  return 1 + std::size_t(std::count_if(stores.begin(), stores.end(),
                                       [&](const auto& store) { return store.slot == slot; }));
}

TEST(CurveEnvelope, ParabolasReachTheBoundOfOrderTwo) {
  for (const std::uint32_t n : {2u, 10u, 100u})
    EXPECT_EQ(pieces_above(line_and_parabolas(n)), 2 * n - 1) << n;
}

TEST(CurveEnvelope, TwoCubicsCrossThreeTimes) {
  // (s - 1/4) (s - 1/2) (s - 3/4) = s^3 - 3/2 s^2 + 11/16 s - 3/32, and zero.
  EXPECT_EQ(pieces_above({{}, {0, 1, -3.0 / 32, 3.0 / 32, 0.5, -1}}), 4u);
}

}  // namespace
}  // namespace kbvh::test::curve_envelope_test
