/* kbvh::broad_phase for C, and for every language that calls C: BroadPhase<float> and BroadPhase<double>
   (broad_phase.hpp says what each call means) behind one handle and plain arrays.

   Calls that return int return 0, or -1 after an error, which changes nothing and which
   kbvh_broad_phase_error describes. A handle is used by one thread at a time. */
#ifndef KBVH_BROAD_PHASE_C_H
#define KBVH_BROAD_PHASE_C_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct kbvh_broad_phase kbvh_broad_phase;

typedef enum { KBVH_FLOAT = 0, KBVH_DOUBLE = 1 } kbvh_scalar;

typedef enum {
  KBVH_VERTEX_VERTEX = 0,
  KBVH_EDGE_VERTEX = 1,
  KBVH_EDGE_EDGE = 2,
  KBVH_FACE_VERTEX = 3,
  KBVH_EDGE_FACE = 4,
  KBVH_FACE_FACE = 5
} kbvh_candidate_kind;

/* Positions in the caller's memory, read during the call only: coordinate j of vertex v is
   data[v * row_step + j * column_step], in float or double as the handle was made. Row by row: 3 and 1. */
typedef struct {
  const void* data;
  size_t rows;
  ptrdiff_t row_step, column_step;
} kbvh_positions;

/* Returns a new handle; NULL if memory or the scalar does not allow it. */
kbvh_broad_phase* kbvh_broad_phase_new(kbvh_scalar scalar);
void kbvh_broad_phase_free(kbvh_broad_phase* broad);
/* Returns what the last failed call of this handle complained about; an empty text if none failed. */
const char* kbvh_broad_phase_error(const kbvh_broad_phase* broad);

/* Takes a mesh: edges [edge_count][2], faces [face_count][3], row by row. v1 is NULL for a mesh at rest. The
   radius is rounded up to the scalar. */
int kbvh_broad_phase_build(kbvh_broad_phase* broad, const kbvh_positions* v0, const kbvh_positions* v1,
                           const int32_t* edges, size_t edge_count, const int32_t* faces, size_t face_count,
                           double radius);
/* Takes other positions of the same mesh, or a motion if v1 is not NULL. */
int kbvh_broad_phase_update(kbvh_broad_phase* broad, const kbvh_positions* v0, const kbvh_positions* v1);
/* Takes the positions of the vertices moved[0, count); all others must be what they were. */
int kbvh_broad_phase_update_moved(kbvh_broad_phase* broad, const kbvh_positions* v, const uint32_t* moved,
                                  size_t count);
/* Candidates hold for all positions within the displacement from now on; 0 ends this. It is rounded up. */
int kbvh_broad_phase_valid_for(kbvh_broad_phase* broad, double displacement);

/* Point *pairs to the candidates [count][2], in memory of the handle, valid until its next call. */
int kbvh_broad_phase_candidates(kbvh_broad_phase* broad, kbvh_candidate_kind kind, const uint32_t** pairs,
                                size_t* count);
int kbvh_broad_phase_within(kbvh_broad_phase* broad, kbvh_candidate_kind kind, double distance,
                            const uint32_t** pairs, size_t* count);

/* Return by how much coordinates may still change before candidates are detected again, and the number of
   searches since the last build. */
double kbvh_broad_phase_left(const kbvh_broad_phase* broad);
uint64_t kbvh_broad_phase_detections(const kbvh_broad_phase* broad);

#ifdef __cplusplus
}
#endif

#endif
