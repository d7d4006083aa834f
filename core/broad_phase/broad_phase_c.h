/* kbvh::broad_phase for C, and for every language that calls C: BroadPhase<float> and BroadPhase<double>
   (broad_phase.hpp says what each call means) behind one handle and plain arrays.

   Calls that return int return 0, or -1 after an error, which changes nothing and which
   kbvh_broad_phase_error describes. A null pointer is an error, but for an empty list and where a comment
   says otherwise. A handle is used by one thread at a time, and not by a filter that it asks. */
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

typedef enum { KBVH_VERTEX = 0, KBVH_EDGE = 1, KBVH_FACE = 2 } kbvh_element;

/* Groups and masks as bits: two elements may be a candidate if each has a group in the mask of the other. */
typedef struct {
  uint32_t groups, mask;
} kbvh_group_mask;

/* A filter: moves the pairs that stay to the front of pairs [count][2] and returns their number. A larger
   number than count makes the search fail. It has to give the same answer whenever it is asked about a pair.
 */
typedef size_t (*kbvh_pair_filter)(void* context, kbvh_candidate_kind kind, uint32_t* pairs, size_t count);

/* What kbvh_broad_phase_earliest_impact finds: the first time lies in [begin, end]. */
typedef struct {
  int touches; /* 0: there is none */
  kbvh_candidate_kind kind;
  uint32_t pair[2];
  double begin, end;
} kbvh_impact;

/* Positions in the caller's memory, read during the call only: coordinate j of vertex v is
   data[v * row_step + j * column_step], in float or double as the handle was made. Row by row: 3 and 1. */
typedef struct {
  const void* data;
  size_t rows;
  ptrdiff_t row_step, column_step;
} kbvh_positions;

/* Returns a new handle; NULL if memory or the scalar does not allow it. */
kbvh_broad_phase* kbvh_broad_phase_new(kbvh_scalar scalar);
/* Sets the number of threads that share searches, 1 at first; answers and their order do not depend on it. */
int kbvh_broad_phase_use_threads(kbvh_broad_phase* broad, uint32_t threads);
void kbvh_broad_phase_free(kbvh_broad_phase* broad);
/* Returns what the last failed call of this handle complained about; an empty text if none failed. */
const char* kbvh_broad_phase_error(const kbvh_broad_phase* broad);

/* Takes a mesh: edges [edge_count][2], faces [face_count][3], row by row. v1 is NULL for a mesh at rest. The
   radius is rounded up to the scalar. */
int kbvh_broad_phase_build(kbvh_broad_phase* broad, const kbvh_positions* v0, const kbvh_positions* v1,
                           const int32_t* edges, size_t edge_count, const int32_t* faces, size_t face_count,
                           double radius);
/* Takes new positions of the same mesh, or a motion if v1 is not NULL. */
int kbvh_broad_phase_update(kbvh_broad_phase* broad, const kbvh_positions* v0, const kbvh_positions* v1);
/* Takes the positions of the vertices moved[0, count); all others must be what they were. */
int kbvh_broad_phase_update_moved(kbvh_broad_phase* broad, const kbvh_positions* v, const uint32_t* moved,
                                  size_t count);
/* Candidates hold for all positions within the displacement from now on; 0 ends this. It is rounded up. */
int kbvh_broad_phase_valid_for(kbvh_broad_phase* broad, double displacement);

/* Adds the vertices at v, or none if v is NULL, and edges and faces between vertices; ids follow the largest
   of their kind, and first[3] receives the first id of a vertex, an edge, a face. Positions have rows for
   added vertices from then on. */
int kbvh_broad_phase_insert(kbvh_broad_phase* broad, const kbvh_positions* v, const int32_t* edges,
                            size_t edge_count, const int32_t* faces, size_t face_count, uint32_t first[3]);
/* Removes elements; all other ids are unchanged, and a removed vertex keeps its row of positions. */
int kbvh_broad_phase_remove(kbvh_broad_phase* broad, kbvh_element element, const uint32_t* ids, size_t count);

/* Filters, each in place of the one before; build ends all. Groups of all elements of a kind, or none
   (count 0): all pairs are admitted. */
int kbvh_broad_phase_set_groups(kbvh_broad_phase* broad, kbvh_element element, const kbvh_group_mask* groups,
                                size_t count);
/* Groups of vertices; edges and faces get the unions of their vertices' groups and masks. */
int kbvh_broad_phase_set_vertex_groups(kbvh_broad_phase* broad, const kbvh_group_mask* groups, size_t count);
/* Excludes pairs [count][2] of one kind. */
int kbvh_broad_phase_exclude(kbvh_broad_phase* broad, kbvh_candidate_kind kind, const uint32_t* pairs,
                             size_t count);
/* Excludes pairs of elements that at most `rings` edges connect; 0 ends this. */
int kbvh_broad_phase_exclude_rings(kbvh_broad_phase* broad, uint32_t rings);
/* Lets a function choose among the pairs that no other filter excludes; NULL ends this. */
int kbvh_broad_phase_keep_only(kbvh_broad_phase* broad, kbvh_pair_filter filter, void* context);
int kbvh_broad_phase_clear_filters(kbvh_broad_phase* broad);

/* Point *pairs to the candidates [count][2], in memory of the handle, valid until its next call. */
int kbvh_broad_phase_candidates(kbvh_broad_phase* broad, kbvh_candidate_kind kind, const uint32_t** pairs,
                                size_t* count);
int kbvh_broad_phase_within(kbvh_broad_phase* broad, kbvh_candidate_kind kind, double distance,
                            const uint32_t** pairs, size_t* count);

/* Points *pairs to the pairs of faces [count][2], without a common vertex, that have a common point, exactly;
   patches that cannot touch themselves are left out. In memory of the handle, valid until its next call. */
int kbvh_broad_phase_self_intersections(kbvh_broad_phase* broad, const uint32_t** pairs, size_t* count);

/* Point to the candidates that began and that ended since the last call for this kind, both ascending, in
   memory of the handle, valid until its next call; at the first call all begin. The second function compares
   pairs within a distance instead. */
int kbvh_broad_phase_changes(kbvh_broad_phase* broad, kbvh_candidate_kind kind, const uint32_t** begun,
                             size_t* begun_count, const uint32_t** ended, size_t* ended_count);
int kbvh_broad_phase_changes_within(kbvh_broad_phase* broad, kbvh_candidate_kind kind, double distance,
                                    const uint32_t** begun, size_t* begun_count, const uint32_t** ended,
                                    size_t* ended_count);

/* Finds the first time during the motion from v0 to v1 at which a vertex and a face, or two edges, are within
   the separation (0: touch): exact verdicts. The separation is at most the radius. */
int kbvh_broad_phase_earliest_impact(kbvh_broad_phase* broad, double separation, kbvh_impact* impact);

/* Return by how much coordinates may still change before candidates are detected again, and the number of
   searches since the last build. */
double kbvh_broad_phase_left(const kbvh_broad_phase* broad);
uint64_t kbvh_broad_phase_detections(const kbvh_broad_phase* broad);

#ifdef __cplusplus
}
#endif

#endif
