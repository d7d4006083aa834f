#include "experiments/run/scene_pictures.hpp"

#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

namespace {

/// The largest scene whose keyframes are written for its picture, in primitives and in bodies (each is a
/// file), and the number of keyframes.
constexpr std::uint64_t largest_shown = 150'000;
constexpr std::size_t most_bodies_shown = 1000;
constexpr std::size_t keyframes_shown = 4;

bool is_card(const std::filesystem::path& file, const std::string& hash) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error) || std::filesystem::file_size(file, error) == 0)
    return false;
  const nlohmann::json card = json_or_nothing(io::read_file(file));
  return card.is_object() && card.contains("bodies") && card.contains("hash") && card.at("hash") == hash;
}

}  // namespace

std::string write_pictures(const LoadedScene& loaded, const std::filesystem::path& folder,
                           const MakeProgress& progress,
                           const std::function<void(const std::string&)>& warn) {
  std::uint64_t primitives = 0;
  for (const io::AnimatedMesh& mesh : loaded.meshes) primitives += mesh.primitive_count();
  if (primitives > largest_shown || loaded.meshes.size() > most_bodies_shown) return {};
  const std::string hash = hexadecimal(card_hash(loaded));
  const std::filesystem::path scene_folder = folder / "scenes" / folder_name(loaded);
  if (is_card(scene_folder / "card.json", hash)) return hash;
  if (progress) progress("looking at " + loaded.name, 0);
  try {
    export_scene(loaded, scene_folder, keyframes_shown);
  } catch (const io::InputError& problem) {
    warn("warning: the report will have no picture of " + loaded.name + ": " + problem.what());
  }
  return hash;
}

}  // namespace kbvh::experiments
