#pragma once
// Internal: tables of kernels, one per instruction set (kernel_set.hpp). Kernel files include this header and
// no standard headers with inline functions.

/// Declares `table`, of type `const Type`, in the namespaces of all instruction sets; use it inside namespace
/// kbvh.
#define KBVH_DECLARE_KERNELS(Type, table) \
  namespace kernels::portable {           \
  extern const Type table;                \
  }                                       \
  namespace kernels::sse {                \
  extern const Type table;                \
  }                                       \
  namespace kernels::avx2 {               \
  extern const Type table;                \
  }                                       \
  namespace kernels::avx512 {             \
  extern const Type table;                \
  }

// The table of a set that this binary lacks is never chosen: the set is not among supported_kernel_sets().
#define KBVH_NO_KERNELS(table) static_cast<decltype(&kbvh::kernels::portable::table)>(nullptr)
#if defined(KBVH_HAS_KERNELS_SSE)
#define KBVH_SSE_TABLE(table) &kbvh::kernels::sse::table
#else
#define KBVH_SSE_TABLE(table) KBVH_NO_KERNELS(table)
#endif
#if defined(KBVH_HAS_KERNELS_AVX2)
#define KBVH_AVX2_TABLE(table) &kbvh::kernels::avx2::table
#else
#define KBVH_AVX2_TABLE(table) KBVH_NO_KERNELS(table)
#endif
#if defined(KBVH_HAS_KERNELS_AVX512)
#define KBVH_AVX512_TABLE(table) &kbvh::kernels::avx512::table
#else
#define KBVH_AVX512_TABLE(table) KBVH_NO_KERNELS(table)
#endif
/// Selects the table of a KernelSet.
#define KBVH_SELECT_KERNELS(set, table)                                                                    \
  (*kbvh::kernels::choose({&kbvh::kernels::portable::table, KBVH_SSE_TABLE(table), KBVH_AVX2_TABLE(table), \
                           KBVH_AVX512_TABLE(table)},                                                      \
                          static_cast<int>(set)))

/// Inside namespace kbvh: defines `function<S>(KernelSet)` for both scalars, which returns `table_float` or
/// `table_double`.
#define KBVH_DEFINE_KERNEL_CHOICE(Type, function, table) \
  template <>                                            \
  const Type<float>& function(KernelSet set) {           \
    return KBVH_SELECT_KERNELS(set, table##_float);      \
  }                                                      \
  template <>                                            \
  const Type<double>& function(KernelSet set) {          \
    return KBVH_SELECT_KERNELS(set, table##_double);     \
  }

namespace kbvh::kernels {
template <class Table>
inline const Table* choose(const Table* const (&tables)[4], int set) {
  return tables[set];
}
}  // namespace kbvh::kernels
