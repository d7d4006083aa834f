#pragma once
#include <cstdio>
#include <cstdlib>

/// Checks an internal invariant in debug builds and with KBVH_CHECKED defined; compiles to nothing otherwise.
#if defined(KBVH_CHECKED) || !defined(NDEBUG)
#define KBVH_ASSERT(condition)                                                                        \
  do {                                                                                                \
    if (!(condition)) {                                                                               \
      std::fprintf(stderr, "%s:%d: internal invariant broken: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                                   \
    }                                                                                                 \
  } while (false)
#else
#define KBVH_ASSERT(condition) ((void)0)
#endif
