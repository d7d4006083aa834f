#pragma once
#include <filesystem>
#include <string>

namespace kbvh::io::gltf {

/// The container of a glTF file: its JSON text and, in a .glb, its binary chunk.
struct Container {
  std::string json, binary;
  bool has_binary = false;
  std::size_t bytes_behind = 0;  ///< of the file, beyond the length that its header states
};

/// Reads a .gltf (all text) or a .glb (recognised by its first four bytes, not by its name). Throws
/// InputError.
Container read_container(const std::filesystem::path& file);

/// Returns the bytes of a buffer's URI: base64 data, or a file in or below the folder of `file`. Other
/// locations are refused. Throws InputError with `place`.
std::string read_uri(const std::filesystem::path& file, const std::string& place, const std::string& uri);

}  // namespace kbvh::io::gltf
