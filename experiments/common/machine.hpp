#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace kbvh::experiments {

/// Describes the machine and the build as results record them: cpu, cores, memory_gb, os, compiler, flags,
/// build_type, simd, kernels (the set in use). Throws io::InputError if KBVH_KERNELS names no set that runs
/// here.
nlohmann::json machine();

/// Returns the commit that was built, in full, or "unknown".
std::string commit();
/// Returns whether tracked files had been changed when the program was built.
bool dirty();

/// Identifies the program's code in the keys of results: the commit; with changed files or without a
/// repository also a hash of the running executable, or of the module that holds this code.
std::string program_identity();

/// Returns the name of this machine as a part of a file name, or "unknown".
std::string host_name();

/// Returns the current time in UTC, as 2025-01-31T12:00:00Z.
std::string now_utc();

}  // namespace kbvh::experiments
