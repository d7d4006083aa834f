#pragma once
#include <string>
#include <vector>

#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Scenes whose vertices move on curves of degree 2 and 3: those of other names, bent between their
/// keyframes. Contestants that foresee linear motion only do not take part.
const std::vector<std::string>& curved_scene_names();

/// Makes one by name; deterministic.
template <class S>
TestScene<S> curved_scene(const std::string& name, std::uint32_t frames_per_keyframe = 1);

}  // namespace kbvh::test
