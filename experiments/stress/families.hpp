#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/stress/scene.hpp"

namespace kbvh::experiments::stress {

/// What a family is told of the scalar that its scene will be in, so that it can aim at its limits.
struct ScalarLimits {
  double largest;   ///< admissible coordinate or velocity
  double smallest;  ///< above zero: denormal
  double normal;    ///< the smallest normal number
  double epsilon;   ///< distance from 1 to the next number
};
template <class S>
ScalarLimits scalar_limits();

/// What a scene is made for.
struct FamilySetting {
  std::uint64_t seed = 1;
  std::uint32_t l = 7;  ///< frames for each segment of the overlaid keyframes
  ScalarLimits limits{};
  /// Keyframes of the family that is about many of them.
  std::uint32_t many_keyframes = 2000;
};

/// A family of adversarial scenes: everything in a scene follows from the setting.
struct Family {
  std::string name;
  std::string meaning;  ///< in a few words
  StressScene (*make)(const FamilySetting& setting);
};

const std::vector<Family>& families();

/// Throws io::InputError that lists the known names.
const Family& find_family(const std::string& name);

/// The scene of a family, its frames included: l for each segment, and the times of all steps.
StressScene make_scene(const Family& family, const FamilySetting& setting);

}  // namespace kbvh::experiments::stress
