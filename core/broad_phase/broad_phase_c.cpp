#include "core/broad_phase/broad_phase_c.h"

#include <exception>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"

using kbvh::BroadPhase;
using kbvh::Candidate;
using kbvh::CandidateBuffer;
using kbvh::CandidateChanges;
using kbvh::CandidateKind;
using kbvh::EarliestImpact;
using kbvh::Element;
using kbvh::GroupMask;
using kbvh::InsertedElements;
using kbvh::MatrixView;

struct kbvh_broad_phase {
  std::variant<BroadPhase<float>, BroadPhase<double>> broad;
  CandidateBuffer within;
  std::string error;

  template <class S>
  explicit kbvh_broad_phase(std::in_place_type_t<BroadPhase<S>> type) : broad(type) {}
};

namespace {

/// Calls work(broad phase, S()) and turns exceptions into an error text.
template <class Work>
int guarded(kbvh_broad_phase* handle, const Work& work) {
  if (handle == nullptr) return -1;
  try {
    std::visit([&]<class S>(BroadPhase<S>& broad) { work(broad, S()); }, handle->broad);
    return 0;
  } catch (const std::exception& error) {
    try {
      handle->error = error.what();
    } catch (const std::bad_alloc&) {
      handle->error.clear();
    }
    return -1;
  }
}

CandidateKind checked(kbvh_candidate_kind kind) {
  if (int(kind) < 0 || int(kind) > 5)
    throw std::invalid_argument("a kind of candidates is 0 to 5, not " + std::to_string(int(kind)));
  return CandidateKind(kind);
}

Element checked(kbvh_element element) {
  if (int(element) < 0 || int(element) > 2)
    throw std::invalid_argument("an element is 0 to 2, not " + std::to_string(int(element)));
  return Element(element);
}

void check_pointer(const void* pointer, const char* what) {
  if (pointer == nullptr) throw std::invalid_argument(std::string(what) + " is a null pointer");
}

/// Returns a list of a caller, which may be a null pointer only if it is empty.
template <class T>
std::span<const T> list_of(const T* list, std::size_t count, const char* what) {
  if (count != 0) check_pointer(list, what);
  return {list, count};
}

template <class S>
MatrixView<S> view(const kbvh_positions& positions) {
  if (positions.rows != 0) check_pointer(positions.data, "the data of positions");
  return {static_cast<const S*>(positions.data), positions.rows, 3, positions.row_step,
          positions.column_step};
}

/// Returns the rows of edges or faces, of `columns` vertices each.
MatrixView<std::int32_t> rows_of(const std::int32_t* ids, std::size_t count, std::size_t columns,
                                 const char* what) {
  if (count != 0) check_pointer(ids, what);
  return MatrixView<std::int32_t>::by_rows(ids, count, columns);
}

/// Groups of a caller, in the layout of this library.
std::vector<GroupMask> groups_of(const kbvh_group_mask* groups, std::size_t count) {
  std::vector<GroupMask> list;
  for (const kbvh_group_mask& one : list_of(groups, count, "groups")) list.push_back({one.groups, one.mask});
  return list;
}

void hand_over(std::span<const Candidate> found, const std::uint32_t** pairs, std::size_t* count) {
  *pairs = found.empty() ? nullptr : &found.data()->first;
  *count = found.size();
}

}  // namespace

kbvh_broad_phase* kbvh_broad_phase_new(kbvh_scalar scalar) {
  try {
    if (scalar == KBVH_FLOAT) return new kbvh_broad_phase(std::in_place_type<BroadPhase<float>>);
    if (scalar == KBVH_DOUBLE) return new kbvh_broad_phase(std::in_place_type<BroadPhase<double>>);
  } catch (const std::exception&) {
  }
  return nullptr;
}

void kbvh_broad_phase_free(kbvh_broad_phase* broad) {
  delete broad;
}

