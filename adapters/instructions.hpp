#pragma once
#include <string>

namespace kbvh {

/// Names the instruction set for which the including file is compiled: that of a peer whose code is in
/// headers, and of a library without a choice at run time from a distribution that compiles for the same
/// level (Debian: x86-64, that is SSE2).
inline std::string compiled_instructions() {
#if defined(__AVX512F__)
  return "avx512";
#elif defined(__AVX2__)
  return "avx2";
#elif defined(__AVX__)
  return "avx";
#elif defined(__SSE4_2__)
  return "sse4.2";
#elif defined(__SSE2__)
  return "sse2";
#else
  return "portable";
#endif
}

}  // namespace kbvh
