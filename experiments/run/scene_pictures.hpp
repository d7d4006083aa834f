#pragma once
#include <filesystem>
#include <functional>
#include <string>

#include "experiments/scenes/scene_card.hpp"

namespace kbvh::experiments {

/// Writes the report's data on a scene to `folder`/scenes, if they are not there: its card and a few
/// keyframes. Returns the card's hash; "" for a scene that is too large for a picture. A failure is passed to
/// `warn` as a sentence, because no measurement depends on it.
std::string write_pictures(const LoadedScene& loaded, const std::filesystem::path& folder,
                           const MakeProgress& progress, const std::function<void(const std::string&)>& warn);

}  // namespace kbvh::experiments
