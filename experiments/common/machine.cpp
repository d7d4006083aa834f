#include "experiments/common/machine.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/kernels/kernel_set.hpp"
#include "experiments/common/names.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

extern const char* const built_commit;  // written by the build
extern const bool built_dirty;

namespace {

/// Returns the value of the first "key : value" line of /proc/cpuinfo.
std::string cpuinfo(const std::string& key) {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || !line.starts_with(key)) continue;
    const std::size_t end = line.find_last_not_of(" \t", colon - 1);
    if (line.substr(0, end + 1) != key) continue;
    const std::size_t begin = line.find_first_not_of(" \t", colon + 1);
    return begin == std::string::npos ? "" : line.substr(begin);
  }
  return "unknown";
}

std::string operating_system() {
  std::ifstream file("/etc/os-release");
  std::string pretty = "unknown";
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("PRETTY_NAME=")) {
      pretty = line.substr(12);
      std::erase(pretty, '"');
    }
  utsname names{};
  if (::uname(&names) == 0)
    pretty += std::string(", ") + names.sysname + " " + names.release + " " + names.machine;
  return pretty;
}

std::string simd() {
  std::istringstream flags(cpuinfo("flags"));
  std::vector<std::string> found;
  for (std::string flag; flags >> flag;)
    if (flag == "sse2" || flag == "sse4_1" || flag == "sse4_2" || flag == "avx" || flag == "avx2" ||
        flag == "fma" || flag.starts_with("avx512"))
      found.push_back(flag);
  return joined(found, " ");
}

std::string compiler() {
#if defined(__clang__)
  return std::string("Clang ") + __clang_version__;
#elif defined(__GNUC__)
  return std::string("GCC ") + __VERSION__;
#else
  return "unknown";
#endif
}

/// Returns the file that holds this code: the program, or a module that another program has loaded.
std::string own_file() {
  const auto here = reinterpret_cast<std::uintptr_t>(&own_file);
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    unsigned long begin = 0, end = 0;
    int path = 0;
    if (std::sscanf(line.c_str(), "%lx-%lx %*s %*s %*s %*s %n", &begin, &end, &path) == 2 && path > 0 &&
        here >= begin && here < end && std::ifstream(line.substr(std::size_t(path))).good())
      return line.substr(std::size_t(path));
  }
  return "/proc/self/exe";
}

/// Computes a hash word by word: executables of developers have a hundred megabytes, and every run hashes
/// them.
std::uint64_t hash_of_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::uint64_t> block(std::size_t(1) << 16);
  std::uint64_t state = 0xcbf29ce484222325ull, bytes = 0;
  while (file) {
    std::fill(block.begin(), block.end(), 0);
    file.read(reinterpret_cast<char*>(block.data()), std::streamsize(8 * block.size()));
    bytes += std::uint64_t(file.gcount());
    for (const std::uint64_t word : block) {
      state = (state ^ word) * 0x9e3779b97f4a7c15ull;
      state ^= state >> 32;
    }
  }
  return state ^ bytes;
}

/// Returns the kernels in use; a wrong name in the environment counts as wrong use of the program.
std::string kernels() {
  try {
    return name(active_kernel_set());
  } catch (const std::invalid_argument& problem) {
    throw io::InputError(std::string("KBVH_KERNELS: ") + problem.what());
  }
}

}  // namespace

nlohmann::json machine() {
  const double bytes = double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGE_SIZE));
  return {{"cpu", cpuinfo("model name")},
          {"cores", std::thread::hardware_concurrency()},
          {"memory_gb", std::round(bytes / double(1 << 30) * 10) / 10},
          {"os", operating_system()},
          {"compiler", compiler()},
          {"flags", KBVH_BUILD_FLAGS},
          {"build_type", KBVH_BUILD_TYPE},
          {"simd", simd()},
          {"kernels", kernels()}};
}

std::string commit() {
  return built_commit;
}
bool dirty() {
  return built_dirty;
}

std::string program_identity() {
  static const std::string identity = [] {
    std::string text = built_commit;
    if (!built_dirty && text != "unknown") return text;
    return text + "+" + hexadecimal(hash_of_file(own_file()));
  }();
  return identity;
}

std::string host_name() {
  char name[256] = {};
  return ::gethostname(name, sizeof name - 1) == 0 ? file_name(name) : "unknown";
}

std::string now_utc() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace kbvh::experiments