const char* kbvh_broad_phase_error(const kbvh_broad_phase* broad) {
  return broad == nullptr ? "the handle is a null pointer" : broad->error.c_str();
}

int kbvh_broad_phase_build(kbvh_broad_phase* handle, const kbvh_positions* v0, const kbvh_positions* v1,
                           const int32_t* edges, size_t edge_count, const int32_t* faces, size_t face_count,
                           double radius) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(v0, "v0");
    const auto e = rows_of(edges, edge_count, 2, "edges"), f = rows_of(faces, face_count, 3, "faces");
    if (v1 == nullptr)
      broad.build(view<S>(*v0), e, f, radius);
    else
      broad.build(view<S>(*v0), view<S>(*v1), e, f, radius);
  });
}

int kbvh_broad_phase_update(kbvh_broad_phase* handle, const kbvh_positions* v0, const kbvh_positions* v1) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(v0, "v0");
    if (v1 == nullptr)
      broad.update(view<S>(*v0));
    else
      broad.update(view<S>(*v0), view<S>(*v1));
  });
}

int kbvh_broad_phase_update_moved(kbvh_broad_phase* handle, const kbvh_positions* v, const uint32_t* moved,
                                  size_t count) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(v, "v");
    broad.update(view<S>(*v), list_of(moved, count, "moved"));
  });
}

int kbvh_broad_phase_valid_for(kbvh_broad_phase* handle, double displacement) {
  return guarded(handle, [&](auto& broad, auto) { broad.valid_for(displacement); });
}

int kbvh_broad_phase_candidates(kbvh_broad_phase* handle, kbvh_candidate_kind kind, const uint32_t** pairs,
                                size_t* count) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(pairs, "pairs");
    check_pointer(count, "count");
    hand_over(broad.candidates(checked(kind)), pairs, count);
  });
}

int kbvh_broad_phase_within(kbvh_broad_phase* handle, kbvh_candidate_kind kind, double distance,
                            const uint32_t** pairs, size_t* count) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(pairs, "pairs");
    check_pointer(count, "count");
    broad.within(checked(kind), distance, handle->within);
    hand_over(span_of(handle->within), pairs, count);
  });
}

int kbvh_broad_phase_self_intersections(kbvh_broad_phase* handle, const uint32_t** pairs, size_t* count) {
  return guarded(handle, [&](auto& broad, auto) {
    check_pointer(pairs, "pairs");
    check_pointer(count, "count");
    broad.self_intersections(handle->within);
    hand_over(span_of(handle->within), pairs, count);
  });
}

int kbvh_broad_phase_insert(kbvh_broad_phase* handle, const kbvh_positions* v, const int32_t* edges,
                            size_t edge_count, const int32_t* faces, size_t face_count, uint32_t first[3]) {
  return guarded(handle, [&]<class S>(BroadPhase<S>& broad, S) {
    check_pointer(first, "first");
    const InsertedElements inserted =
        broad.insert(v == nullptr ? MatrixView<S>() : view<S>(*v), rows_of(edges, edge_count, 2, "edges"),
                     rows_of(faces, face_count, 3, "faces"));
    first[0] = inserted.vertex;
    first[1] = inserted.edge;
    first[2] = inserted.face;
  });
}

int kbvh_broad_phase_remove(kbvh_broad_phase* handle, kbvh_element element, const uint32_t* ids,
                            size_t count) {
  return guarded(handle,
                 [&](auto& broad, auto) { broad.remove(checked(element), list_of(ids, count, "ids")); });
}

int kbvh_broad_phase_set_groups(kbvh_broad_phase* handle, kbvh_element element, const kbvh_group_mask* groups,
                                size_t count) {
  return guarded(handle,
                 [&](auto& broad, auto) { broad.set_groups(checked(element), groups_of(groups, count)); });
}

