#pragma once
// Internal: tables of kernels, one per instruction set (kernel_set.hpp). Kernel files include this header and
// no standard headers with inline functions.

#if defined(KBVH_X86_KERNELS)
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
#if defined(KBVH_WITHOUT_AVX512)
// Never chosen: it is not among supported_kernel_sets().
#define KBVH_AVX512_TABLE(table) static_cast<decltype(&kbvh::kernels::portable::table)>(nullptr)
#else
#define KBVH_AVX512_TABLE(table) &kbvh::kernels::avx512::table
#endif
/// Selects the table of a KernelSet.
#define KBVH_SELECT_KERNELS(set, table)                                                 \
  (*kbvh::kernels::choose({&kbvh::kernels::portable::table, &kbvh::kernels::sse::table, \
                           &kbvh::kernels::avx2::table, KBVH_AVX512_TABLE(table)},      \
                          static_cast<int>(set)))
#else
#define KBVH_DECLARE_KERNELS(Type, table) \
  namespace kernels::portable {           \
  extern const Type table;                \
  }
#define KBVH_SELECT_KERNELS(set, table) (static_cast<void>(set), kbvh::kernels::portable::table)
#endif

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
