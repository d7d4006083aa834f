// The stores of segment envelopes against independently computed exact envelopes (claims T1, T8): over whole
// clips, on every synthetic scene without changes, entry by entry.
#include "core/families/envelope/segment_envelope.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/topology/builders.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::segment_envelope_test {
namespace {

using namespace kbvh::theory;

/// Records the envelopes of a body over its whole clip in the form that the checker needs.
template <class S>
struct Log {
  VerticesBelow below;
  std::vector<std::uint32_t> start, end;
  std::vector<BoundChange> changes;
};

template <class S>
std::vector<std::uint32_t> by_side(const WideHierarchy<S>& hierarchy, const WideRealisers& realisers) {
  std::vector<std::uint32_t> list(std::size_t(6) * hierarchy.topology().size(), no_bound);
  for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node)
    for (std::uint32_t row = 0; row < 6; ++row)
      if (hierarchy.wide_parent(node) != WideHierarchy<S>::no_node)
        list[6 * std::size_t(node) + 2 * (row % 3) + row / 3] = realisers[hierarchy.row_place(node, row)] / 3;
  return list;
}

template <class S>
Log<S> log_of(const Body<S>& body, const ExactMotion& motion, const BuilderConfig& builder) {
  WideHierarchy<S> hierarchy;
  hierarchy.assign(build_topology(body.primitives, body.plans.keyframe(0), builder), body.primitives,
                   active_kernel_set());
  const Topology& topology = hierarchy.topology();
  Log<S> log;
  log.below = vertices_below(topology, body.primitives);
  std::vector<std::uint32_t> node_of(hierarchy.node_count() * lane_scalars(topology.width), 0);
  for (std::uint32_t node = 0; node < topology.size(); ++node) {
    if (hierarchy.wide_parent(node) == WideHierarchy<S>::no_node) continue;
    for (std::uint32_t row = 0; row < 6; ++row) node_of[hierarchy.row_place(node, row)] = node;
  }
  WideRealisers realisers;
  SegmentEnvelope<S> envelope;
  envelope.assign(hierarchy);
  find_realisers(hierarchy, body.plans.keyframe(0), realisers);
  log.start = by_side(hierarchy, realisers);
  const auto times = body.plans.keyframe_times();
  for (std::size_t k = 0; k + 1 < times.size(); ++k) {
    envelope.make(hierarchy, realisers, body.plans.keyframe(k), body.plans.keyframe(k + 1), times[k],
                  times[k + 1]);
    WideRealisers present = realisers;
    const std::size_t first = log.changes.size();
    for (const auto& store : envelope.stores()) {
      const std::uint32_t row = std::uint32_t(store.slot % lane_scalars(topology.width)) / topology.width;
      const std::uint32_t before = present[store.slot] / 3, after = store.realiser / 3, axis = row % 3;
      log.changes.push_back({node_of[store.slot], 2 * axis + row / 3, before, after,
                             motion.meeting(k, int(axis), before, after)});
      present[store.slot] = store.realiser;
    }
    std::stable_sort(log.changes.begin() + std::ptrdiff_t(first), log.changes.end(),
                     [](const BoundChange& a, const BoundChange& b) { return a.when < b.when; });
    // Half of it by a frame within the segment: the rest is due at its end.
    envelope.advance(times[k] + 0.4 * (times[k + 1] - times[k]), realisers);
    envelope.advance(times[k + 1], realisers);
    EXPECT_EQ(realisers, present) << "the stores were not all carried out";
  }
  log.end = by_side(hierarchy, realisers);
  return log;
}

class SegmentEnvelopes : public testing::TestWithParam<std::string> {};

template <class S>
void prove(const std::string& name) {
  EnvelopeReport total;
  const auto test = synthetic_scene<S>(name);
  for (const Body<S>& body : test.scene.bodies) {
    if (!body.plans.moving() || body.primitives.count() == 0) continue;
    const auto times = body.plans.keyframe_times();
    const ExactMotion motion(stored_plans(body.plans), times.front(), times.back());
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf_size : {1u, 4u, 16u}) {
        SCOPED_TRACE(name + " width " + std::to_string(width) + " leaf size " + std::to_string(leaf_size));
        Log<S> log = log_of(body, motion, {.width = width, .leaf_size = leaf_size});
        const EnvelopeReport report = check_envelopes(motion, log.below, log.start, log.changes, log.end);
        EXPECT_EQ(report.violation, "");
        EXPECT_EQ(report.net, report.envelope);
        total.add(report);
        if (log.changes.empty()) continue;
        log.changes.erase(log.changes.begin() + std::ptrdiff_t(log.changes.size() / 2));
        EXPECT_FALSE(check_envelopes(motion, log.below, log.start, log.changes, log.end).holds())
            << "a missing store is not noticed";
      }
  }
  std::printf("%s %s: %llu bounds, %llu stores, %llu net changes = %llu breakpoints\n", name.c_str(),
              sizeof(S) == 4 ? "float" : "double", (unsigned long long)total.bounds,
              (unsigned long long)total.logged, (unsigned long long)total.net,
              (unsigned long long)total.envelope);
}

TEST_P(SegmentEnvelopes, AreTheExactOnesInFloat) {
  prove<float>(GetParam());
}
TEST_P(SegmentEnvelopes, AreTheExactOnesInDouble) {
  prove<double>(GetParam());
}

std::vector<std::string> scenes_without_changes() {
  std::vector<std::string> names;
  for (const std::string& name : synthetic_scene_names())
    if (synthetic_scene<float>(name).script.empty()) names.push_back(name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Scenes, SegmentEnvelopes, testing::ValuesIn(scenes_without_changes()),
                         [](const auto& param_info) { return param_info.param; });

}  // namespace
}  // namespace kbvh::test::segment_envelope_test
