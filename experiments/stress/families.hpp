#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/stress/scene.hpp"

namespace kbvh::experiments::stress {

/// The limits of the scalar that a scene will be played in, so that a family can aim at them.
struct ScalarLimits {
  double largest;   ///< admissible coordinate or velocity
  double smallest;  ///< above zero: denormal
  double normal;    ///< the smallest normal number
  double epsilon;   ///< distance from 1 to the next number
};
template <class S>
ScalarLimits scalar_limits();

/// The parameters of a scene.
struct FamilySetting {
  std::uint64_t seed = 1;
  std::uint32_t l = 7;  ///< frames for each segment of the overlaid keyframes
  ScalarLimits limits{};
  /// Number of keyframes of the family `many_keyframes`.
  std::uint32_t many_keyframes = 2000;
};

/// A family of adversarial scenes: the setting determines everything in a scene.
struct Family {
  std::string name;
  std::string meaning;  ///< in a few words
  StressScene (*make)(const FamilySetting& setting);
};

const std::vector<Family>& families();

/// Finds a family. Throws io::InputError that lists the known names.
const Family& find_family(const std::string& name);

/// Makes the scene of a family with its frames: l per segment, and the times of all steps.
StressScene make_scene(const Family& family, const FamilySetting& setting);

}  // namespace kbvh::experiments::stress
