#pragma once
#include <filesystem>
#include <string>

namespace kbvh::experiments {

/// Where simulated scenes and true pairs are kept between runs: $KBVH_CACHE, else $XDG_CACHE_HOME/kbvh, else
/// ~/.cache/kbvh, created if need be. Empty, after one warning on standard error, if it cannot be written;
/// everything works without it.
std::filesystem::path cache_folder();

/// The folder of real input that "data:" in plans stands for: $KBVH_DATA, else ../shared/data beside the
/// source tree. It need not exist.
std::filesystem::path data_folder();

/// The folder with report.py: $KBVH_ANALYSIS, else analysis/ of the source tree, else where it was installed.
/// Throws io::InputError that names the places looked at.
std::filesystem::path analysis_folder();

/// /usr/bin/python3 if it exists (Debian's, with its matplotlib), else whichever PATH has.
std::string python();

}  // namespace kbvh::experiments
