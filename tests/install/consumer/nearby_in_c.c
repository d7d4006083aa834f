/* The broad phase from C: two edges that come near each other. */
#include <stdio.h>

#include "core/broad_phase/broad_phase_c.h"

int main(void) {
  double v[4][3] = {{0, 0, 0}, {1, 0, 0}, {0.5, -0.5, 0.5}, {0.5, 0.5, 0.5}};
  const int32_t edges[2][2] = {{0, 1}, {2, 3}};
  const kbvh_positions positions = {v, 4, 3, 1};
  const uint32_t* pairs = NULL;
  size_t count = 0;
  kbvh_broad_phase* broad = kbvh_broad_phase_new(KBVH_DOUBLE);
  if (broad == NULL) return 1;
  if (kbvh_broad_phase_build(broad, &positions, NULL, edges[0], 2, NULL, 0, 0.25) != 0) return 1;
  while (count == 0 && v[2][2] > 0) {
    v[2][2] = v[3][2] = v[2][2] - 0.125;
    if (kbvh_broad_phase_update(broad, &positions, NULL) != 0) return 1;
    if (kbvh_broad_phase_within(broad, KBVH_EDGE_EDGE, 0.25, &pairs, &count) != 0) return 1;
    printf("height %g: %zu pairs\n", v[2][2], count);
  }
  v[0][0] = 1e300;
  if (kbvh_broad_phase_update(broad, &positions, NULL) == 0) return 1;
  printf("%s\n", kbvh_broad_phase_error(broad));
  kbvh_broad_phase_free(broad);
  return 0;
}
