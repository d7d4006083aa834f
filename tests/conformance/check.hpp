#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <list>

#include "core/contract/registry.hpp"
#include "core/judge/verify.hpp"
#include "core/scene/self_pairs.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Returns whether scenes are played in float and in double; KBVH_ONE_SCALAR=1 has most played in one of
/// them.
inline bool in_both_scalars() {
  return std::getenv("KBVH_ONE_SCALAR") == nullptr;
}

/// Returns why the contestant does not take part in a scene (scalar, capability, size): "skipped: ..."; or an
/// empty text.
template <class S>
std::string skipped(const StrategyEntry& entry, const TestScene<S>& test) {
  if (entry.factory<S>() == nullptr) return "skipped: no such scalar";
  if (test.script.changes_plans() && !entry.info.can.plan_changes) return "skipped: plans cannot change";
  if (test.script.changes_geometry() && !entry.info.can.geometry_changes)
    return "skipped: geometry cannot change";
  if (has_self_pairs(test.scene.pairs) && !entry.info.can.self_pairs) return "skipped: no self pairs";
  if (entry.info.max_primitive_pairs != 0)
    for (const BodyPair& pair : test.scene.pairs)
      if (std::uint64_t(test.scene.bodies[pair.first].primitives.count()) *
              test.scene.bodies[pair.second].primitives.count() >
          entry.info.max_primitive_pairs)
        return "skipped: too large for it";
  for (const auto& body : test.scene.bodies)
    if (body.plans.curved() && !entry.info.can.curves) return "skipped: foresees linear motion only";
  const bool within = unsuitable_bodies(entry.info, test.scene).empty() &&
                      out_of_range(entry.info, test.scene, test.script, test.frames).empty();
  if (std::isfinite(entry.info.max_coordinate) && !within) return "skipped: beyond its range of coordinates";
  if (entry.info.topology.own && !entry.info.own_scalar.empty())
    for (const auto& body : test.scene.bodies)
      if (body.primitives.kind != PrimitiveKind::polygons) return "skipped: a peer that knows polygons only";
  return {};
}

/// The truth of a scene, found once for all contestants that play it one after the other.
template <class S>
Oracle<S>& shared_oracle(const TestScene<S>& test) {
  struct Known {
    explicit Known(const TestScene<S>& of)
        : scene(of.scene), oracle(scene, {}, of.script.steps.empty() ? 0 : hash(of.script)) {}
    Scene<S> scene;
    Oracle<S> oracle;
  };
  constexpr std::size_t most = 8;  // pairs of thousands of frames take memory
  static std::list<std::pair<std::uint64_t, Known>> known;
  const std::uint64_t key = hash(test.scene);
  for (auto& [scene, truth] : known)
    if (scene == key && truth.oracle.script() == (test.script.steps.empty() ? 0 : hash(test.script)))
      return truth.oracle;
  if (known.size() == most) known.pop_front();
  return known.emplace_back(std::piecewise_construct, std::forward_as_tuple(key), std::forward_as_tuple(test))
      .second.oracle;
}

/// Runs one contestant over one scene. Returns the first violation, an empty text, or the reason for not
/// taking part (`skipped`).
template <class S>
std::string check(const StrategyEntry& entry, const TestScene<S>& test, std::uint32_t frames_per_keyframe,
                  const std::map<std::string, std::string>& params, const BuilderConfig& builder,
                  const VerifyOptions& options = {.areas = Areas::left_out}) {
  if (const std::string why = skipped(entry, test); !why.empty()) return why;
  const std::vector<double> frames =
      test.frames.empty() ? frame_times(test.scene, frames_per_keyframe) : test.frames;
  Session<S> session(test.scene, {&entry, params, builder});
  const Verification result = verify(session, std::span<const double>(frames), shared_oracle(test),
                                     test.script.steps.empty() ? nullptr : &test.script, options);
  if (!result.holds()) return result.first_violation;
  if (result.audited && entry.info.guarantee != Guarantee::approximate && result.audit.protrusion != 0)
    return "protrusion " + std::to_string(result.audit.protrusion);
  return {};
}

/// Requires that, after a reset, a strategy that changes its topology during the clip has its first topology
/// and answers again.
inline void expect_reset_restores_topology(const StrategyEntry& entry) {
  const auto test = synthetic_scene<float>("sheets", 3);
  Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes times;
  session.reset(test.frames[0]);
  const Topology start = session.strategy().audit_view(0)->topology;
  for (const double t : test.frames) session.advance(t, times);
  EXPECT_FALSE(session.strategy().audit_view(0)->topology == start);
  session.reset(test.frames[0]);
  EXPECT_TRUE(session.strategy().audit_view(0)->topology == start);
  PairBuffer pairs;
  session.query(pairs, times);
  std::sort(pairs.begin(), pairs.end());
  Playback<float> playback(test.scene);
  playback.seek(test.frames[0]);
  EXPECT_EQ(pairs, brute_force_pairs(test.scene, playback));
}

}  // namespace kbvh::test
