#pragma once
#include <cstdio>
#include <cstdlib>

/// Internal invariants: on in debug builds and where KBVH_CHECKED is set, gone elsewhere.
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
