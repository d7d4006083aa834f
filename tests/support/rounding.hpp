#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <vector>

#include "core/kernels/kernel_set.hpp"

namespace kbvh::testing_support {

/// Returns whether KBVH_SLOW requests the long version.
inline bool slow() {
  const char* value = std::getenv("KBVH_SLOW");
  return value != nullptr && std::strcmp(value, "0") != 0 && *value != '\0';
}

/// Returns whether `rounded` is a value rounded to nearest even: no neighbour is nearer, and a neighbour that
/// is as near has an odd last bit. Halfway points suffice for this: against(a, b) has the sign of value - (a
/// + b) / 2. Finite results only.
template <class S, class Against>
bool is_nearest_even_by(S rounded, const Against& against) {
  if (!std::isfinite(rounded) || (rounded == 0 && std::signbit(rounded))) return false;
  const S infinity = std::numeric_limits<S>::infinity();
  const int against_lower = against(rounded, std::nextafter(rounded, -infinity));
  const int against_upper = against(rounded, std::nextafter(rounded, infinity));
  int exponent = 0;
  const double fraction = std::frexp(static_cast<double>(rounded), &exponent);
  const int lowest = std::numeric_limits<S>::min_exponent;  // subnormals lose bits
  const int digits = std::numeric_limits<S>::digits - (exponent < lowest ? lowest - exponent : 0);
  const bool even = rounded == 0 || std::fmod(std::ldexp(fraction, digits), 2.0) == 0;
  return (against_lower > 0 || (against_lower == 0 && even)) &&
         (against_upper < 0 || (against_upper == 0 && even));
}

/// Calls `round` (kernels -> values) with each kernel set that runs here. They must agree to the last bit,
/// and may differ only in what they leave to later stages. Returns the values.
template <class S, class Round>
std::vector<S> with_all_kernels(std::size_t count, const Round& round) {
  struct Restore {
    kbvh::KernelSet set = kbvh::active_kernel_set();
    ~Restore() { kbvh::use_kernel_set(set); }
  } restore;
  std::vector<S> first;
  for (const kbvh::KernelSet set : kbvh::supported_kernel_sets()) {
    kbvh::use_kernel_set(set);
    std::vector<S> out(count, S(7));
    round(out.data());
    if (first.empty()) first = out;
    EXPECT_EQ(std::memcmp(first.data(), out.data(), count * sizeof(S)), 0) << kbvh::name(set);
  }
  return first;
}

}  // namespace kbvh::testing_support
