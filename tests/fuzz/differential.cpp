// A small scene from the input, played by every strategy in float and double, each frame compared with the
// oracle. Inputs that reveal strategies' own errors are rarely this short: three keyframes and a dozen
// triangles suffice.

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "core/judge/verify.hpp"
#include "experiments/study/contestants.hpp"
#include "tests/fuzz/input_file.hpp"

namespace kbvh::fuzz {
namespace {

/// Takes numbers from the input; zeros when it is used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}
  bool empty() const { return left_ == 0; }
  std::uint32_t below(std::uint32_t n) {
    if (left_ == 0) return 0;
    --left_;
    return *data_++ % n;
  }
  /// Small integers and quarters, so that ties are the rule; sometimes any admissible float.
  float coordinate() {
    const std::uint32_t kind = below(16);
    if (kind > 0) return float(int(below(33)) - 16) / 4;
    std::uint32_t bits = 0;
    for (int i = 0; i < 4; ++i) bits = bits << 8 | below(256);
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value >= -1e29f && value <= 1e29f ? value + 0.0f : 1.0f;
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

struct Recipe {
  Scene<float> scene_float;
  Scene<double> scene_double;
  PlanScript<float> script_float;
  PlanScript<double> script_double;
  std::uint32_t per_keyframe = 1;
};

template <class S>
void add_body(Scene<S>& scene, const Primitives& primitives, std::uint32_t vertices,
              const std::vector<double>& times, const std::vector<float>& positions) {
  Body<S> body;
  body.name = "fuzz";
  body.primitives = primitives;
  body.plans = FlightPlans<S>(vertices, times, std::vector<S>(positions.begin(), positions.end()));
  scene.bodies.push_back(std::move(body));
}

Recipe recipe(Bytes& bytes) {
  Recipe made;
  made.per_keyframe = 1 + bytes.below(7);
  const std::uint32_t bodies = 2 + bytes.below(2);
  for (std::uint32_t b = 0; b < bodies; ++b) {
    const std::uint32_t vertices = 3 + bytes.below(18), triangles = bytes.below(13),
                        keyframes = 1 + bytes.below(4);
    Primitives primitives;
    for (std::uint32_t i = 0; i < triangles; ++i) {
      const std::uint32_t corners[3] = {bytes.below(vertices), bytes.below(vertices), bytes.below(vertices)};
      primitives.add(corners);
    }
    std::vector<double> times{0};
    for (std::uint32_t k = 1; k < keyframes; ++k)
      times.push_back(times.back() + (bytes.below(8) == 0 ? 1e-6 : 0.25 * (1 + bytes.below(4))));
    std::vector<float> positions;
    for (std::uint32_t i = 0; i < 3 * vertices * keyframes; ++i) positions.push_back(bytes.coordinate());
    add_body(made.scene_float, primitives, vertices, times, positions);
    add_body(made.scene_double, primitives, vertices, times, positions);
  }
  made.scene_float.pairs = all_pairs(made.scene_float.bodies);
  made.scene_double.pairs = all_pairs(made.scene_double.bodies);
  // A few plans change, at frames.
  const std::vector<double> frames = frame_times(made.scene_float, made.per_keyframe);
  const std::uint32_t steps = bytes.below(4);
  for (std::uint32_t i = 0, f = 0; i < steps; ++i) {
    f += bytes.below(3) + (i > 0 ? 1 : 0);
    if (f >= frames.size()) break;
    PlanScript<float>::Step step{.time = frames[f]};
    PlanScript<double>::Step step_double{.time = frames[f]};
    const std::uint32_t body = bytes.below(bodies),
                        vertex = bytes.below(made.scene_float.bodies[body].plans.vertex_count());
    PlanChange<float> change{.body = body, .vertex = vertex};
    PlanChange<double> change_double{.body = body, .vertex = vertex};
    for (int axis = 0; axis < 3; ++axis) {
      // Slow enough that no vertex leaves the admissible range within the clip.
      change.velocity[axis] = std::clamp(bytes.coordinate(), -1e20f, 1e20f);
      change_double.velocity[axis] = change.velocity[axis];
    }
    step.changes.push_back(change);
    step_double.changes.push_back(change_double);
    made.script_float.steps.push_back(step);
    made.script_double.steps.push_back(step_double);
  }
  return made;
}

template <class S>
void play(const Scene<S>& scene, const PlanScript<S>& script, std::uint32_t per_keyframe) {
  const std::vector<double> frames = frame_times(scene, per_keyframe);
  const PlanScript<S>* changes = script.empty() ? nullptr : &script;
  Oracle<S> oracle(scene, {}, hash(script)), unchanged(scene);
  for (const StrategyEntry& entry : registry()) {
    if (entry.info.guarantee == Guarantee::approximate) continue;
    if (!experiments::unsuitable(entry.info, scene, script, frames).empty()) continue;
    Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
    const auto expect = [&](const Verification& result, const char* when) {
      if (result.holds()) return;
      std::fprintf(stderr, "%s, %s%s: %s\n", entry.info.id.c_str(), sizeof(S) == 4 ? "float" : "double", when,
                   result.first_violation.c_str());
      std::abort();
    };
    expect(verify(session, std::span<const double>(frames), oracle, changes), "");
    // Plays it again from the start, without the changes made meanwhile.
    expect(verify(session, std::span<const double>(frames), unchanged), ", after a reset");
  }
}

}  // namespace
}  // namespace kbvh::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  kbvh::fuzz::Bytes bytes(data, size);
  const kbvh::fuzz::Recipe made = kbvh::fuzz::recipe(bytes);
  kbvh::fuzz::play(made.scene_float, made.script_float, made.per_keyframe);
  kbvh::fuzz::play(made.scene_double, made.script_double, made.per_keyframe);
  return 0;
}
