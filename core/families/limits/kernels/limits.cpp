#include "core/families/limits/kernels/limits.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

constexpr std::size_t step_lanes = native_lanes<std::uint32_t>;
using Word = Vector<std::uint32_t, step_lanes>;
constexpr std::size_t step = 4 * sizeof(Word);

unsigned read(const void* from, std::size_t bytes) {
  const char* at = static_cast<const char*>(from);
  Word sum[4] = {};
  std::size_t i = 0;
  for (; i + step <= bytes; i += step)
    for (std::size_t k = 0; k < 4; ++k) {
      Word word;
      __builtin_memcpy(&word, at + i + k * sizeof word, sizeof word);
      sum[k] ^= word;
    }
  unsigned rest = 0;
  for (; i < bytes; ++i) rest += unsigned(static_cast<unsigned char>(at[i]));
  const Word all = (sum[0] ^ sum[1]) ^ (sum[2] ^ sum[3]);
  unsigned words[step_lanes];
  __builtin_memcpy(words, &all, sizeof all);
  for (unsigned word : words) rest ^= word;
  return rest;
}

void write(void* to, std::size_t bytes, unsigned value) {
  char* at = static_cast<char*>(to);
  const Word word = Word{} + value;
  std::size_t i = 0;
  for (; i + step <= bytes; i += step)
    for (std::size_t k = 0; k < 4; ++k) __builtin_memcpy(at + i + k * sizeof word, &word, sizeof word);
  for (; i < bytes; ++i) at[i] = static_cast<char>(value);
}

template <class S>
void lerp(const S* x0, const S* x1, std::size_t count, S ratio, S* __restrict out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = x0[i] + ratio * (x1[i] - x0[i]);
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const LimitKernels limits{&read, &write, &lerp<float>, &lerp<double>};
}

}  // namespace kbvh
