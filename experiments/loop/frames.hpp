#pragma once
#include <cstdint>
#include <filesystem>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Writes positions as FOLDER/frame_STEP.obj, with the faces of the mesh. Frames at equal distances are a
/// body for every strategy: kbvh run --body FOLDER --self. Throws io::InputError if a file cannot be written.
void save_frame(const std::filesystem::path& folder, const SimulatedMesh& mesh, const Positions& x,
                std::uint64_t step);

/// Writes a recording as a clip, with a keyframe for each iterate: the positions where its motion begins. The
/// clip is FOLDER/iterates.obj and FOLDER/iterates.pc2, a body for every strategy: kbvh run --body
/// file=FOLDER/iterates.obj,motion=FOLDER/iterates.pc2 --self --l 1. Coordinates are rounded to float, and an
/// iterate has the duration of a frame of the file. Returns the number of iterates, at most `most` (0: all).
/// Throws io::InputError as RecordingReader, for a recording without iterates, and if a file cannot be
/// written.
std::uint64_t save_iterates(const std::filesystem::path& recording, const std::filesystem::path& folder,
                            std::uint64_t most = 0);

}  // namespace kbvh::experiments::loop
