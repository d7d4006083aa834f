#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace kbvh::experiments {

/// Where and how this program runs, as results record it: cpu, cores, memory_gb, os, compiler, flags,
/// build_type, simd, kernels (the set in use). Throws io::InputError if KBVH_KERNELS names none that works
/// here.
nlohmann::json machine();

/// The commit that was built, in full, or "unknown".
std::string commit();
/// Had tracked files been changed when it was built?
bool dirty();

/// What stands for the program's code in the keys of results: the commit; where that says too little (changed
/// files, no repository), a hash of the running executable is added.
std::string program_identity();

/// The time now, UTC, as 2025-01-31T12:00:00Z.
std::string now_utc();

}  // namespace kbvh::experiments
