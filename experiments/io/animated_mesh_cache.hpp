#pragma once
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Raised with every change of the layout below; files of another version are refused.
inline constexpr std::uint32_t cache_version = 1;

/// Computes the checksum of a payload that the header holds: it detects damage, not forgery.
std::uint64_t cache_checksum(std::string_view payload);

/// Writes meshes to one binary file: "KBVHMESH", u32 version, u32 0, u64 payload bytes, u64 checksum,
/// payload; all little-endian. Positions take float32 each if all of a mesh are exactly floats, else float64:
/// nothing is rounded. The file is written under another name and renamed, so that an interrupted run leaves
/// no partial file. Throws InputError if the file cannot be written, or if a mesh has points or control nets.
void save_cache(const std::vector<AnimatedMesh>& meshes, const std::filesystem::path& file);

/// Reads the output of save_cache, with every field unchanged (except that a negative zero becomes zero), and
/// performs all checks of finish(). Throws InputError if the file is missing, truncated, damaged (checksum),
/// or of another version.
std::vector<AnimatedMesh> load_cache(const std::filesystem::path& file);

}  // namespace kbvh::io
