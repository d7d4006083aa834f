#pragma once
// A target that reads its input as a mesh file: any bytes give a valid mesh or an InputError.

#include <optional>
#include <string>
#include <string_view>

#include "experiments/io/load.hpp"
#include "experiments/io/validate.hpp"
#include "tests/fuzz/input_file.hpp"

namespace kbvh::fuzz {

/// Reads the file, and checks the reader's promise: another `finish` finds nothing to correct. Returns
/// nothing if the file was refused.
inline std::optional<io::AnimatedMesh> read_mesh(const std::filesystem::path& mesh,
                                                 const std::filesystem::path& motion = {}) {
  io::AnimatedMesh read;
  try {
    read = io::load_animated_mesh({.mesh = mesh, .motion = motion});
  } catch (const io::InputError&) {
    return std::nullopt;
  }
  io::finish(read, mesh);
  return read;
}

/// Reads a text as a file of that name, and again with the line ends of Windows and of old Macs; aborts if
/// the mesh differs. Texts that already contain '\r' are read once.
inline void read_text_mesh(const InputFolder& folder, const std::string& name, std::string_view text) {
  const auto read = [&](std::string_view bytes) {
    return read_mesh(folder.write(name, reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
  };
  const std::optional<io::AnimatedMesh> mesh = read(text);
  if (text.find('\r') != std::string_view::npos) return;
  for (const std::string_view end : {"\r\n", "\r"}) {
    std::string other;
    for (const char c : text) c == '\n' ? other += end : other += c;
    const std::optional<io::AnimatedMesh> same = read(other);
    if (mesh.has_value() != same.has_value()) std::abort();
    if (mesh && (mesh->positions != same->positions || mesh->primitive_offsets != same->primitive_offsets ||
                 mesh->primitive_vertices != same->primitive_vertices || mesh->notes != same->notes))
      std::abort();
  }
}

}  // namespace kbvh::fuzz
