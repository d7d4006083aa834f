#include "experiments/common/environment.hpp"

#include <unistd.h>

#include <cstdlib>
#include <system_error>

#include "experiments/common/progress.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

namespace fs = std::filesystem;

namespace {
fs::path variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? fs::path() : fs::path(value);
}

fs::path wanted_cache_folder() {
  if (const fs::path given = variable("KBVH_CACHE"); !given.empty()) return given;
  if (const fs::path xdg = variable("XDG_CACHE_HOME"); !xdg.empty()) return xdg / "kbvh";
  if (const fs::path home = variable("HOME"); !home.empty()) return home / ".cache" / "kbvh";
  return {};
}
}  // namespace

fs::path cache_folder() {
  static const fs::path folder = [] {
    const fs::path wanted = wanted_cache_folder();
    std::error_code error;
    if (!wanted.empty()) {
      fs::create_directories(wanted, error);
      if (fs::is_directory(wanted, error) && ::access(wanted.c_str(), W_OK | X_OK) == 0) return wanted;
    }
    say("warning: " +
        (wanted.empty() ? "there is no cache folder, because HOME is not set"
                        : "the cache folder '" + wanted.string() + "' cannot be written") +
        "; scenes and true pairs are recomputed (KBVH_CACHE names another folder)");
    return fs::path();
  }();
  return folder;
}

fs::path data_folder() {
  if (const fs::path given = variable("KBVH_DATA"); !given.empty()) return given;
  return (fs::path(KBVH_SOURCE_DIR) / ".." / "shared" / "data").lexically_normal();
}

fs::path analysis_folder() {
  std::error_code error;
  if (const fs::path given = variable("KBVH_ANALYSIS"); !given.empty()) {
    if (fs::is_regular_file(given / "report.py", error)) return given;
    throw io::InputError("KBVH_ANALYSIS: there is no report.py in '" + given.string() + "'");
  }
  const fs::path source = fs::path(KBVH_SOURCE_DIR) / "analysis";
  const fs::path installed = fs::path(KBVH_INSTALLED_SHARE) / "analysis";
  for (const fs::path& folder : {source, installed})
    if (fs::is_regular_file(folder / "report.py", error)) return folder;
  throw io::InputError("report.py is neither in '" + source.string() + "' nor in '" + installed.string() +
                       "' (KBVH_ANALYSIS names another folder)");
}

fs::path data_program() {
  std::error_code error;
  const fs::path source = fs::path(KBVH_SOURCE_DIR) / "experiments" / "data" / "data.py";
  const fs::path installed = fs::path(KBVH_INSTALLED_SHARE) / "data" / "data.py";
  for (const fs::path& file : {source, installed})
    if (fs::is_regular_file(file, error)) return file;
  throw io::InputError("data.py is neither '" + source.string() + "' nor '" + installed.string() + "'");
}

std::string python() {
  return ::access("/usr/bin/python3", X_OK) == 0 ? "/usr/bin/python3" : "python3";
}

}  // namespace kbvh::experiments
