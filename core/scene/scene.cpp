#include "core/scene/scene.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/base/hasher.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

const char* name(PrimitiveKind kind) {
  switch (kind) {
    case PrimitiveKind::points:
      return "points";
    case PrimitiveKind::control_nets:
      return "control_nets";
    case PrimitiveKind::polygons:
      break;
  }
  return "polygons";
}

template <class S>
void validate(const Scene<S>& scene) {
  for (const auto& body : scene.bodies) {
    const std::string where = "body '" + body.name + "': ";
    const Primitives& primitives = body.primitives;
    if (primitives.offsets.empty() || primitives.offsets.front() != 0 ||
        primitives.offsets.back() != primitives.vertices.size())
      throw std::invalid_argument(where + "primitive offsets do not span the vertex list");
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      if (primitives.offsets[p + 1] <= primitives.offsets[p])
        throw std::invalid_argument(where + "primitive " + std::to_string(p) + " has no vertex");
      if (primitives[p].size() > most_corners)
        throw std::invalid_argument(where + "primitive " + std::to_string(p) + " has " +
                                    std::to_string(primitives[p].size()) + " corners; at most " +
                                    std::to_string(most_corners) + " are possible");
      for (std::uint32_t v : primitives[p])
        if (v >= body.plans.vertex_count())
          throw std::invalid_argument(where + "primitive " + std::to_string(p) + " refers to vertex " +
                                      std::to_string(v) + ", but there are " +
                                      std::to_string(body.plans.vertex_count()));
    }
  }
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
    const std::uint32_t first = scene.first_of_set(body);
    const FlightPlans<S>&plans = scene.bodies[body].plans, &of_set = scene.bodies[first].plans;
    if (plans.keyframe_times().data() != of_set.keyframe_times().data() ||
        plans.vertex_count() != of_set.vertex_count() || plans.is_handed_in() != of_set.is_handed_in())
      throw std::invalid_argument("body '" + scene.bodies[body].name + "' and body '" +
                                  scene.bodies[first].name +
                                  "' name one vertex set, but their plans are not copies of one object");
  }
  for (const BodyPair& pair : scene.pairs)
    if (pair.first > pair.second || pair.second >= scene.bodies.size())
      throw std::invalid_argument("body pair (" + std::to_string(pair.first) + ", " +
                                  std::to_string(pair.second) + ") in a scene of " +
                                  std::to_string(scene.bodies.size()) + " bodies");
}

template <class S>
std::uint64_t hash(const Scene<S>& scene) {
  Hasher hasher;
  hasher.mix(sizeof(S));
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b) {
    const Body<S>& body = scene.bodies[b];
    if (body.vertex_set != own_vertices) hasher.mix(scene.first_of_set(b));
    hasher.mix(std::uint64_t(body.primitives.kind));
    hasher.list(body.primitives.offsets);
    hasher.list(body.primitives.vertices);
    if (body.primitives.removed_count != 0) hasher.list(body.primitives.removed);
    const auto times = body.plans.keyframe_times();
    hasher.bytes(times.data(), times.size_bytes());
    hasher.bytes(body.plans.keyframe(0),
                 body.plans.keyframe_count() * 3 * body.plans.keyframed_count() * sizeof(S));
    for (std::size_t k = 0; body.plans.curved() && k + 1 < body.plans.keyframe_count(); ++k)
      for (const S* const values : {body.plans.bends(k), body.plans.twists(k)}) {
        hasher.mix(values != nullptr ? 1 : 0);
        if (values != nullptr)
          hasher.bytes(values, std::size_t(3) * body.plans.keyframed_count() * sizeof(S));
      }
  }
  for (const BodyPair& pair : scene.pairs) hasher.mix((std::uint64_t(pair.first) << 32) | pair.second);
  return hasher.value();
}

template <class S>
std::vector<double> overlaid_keyframes(const Scene<S>& scene) {
  std::vector<double> times;
  for (const auto& body : scene.bodies)
    if (body.plans.keyframe_count() > 1)
      times.insert(times.end(), body.plans.keyframe_times().begin(), body.plans.keyframe_times().end());
  if (times.empty()) return {scene.bodies.empty() ? 0.0 : scene.bodies[0].plans.keyframe_times()[0]};
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

template <class S>
std::vector<double> frame_times(const Scene<S>& scene, std::uint32_t per_keyframe, std::size_t most) {
  if (per_keyframe == 0) throw std::invalid_argument("frames per keyframe must be at least 1, got 0");
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  std::vector<double> frames;
  frames.reserve(std::min((keyframes.size() - 1) * per_keyframe + 1, most));
  for (std::size_t k = 0; k + 1 < keyframes.size(); ++k)
    for (std::uint32_t j = 0; j < per_keyframe; ++j) {
      if (frames.size() == most) return frames;
      const double t = keyframes[k] + (keyframes[k + 1] - keyframes[k]) * double(j) / double(per_keyframe);
      // Between keyframes that nearly coincide, rounding may reach the next one; that keyframe is added as a
      // frame of its own.
      if (t < keyframes[k + 1] && (frames.empty() || frames.back() < t)) frames.push_back(t);
    }
  if (frames.size() < most) frames.push_back(keyframes.back());
  return frames;
}

#define KBVH_INSTANTIATE(S)                                         \
  template void validate(const Scene<S>&);                          \
  template std::uint64_t hash(const Scene<S>&);                     \
  template std::vector<double> overlaid_keyframes(const Scene<S>&); \
  template std::vector<double> frame_times(const Scene<S>&, std::uint32_t, std::size_t);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
