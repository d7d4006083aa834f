#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/common/names.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

/// What one body of a scene is and how violently it moves.
struct BodyCard {
  std::string name;
  std::uint32_t vertices = 0, primitives = 0, keyframes = 0;
  double seconds = 0;  ///< from the first keyframe to the last
  /// Of the default binary tree over the first keyframe (median, one primitive per leaf): nodes, and the
  /// share of their sides whose realising vertex is another one at the next keyframe, as mean over the
  /// intervals and in the one where it is highest. A vertex that still realises the bound among equals
  /// counts as the same. 0 for bodies at rest.
  std::uint32_t nodes = 0;
  double sides_changed = 0, most_sides_changed = 0;
  /// Mean and largest way of a vertex in one keyframe interval, as multiples of the mean edge length at the
  /// first keyframe.
  double mean_step = 0, largest_step = 0;
};

/// One card per body. O(keyframes x (vertices + nodes)).
std::vector<BodyCard> cards(const LoadedScene& scene);

nlohmann::json as_json(const BodyCard& card);

/// {"scene": name, "bodies": [cards]}.
nlohmann::json as_json(const std::string& scene, const std::vector<BodyCard>& list);

/// What tells scenes apart that have the same name: a hash of all that a card and a picture show, the same in
/// every scalar. O(size of the scene).
std::uint64_t card_hash(const LoadedScene& scene);

/// The name of a scene's folder among others: its name, shortened, and its card's hash.
std::string folder_name(const LoadedScene& scene);

/// Writes a scene for people and pictures: every body as OBJ, with PC2 if it moves, its number before its
/// name, and the cards as card.json, with the hash. `most_keyframes`: of long clips only so many, the first,
/// the last and some between; 0: all. Throws io::InputError.
void export_scene(const LoadedScene& scene, const std::filesystem::path& folder, std::size_t most_keyframes);

}  // namespace kbvh::experiments