int kbvh_broad_phase_set_vertex_groups(kbvh_broad_phase* handle, const kbvh_group_mask* groups,
                                       size_t count) {
  return guarded(handle, [&](auto& broad, auto) { broad.set_vertex_groups(groups_of(groups, count)); });
}

int kbvh_broad_phase_exclude(kbvh_broad_phase* handle, kbvh_candidate_kind kind, const uint32_t* pairs,
                             size_t count) {
  return guarded(handle, [&](auto& broad, auto) {
    if (count != 0) check_pointer(pairs, "pairs");
    std::vector<Candidate> list;
    for (std::size_t i = 0; i < count; ++i) list.push_back({pairs[2 * i], pairs[2 * i + 1]});
    broad.exclude(checked(kind), list);
  });
}

int kbvh_broad_phase_use_threads(kbvh_broad_phase* handle, uint32_t threads) {
  return guarded(handle, [&](auto& broad, auto) { broad.use_threads(threads); });
}

int kbvh_broad_phase_exclude_rings(kbvh_broad_phase* handle, uint32_t rings) {
  return guarded(handle, [&](auto& broad, auto) { broad.exclude_rings(rings); });
}

int kbvh_broad_phase_keep_only(kbvh_broad_phase* handle, kbvh_pair_filter filter, void* context) {
  return guarded(handle, [&](auto& broad, auto) {
    if (filter == nullptr) return broad.keep_only({});
    broad.keep_only([filter, context](CandidateKind kind, std::span<Candidate> pairs) {
      return filter(context, kbvh_candidate_kind(int(kind)), &pairs.data()->first, pairs.size());
    });
  });
}

int kbvh_broad_phase_clear_filters(kbvh_broad_phase* handle) {
  return guarded(handle, [&](auto& broad, auto) { broad.clear_filters(); });
}

int kbvh_broad_phase_changes(kbvh_broad_phase* handle, kbvh_candidate_kind kind, const uint32_t** begun,
                             size_t* begun_count, const uint32_t** ended, size_t* ended_count) {
  return guarded(handle, [&](auto& broad, auto) {
    check_pointer(begun, "begun");
    check_pointer(begun_count, "begun_count");
    check_pointer(ended, "ended");
    check_pointer(ended_count, "ended_count");
    const CandidateChanges changes = broad.changes(checked(kind));
    hand_over(changes.begun, begun, begun_count);
    hand_over(changes.ended, ended, ended_count);
  });
}

int kbvh_broad_phase_changes_within(kbvh_broad_phase* handle, kbvh_candidate_kind kind, double distance,
                                    const uint32_t** begun, size_t* begun_count, const uint32_t** ended,
                                    size_t* ended_count) {
  return guarded(handle, [&](auto& broad, auto) {
    check_pointer(begun, "begun");
    check_pointer(begun_count, "begun_count");
    check_pointer(ended, "ended");
    check_pointer(ended_count, "ended_count");
    const CandidateChanges changes = broad.changes_within(checked(kind), distance);
    hand_over(changes.begun, begun, begun_count);
    hand_over(changes.ended, ended, ended_count);
  });
}

int kbvh_broad_phase_earliest_impact(kbvh_broad_phase* handle, double separation, kbvh_impact* impact) {
  return guarded(handle, [&](auto& broad, auto) {
    check_pointer(impact, "impact");
    const EarliestImpact found = broad.earliest_impact(separation);
    *impact = {found.touches ? 1 : 0,
               kbvh_candidate_kind(int(found.kind)),
               {found.pair.first, found.pair.second},
               found.begin,
               found.end};
  });
}

double kbvh_broad_phase_left(const kbvh_broad_phase* handle) {
  if (handle == nullptr) return 0;
  return std::visit([](const auto& broad) { return double(broad.left()); }, handle->broad);
}

uint64_t kbvh_broad_phase_detections(const kbvh_broad_phase* handle) {
  if (handle == nullptr) return 0;
  return std::visit([](const auto& broad) { return broad.detections(); }, handle->broad);
}
