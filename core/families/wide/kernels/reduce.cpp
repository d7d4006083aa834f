#include "core/families/wide/kernels/reduce.hpp"

#include <cstdint>
#include <type_traits>

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

/// Calls work(lanes, i) for all of `count` numbers: first for as many as fit into a register, then one by
/// one.
template <class S, class Work>
[[gnu::always_inline]] inline void in_lanes(std::size_t count, const Work& work) {
  constexpr std::size_t lanes = native_lanes<S>;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) work(Vector<S, lanes>{}, i);
  for (; i < count; ++i) work(S{}, i);
}

template <class S>
void interpolate(const S* from, const S* to, S u, S* out, std::size_t count) {
  in_lanes<S>(
      count, [&](auto zero, std::size_t i) __attribute__((always_inline)) {
        using V = decltype(zero);
        const V first = load_lanes<V>(from + i);
        store_lanes(out + i, V(first + u * (load_lanes<V>(to + i) - first)));
      });
}

template <class S>
void widen(S* values, std::size_t count, S margin) {
  in_lanes<S>(
      count, [&](auto zero, std::size_t i) __attribute__((always_inline)) {
        using V = decltype(zero);
        store_lanes(values + i, V(load_lanes<V>(values + i) - margin));
      });
}

template <std::size_t bytes>
using Bits = std::conditional_t<bytes == 4, std::uint32_t, std::uint64_t>;

/// Rounds by bits, which order numbers by magnitude: a carry into the exponent is correct.
template <class U, bool to_nearest>
[[gnu::always_inline]] inline void round_bits(U* bits, std::size_t count, unsigned dropped) {
  const U rest = (U(1) << dropped) - 1;
  in_lanes<U>(
      count, [&](auto zero, std::size_t i) __attribute__((always_inline)) {
        using V = decltype(zero);
        V word = load_lanes<V>(bits + i);
        if constexpr (to_nearest)
          word = V(word + (rest >> 1) + ((word >> dropped) & U(1)));
        else
          word = V(word + ((V{} - (word >> (8 * sizeof(U) - 1))) & rest));  // negative: away from zero
        store_lanes(bits + i, V(word & ~rest));
      });
}

// load_lanes and store_lanes use memcpy, so numbers can be read as bits without aliasing.
template <class S>
void nearest(S* values, std::size_t count, unsigned dropped) {
  round_bits<Bits<sizeof(S)>, true>(reinterpret_cast<Bits<sizeof(S)>*>(values), count, dropped);
}
template <class S>
void down(S* values, std::size_t count, unsigned dropped) {
  round_bits<Bits<sizeof(S)>, false>(reinterpret_cast<Bits<sizeof(S)>*>(values), count, dropped);
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const ReduceKernels<float> reduce_float{&interpolate<float>, &nearest<float>, &down<float>, &widen<float>};
const ReduceKernels<double> reduce_double{&interpolate<double>, &nearest<double>, &down<double>,
                                          &widen<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
