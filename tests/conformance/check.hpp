#pragma once
#include "core/judge/verify.hpp"
#include "core/scene/self_pairs.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Runs one contestant over one scene and returns the first violation, or an empty text. "skipped: ..." says
/// that the contestant does not take part (scalar, capability, size) and why.
template <class S>
std::string check(const StrategyEntry& entry, const TestScene<S>& test, std::uint32_t frames_per_keyframe,
                  const std::map<std::string, std::string>& params, const BuilderConfig& builder,
                  const VerifyOptions& options = {}) {
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
  if (entry.info.topology.own && !entry.info.own_scalar.empty())
    for (const auto& body : test.scene.bodies)
      if (body.primitives.kind != PrimitiveKind::polygons) return "skipped: a peer that knows polygons only";
  const std::vector<double> frames =
      test.frames.empty() ? frame_times(test.scene, frames_per_keyframe) : test.frames;
  Session<S> session(test.scene, {&entry, params, builder}, CountingPolicy::counting);
  Oracle<S> oracle(test.scene);
  const Verification result = verify(session, std::span<const double>(frames), oracle,
                                     test.script.steps.empty() ? nullptr : &test.script, options);
  if (!result.holds()) return result.first_violation;
  if (result.audited && entry.info.guarantee != Guarantee::approximate && result.audit.protrusion != 0)
    return "protrusion " + std::to_string(result.audit.protrusion);
  return {};
}

}  // namespace kbvh::test
