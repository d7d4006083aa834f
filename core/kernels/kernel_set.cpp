#include "core/kernels/kernel_set.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace kbvh {

namespace {

constexpr KernelSet all_sets[] = {KernelSet::portable, KernelSet::sse, KernelSet::avx2, KernelSet::avx512};

/// Whether this binary contains a set and this processor can run it.
bool runs_here(KernelSet set) {
#if defined(__x86_64__)
  __builtin_cpu_init();
#endif
  switch (set) {
    case KernelSet::portable:
      return true;
    case KernelSet::sse:
#if defined(KBVH_HAS_KERNELS_SSE)
      return __builtin_cpu_supports("sse4.2") != 0;
#else
      return false;
#endif
    case KernelSet::avx2:
#if defined(KBVH_HAS_KERNELS_AVX2)
      return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
#else
      return false;
#endif
    case KernelSet::avx512:
#if defined(KBVH_HAS_KERNELS_AVX512)
      return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0 &&
             __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
             __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
#else
      return false;
#endif
  }
  return false;
}

KernelSet checked(KernelSet set) {
  const auto& supported = supported_kernel_sets();
  if (std::find(supported.begin(), supported.end(), set) != supported.end()) return set;
  std::string known;
  for (KernelSet one : supported) known += (known.empty() ? "" : ", ") + std::string(name(one));
  throw std::invalid_argument("kernels for '" + std::string(name(set)) +
                              "' cannot run on this machine; those that can are " + known);
}

/// The choice made by use_kernel_set, or -1: the environment decides.
std::atomic<int> chosen{-1};

}  // namespace

const char* name(KernelSet set) {
  switch (set) {
    case KernelSet::portable:
      return "portable";
    case KernelSet::sse:
      return "sse";
    case KernelSet::avx2:
      return "avx2";
    case KernelSet::avx512:
      return "avx512";
  }
  return "?";
}

KernelSet kernel_set(std::string_view text) {
  for (KernelSet set : all_sets)
    if (text == name(set)) return set;
  throw std::invalid_argument("unknown kernels '" + std::string(text) +
                              "'; known are portable, sse, avx2, avx512");
}

const std::vector<KernelSet>& supported_kernel_sets() {
  static const std::vector<KernelSet> sets = [] {
    std::vector<KernelSet> list;
    for (KernelSet set : all_sets)
      if (runs_here(set)) list.push_back(set);
    return list;
  }();
  return sets;
}

KernelSet active_kernel_set() {
  if (const int set = chosen.load(std::memory_order_relaxed); set >= 0) return static_cast<KernelSet>(set);
  static const KernelSet initial = [] {
    const char* wanted = std::getenv("KBVH_KERNELS");
    return wanted == nullptr || *wanted == '\0' ? supported_kernel_sets().back()
                                                : checked(kernel_set(wanted));
  }();
  return initial;
}

void use_kernel_set(KernelSet set) {
  chosen.store(static_cast<int>(checked(set)), std::memory_order_relaxed);
}

}  // namespace kbvh
