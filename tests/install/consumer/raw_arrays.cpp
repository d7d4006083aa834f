// Uses the installed library without a scene file or the program: links kbvh::all, looks up a strategy in the
// registry, and plays a scene made of plain arrays, frame by frame.

#include <cstdio>
#include <utility>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/judge/session.hpp"

int main() {
  // A triangle falls through another one: three keyframes, at 0, 1 and 2 s.
  kbvh::Scene<float> scene;
  for (const float height : {0.0F, 1.0F}) {
    kbvh::Body<float> body;
    body.name = height == 0 ? "table" : "leaf";
    const std::uint32_t corners[] = {0, 1, 2};
    body.primitives.add(corners);
    std::vector<float> positions;  // [keyframe][vertex][3]
    for (const int keyframe : {0, 1, 2}) {
      const float z = height * float(1 - keyframe);
      for (const float number : {0.0F, 0.0F, z, 1.0F, 0.0F, z, 0.0F, 1.0F, z}) positions.push_back(number);
    }
    body.plans = kbvh::FlightPlans<float>(3, {0, 1, 2}, std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = kbvh::all_pairs(scene.bodies);
  kbvh::validate(scene);

  std::printf("%zu strategies\n", kbvh::registry().size());
  const kbvh::StrategyEntry& entry = kbvh::find_strategy("bottom_up");
  kbvh::Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
  kbvh::PhaseTimes times;
  kbvh::PairBuffer pairs;
  session.reset(0);
  for (const double t : {0.5, 1.0, 1.5}) {
    session.advance(t, times);
    session.query(pairs, times);
    std::printf("t = %g: %zu pairs\n", t, pairs.size());
  }
}
