#pragma once
// A target that reads its input as a mesh file: whatever the bytes, there is a valid mesh or an InputError.

#include "experiments/io/load.hpp"
#include "experiments/io/validate.hpp"
#include "tests/fuzz/input_file.hpp"

namespace kbvh::fuzz {

/// Reads the file, and then what the reader promises: another `finish` finds nothing to complain about.
inline void read_mesh(const std::filesystem::path& mesh, const std::filesystem::path& motion = {}) {
  io::AnimatedMesh read;
  try {
    read = io::load_animated_mesh({.mesh = mesh, .motion = motion});
  } catch (const io::InputError&) {
    return;
  }
  io::finish(read, mesh);
}

}  // namespace kbvh::fuzz
