#pragma once
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Raised whenever the layout below changes; files of another version are refused, never guessed at.
inline constexpr std::uint32_t cache_version = 1;

/// Of a payload, as the header holds it: finds damage, not malice.
std::uint64_t cache_checksum(std::string_view payload);

/// Writes meshes to one binary file: "KBVHMESH", u32 version, u32 0, u64 payload bytes, u64 checksum,
/// payload; all little-endian. Positions take float32 each if all of a mesh are exactly floats, else float64:
/// nothing is rounded. Written under another name and renamed, so that an interrupted run leaves no half
/// file. Throws InputError if it cannot be written, or has points or control nets.
void save_cache(const std::vector<AnimatedMesh>& meshes, const std::filesystem::path& file);

/// Reads what save_cache wrote, equal in every field (but a negative zero comes back as zero), after all
/// checks of finish(). Throws InputError if the file is missing, truncated, damaged (checksum), or of another
/// version.
std::vector<AnimatedMesh> load_cache(const std::filesystem::path& file);

}  // namespace kbvh::io
