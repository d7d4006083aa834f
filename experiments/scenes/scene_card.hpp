#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/common/names.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

/// The statistics of one body of a scene and of its motion.
struct BodyCard {
  std::string name;
  std::uint32_t vertices = 0, primitives = 0, keyframes = 0;
  double seconds = 0;  ///< from the first keyframe to the last
  /// Nodes of the default binary tree over the first keyframe (median, one primitive per leaf), and the share
  /// of their sides whose realising vertex changes until the next keyframe, as the mean over the intervals
  /// and in the interval where it is highest. A vertex that still realises the bound among equals counts as
  /// unchanged. 0 for bodies at rest.
  std::uint32_t nodes = 0;
  double sides_changed = 0, most_sides_changed = 0;
  /// Mean and largest displacement of a vertex in one keyframe interval, as multiples of the mean edge length
  /// at the first keyframe.
  double mean_step = 0, largest_step = 0;
};

/// Makes one card per body. O(keyframes x (vertices + nodes)).
std::vector<BodyCard> cards(const LoadedScene& scene);

nlohmann::json as_json(const BodyCard& card);

/// Returns {"scene": name, "bodies": [cards]}.
nlohmann::json as_json(const std::string& scene, const std::vector<BodyCard>& list);

/// Computes a hash of everything that a card and a picture show, and of the curves between keyframes, the
/// same in every scalar: it distinguishes scenes of the same name. O(size of the scene).
std::uint64_t card_hash(const LoadedScene& scene);

/// Returns the name of a scene's folder: its name, shortened, and its card's hash.
std::string folder_name(const LoadedScene& scene);

/// Writes a scene for inspection and pictures: every body as OBJ, with PC2 if it moves, its number before its
/// name, and the cards as card.json, with the hash. `most_keyframes` limits the keyframes of long clips to
/// this many: the first, the last and some between; 0: all. Curves between keyframes are not written. Throws
/// io::InputError.
void export_scene(const LoadedScene& scene, const std::filesystem::path& folder, std::size_t most_keyframes);

}  // namespace kbvh::experiments
