#pragma once
#include <filesystem>
#include <string>

namespace kbvh::experiments {

/// Returns the cache folder for simulated scenes and true pairs: $KBVH_CACHE, else $XDG_CACHE_HOME/kbvh, else
/// ~/.cache/kbvh; creates it if necessary. Empty, after one warning on standard error, if it cannot be
/// written; everything works without it.
std::filesystem::path cache_folder();

/// Returns the folder of input data that "data:" in plans stands for: $KBVH_DATA, else ../shared/data next to
/// the source tree. It need not exist.
std::filesystem::path data_folder();

/// Returns the folder with report.py: $KBVH_ANALYSIS, else analysis/ of the source tree, else the place of
/// its installation. Throws io::InputError that names the places tried.
std::filesystem::path analysis_folder();

/// Returns data.py, the program for the data sets of the field: in the source tree, else in its installation.
/// Throws io::InputError that names the places tried.
std::filesystem::path data_program();

/// Returns /usr/bin/python3 if it exists (Debian's, with its matplotlib), else the python3 of PATH.
std::string python();

}  // namespace kbvh::experiments
