#include "core/broad_phase/broad_phase_c.h"

#include <exception>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <variant>

#include "core/broad_phase/broad_phase.hpp"

using kbvh::BroadPhase;
using kbvh::Candidate;
using kbvh::CandidateBuffer;
using kbvh::CandidateKind;
using kbvh::MatrixView;

struct kbvh_broad_phase {
  std::variant<BroadPhase<float>, BroadPhase<double>> broad;
  CandidateBuffer within;
  std::string error;

  template <class S>
  explicit kbvh_broad_phase(std::in_place_type_t<BroadPhase<S>> type) : broad(type) {}
};

namespace {

template <class S>
MatrixView<S> view(const kbvh_positions& positions) {
  return {static_cast<const S*>(positions.data), positions.rows, 3, positions.row_step,
          positions.column_step};
}

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

void check_pointer(const void* pointer, const char* what) {
  if (pointer == nullptr) throw std::invalid_argument(std::string(what) + " is a null pointer");
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
    const auto e = MatrixView<std::int32_t>::by_rows(edges, edge_count, 2);
    const auto f = MatrixView<std::int32_t>::by_rows(faces, face_count, 3);
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
    broad.update(view<S>(*v), std::span<const std::uint32_t>(moved, count));
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
    hand_over(handle->within, pairs, count);
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
