// Joins with slabs lose no pair of triangles that share a point at a frame of the segment, for any leaf size
// and set of kernels; slabs of an earlier segment, or of another leaf, lose some.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/play.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/unit/slab_scenes.hpp"

namespace kbvh::test::slab_spans_test {
namespace {

/// A scene whose segments are joined with slabs and without.
template <class S>
struct Joined {
  Joined(const Scene<S>& of, const BuilderConfig& builder, KernelSet set)
      : scene(of),
        view(scene),
        playback(scene),
        motion(playback),
        bounds(view, motion, topologies(builder), set, {}) {
    by_slabs.use_slabs();
  }
  Topologies topologies(const BuilderConfig& builder) {
    playback.evaluate_all();
    Topologies result;
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
      result.push_back(build_topology(view.primitives(body), playback.positions(body), builder));
    return result;
  }
  /// Joins the segment after the time; the next frame has to lie in it.
  void seek(double t) {
    playback.seek(t);
    playback.evaluate_all();
    if (started)
      bounds.advance();
    else
      bounds.start();
    started = true;
  }
  void join() {
    by_boxes.join(bounds.segment(), view, view.pairs());
    by_slabs.join(bounds.segment(), view, view.pairs());
  }
  PairBuffer pairs_at(IntervalJoin<S>& join, double t) {
    PairBuffer pairs;
    join.read(float(bounds.fraction(t)), pairs);
    TriangleTestStats stats;
    confirm_pairs(view, motion, pairs, stats);
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  }

  Scene<S> scene;
  SceneView<S> view;
  Playback<S> playback;
  SegmentMotion<S> motion;
  LinearBounds<S> bounds;
  IntervalJoin<S> by_boxes, by_slabs;
  bool started = false;
};

enum class Fault : std::uint8_t { none, of_the_segment_before, of_another_leaf };

/// Plays a scene and returns the pairs that joins with slabs have lost, and the shares of pairs that remain.
struct Played {
  std::size_t lost = 0, hits = 0, joined = 0, left = 0;
};
template <class S>
Played played(const Scene<S>& scene, const BuilderConfig& builder, KernelSet set, Fault fault) {
  Played sum;
  Joined<S> joined(scene, builder, set);
  double end = -1e300;
  for (const double t : frame_times(scene, 5)) {
    joined.seek(t);
    if (joined.bounds.end() != end) {
      end = joined.bounds.end();
      if (fault == Fault::of_the_segment_before && sum.joined != 0)
        for (const BodySegmentBounds<S>& side : joined.bounds.segment().sides) {
          side.body->slab_ends[0] = side.at[0].made;
          side.body->slab_ends[1] = side.at[1].made;
        }
      joined.join();
      if (fault == Fault::of_another_leaf) {
        auto& slabs = joined.bounds.segment().sides[0].body->slabs;
        if (!slabs.empty()) std::rotate(slabs.begin(), slabs.begin() + 1, slabs.end());
        joined.join();
      }
      sum.joined += joined.by_boxes.pairs().size();
      sum.left += joined.by_slabs.pairs().size();
    }
    const PairBuffer truth = joined.pairs_at(joined.by_boxes, t);
    sum.hits += truth.size();
    sum.lost += truth.size() - joined.pairs_at(joined.by_slabs, t).size();
  }
  return sum;
}

template <class S>
bool can_play(const std::string& name) {
  const auto test = synthetic_scene<S>(name, 5);
  return test.script.steps.empty() &&
         std::all_of(test.scene.bodies.begin(), test.scene.bodies.end(),
                     [](const Body<S>& body) { return all_triangles(body.primitives); });
}

template <class S>
class SlabSpansTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SlabSpansTest, Scalars);

TYPED_TEST(SlabSpansTest, LosesNoContact) {
  using S = TypeParam;
  Played sum;
  std::vector<std::string> names = synthetic_scene_names();
  names.insert(names.end(), self_scene_names().begin(), self_scene_names().end());
  for (const std::string& name : names) {
    if (!can_play<S>(name)) continue;
    for (const std::uint32_t leaf : {1U, 5U, 16U}) {
      std::size_t of_first_set = 0;
      for (const KernelSet set : {KernelSet::portable, active_kernel_set()}) {
        const Played one =
            played<S>(synthetic_scene<S>(name, 5).scene,
                      {.method = BuildMethod::median, .width = leaf == 5 ? 4U : 8U, .leaf_size = leaf}, set,
                      Fault::none);
        EXPECT_EQ(one.lost, 0U) << name << ", leaves of " << leaf;
        if (set == KernelSet::portable) of_first_set = one.left;
        EXPECT_EQ(one.left, of_first_set) << name << ", leaves of " << leaf;
        sum.hits += one.hits;
        sum.joined += one.joined;
        sum.left += one.left;
      }
    }
  }
  EXPECT_GT(sum.hits, 1000U);
  EXPECT_LT(sum.left, sum.joined);
}

TYPED_TEST(SlabSpansTest, StaleSlabsAndThoseOfOtherLeavesLosePairs) {
  using S = TypeParam;
  const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = 8};
  const KernelSet set = active_kernel_set();
  EXPECT_EQ((played<S>(crossing_waves<S>(), builder, set, Fault::none).lost), 0U);
  EXPECT_GT((played<S>(crossing_waves<S>(), builder, set, Fault::of_the_segment_before).lost), 0U);
  EXPECT_GT((played<S>(crossing_waves<S>(), builder, set, Fault::of_another_leaf).lost), 0U);
}

}  // namespace
}  // namespace kbvh::test::slab_spans_test
