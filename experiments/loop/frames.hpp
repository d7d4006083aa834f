#pragma once
#include <cstdint>
#include <filesystem>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Writes positions as FOLDER/frame_STEP.obj, with the faces of the mesh. Frames at equal distances are a
/// body for every strategy: kbvh run --body FOLDER --self. Throws io::InputError if a file cannot be written.
void save_frame(const std::filesystem::path& folder, const SimulatedMesh& mesh, const Positions& x,
                std::uint64_t step);

}  // namespace kbvh::experiments::loop
