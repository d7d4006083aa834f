#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

namespace kbvh {

/// Instruction sets for which the hot loops (core/kernels/) are compiled into one binary. All of them compute
/// the same bits; one is chosen at run time.
enum class KernelSet : std::uint8_t {
  portable,  ///< plain C++, one value at a time
  sse,       ///< x86-64 with SSE4.2
  avx2,      ///< and AVX2, FMA
  avx512,    ///< and AVX-512 F, VL, DQ, BW
};

const char* name(KernelSet set);
/// Throws std::invalid_argument naming the known sets.
KernelSet kernel_set(std::string_view name);

/// The sets that this binary holds and this processor can run, from the plainest to the widest.
const std::vector<KernelSet>& supported_kernel_sets();

/// The set in use: the widest that is supported, unless the environment variable KBVH_KERNELS names another.
/// Throws std::invalid_argument if that one is unknown or not supported.
KernelSet active_kernel_set();
/// Uses another set from now on, for tests that force one after the other. Affects what is made afterwards;
/// not to be called while another thread uses kernels. Throws std::invalid_argument if it is not supported.
void use_kernel_set(KernelSet set);

}  // namespace kbvh
