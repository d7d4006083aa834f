#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

namespace kbvh {

/// The instruction sets for which the hot loops (kernels/ of each room) are compiled into one binary. All of
/// them compute the same bits; one is chosen at run time.
enum class KernelSet : std::uint8_t {
  portable,  ///< plain C++, one value at a time
  sse,       ///< x86-64 with SSE4.2
  avx2,      ///< SSE4.2, AVX2 and FMA
  avx512,    ///< AVX2 and AVX-512 F, VL, DQ, BW
};

const char* name(KernelSet set);
/// Finds a set by its name. Throws std::invalid_argument that lists the known sets.
KernelSet kernel_set(std::string_view name);

/// Returns the sets that this binary contains and this processor can run, from the plainest to the widest.
const std::vector<KernelSet>& supported_kernel_sets();

/// Returns the active set: the widest supported set, unless the environment variable KBVH_KERNELS names
/// another. Throws std::invalid_argument if that name is unknown or the set not supported.
KernelSet active_kernel_set();
/// Switches to another set, for tests that run one set after the other. Affects objects created afterwards.
/// No other thread may use kernels during the call. Throws std::invalid_argument if the set is not supported.
void use_kernel_set(KernelSet set);

}  // namespace kbvh
