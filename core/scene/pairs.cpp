#include "core/scene/pairs.hpp"

#include <algorithm>

#include "core/geometry/lane_box.hpp"
#include "core/geometry/triangle_batch.hpp"

namespace kbvh {

namespace {

/// One body of the current pairs as plain pointers, which keeps the loop over pairs short.
template <class S>
struct PairedBody {
  PairedBody(const SceneView<S>& scene, const SampledMotion<S>& motion, std::uint32_t id)
      : body(id),
        polygons(scene.primitives(id).kind == PrimitiveKind::polygons),
        current(motion.all_current(id)),
        primitives(&scene.primitives(id)),
        offsets(primitives->offsets.data()),
        vertices(primitives->vertices.data()),
        positions(motion.positions(id)) {}

  std::span<const std::uint32_t> operator[](std::uint32_t primitive) const {
    return {vertices + offsets[primitive], vertices + offsets[primitive + 1]};
  }
  const S* operator()(std::uint32_t vertex) const { return positions + std::size_t(3) * vertex; }

  std::uint32_t body;
  bool polygons;
  bool current;  ///< no position has to be fetched
  const Primitives* primitives;
  const std::uint32_t* offsets;
  const std::uint32_t* vertices;
  const S* positions;
};

/// The number of pairs tested together: their data stays in the first-level cache, and their indices fit into
/// bytes.
constexpr std::size_t block = 128;

/// Whether positions may have to be fetched, pair by pair.
enum class Positions : std::uint8_t { to_be_fetched, fetched };

/// Up to `block` candidates: pairs of triangles are collected, all others decided one by one.
template <class S>
class CandidateBlock {
 public:
  CandidateBlock(const SceneView<S>& scene, const SampledMotion<S>& motion, TriangleTestStats& stats,
                 Positions positions = Positions::to_be_fetched)
      : scene_(&scene),
        motion_(&motion),
        stats_(&stats),
        fetched_(positions == Positions::fetched),
        kernels_(active_kernel_set()) {}

  /// Returns one byte for each of `count` candidates: 1 if the pair intersects, else 0. The next call
  /// overwrites them.
  const std::uint8_t* intersect(const PrimitivePair* candidates, std::size_t count) {
    size_ = 0;
    for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
      end = begin + same_bodies(candidates + begin, count - begin);
      const PairedBody<S> a(*scene_, *motion_, candidates[begin].body_a);
      const PairedBody<S> b(*scene_, *motion_, candidates[begin].body_b);
      collect(candidates, begin, end, a, b);
    }
    triangles_intersect(std::span<const TrianglePair<S>>(triangles_, size_), verdicts_, *stats_, kernels_);
    if (size_ == count) return verdicts_;
    for (std::size_t k = 0; k < size_; ++k) intersect_[places_[k]] = verdicts_[k];
    return intersect_;
  }

 private:
  /// Returns the number of leading candidates of the same two bodies, most often all of them.
  static std::size_t same_bodies(const PrimitivePair* candidates, std::size_t count) {
    const std::uint32_t body_a = candidates[0].body_a, body_b = candidates[0].body_b;
    std::uint32_t difference = 0;
    for (std::size_t i = 0; i < count; ++i)
      difference |= (candidates[i].body_a ^ body_a) | (candidates[i].body_b ^ body_b);
    if (difference == 0) return count;
    std::size_t same = 1;
    while (candidates[same].body_a == body_a && candidates[same].body_b == body_b) ++same;
    return same;
  }

  void collect(const PrimitivePair* candidates, std::size_t begin, std::size_t end, const PairedBody<S>& a,
               const PairedBody<S>& b) {
    const bool polygons = a.polygons && b.polygons, current = fetched_ || (a.current && b.current);
    std::size_t size = size_;
    for (std::size_t i = begin; i < end; ++i) {
      const auto p = a[candidates[i].primitive_a], q = b[candidates[i].primitive_b];
      if (!current) {
        motion_->fetch(a.body, p);
        motion_->fetch(b.body, q);
      }
      if (polygons && p.size() == 3 && q.size() == 3) {
        triangles_[size] = {{a(p[0]), a(p[1]), a(p[2]), b(q[0]), b(q[1]), b(q[2])}};
        places_[size] = std::uint8_t(i);
        ++size;
      } else {
        intersect_[i] = one_by_one(candidates[i], a, b, polygons) ? 1 : 0;
      }
    }
    size_ = size;
  }

  [[gnu::noinline]] bool one_by_one(const PrimitivePair& pair, const PairedBody<S>& a, const PairedBody<S>& b,
                                    bool polygons) {
    return polygons ? polygons_intersect<S>(a.primitives->triangles(pair.primitive_a), a,
                                            b.primitives->triangles(pair.primitive_b), b, *stats_)
                    : overlap(primitive_box(a[pair.primitive_a], a.positions),
                              primitive_box(b[pair.primitive_b], b.positions));
  }

  const SceneView<S>* scene_;
  const SampledMotion<S>* motion_;
  TriangleTestStats* stats_;
  bool fetched_;
  KernelSet kernels_;
  std::size_t size_ = 0;  // number of triangle pairs
  TrianglePair<S> triangles_[block];
  std::uint8_t places_[block];     // indices of triangle pairs among the candidates
  std::uint8_t verdicts_[block];   // of triangle pairs
  std::uint8_t intersect_[block];  // of candidates
};

/// Moves the pairs among [begin, end) that intersect to `begin` and after, in their order; returns their
/// number.
template <class S>
std::size_t keep_intersecting(CandidateBlock<S>& candidates, PairBuffer& pairs, std::size_t begin,
                              std::size_t end) {
  std::size_t kept = begin;
  for (std::size_t first = begin; first < end; first += block) {
    const std::size_t count = std::min(block, end - first);
    const std::uint8_t* const intersect = candidates.intersect(pairs.data() + first, count);
    // Branchless; a kept pair never moves to a later index.
    for (std::size_t i = 0; i < count; ++i) {
      pairs[kept] = pairs[first + i];
      kept += intersect[i];
    }
  }
  return kept - begin;
}

/// Number of pairs that one thread tests at once: some ten microseconds.
constexpr std::size_t pairs_at_once = 4 * block;

}  // namespace

template <class S>
void confirm_pairs(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
                   TriangleTestStats& stats) {
  CandidateBlock<S> candidates(scene, motion, stats);
  pairs.resize(keep_intersecting(candidates, pairs, 0, pairs.size()));
}

template <class S>
void SharedConfirmation<S>::confirm(const SceneView<S>& scene, const SampledMotion<S>& motion,
                                    PairBuffer& pairs, TriangleTestStats& stats) {
  Workers& workers = motion.workers();
  const Parts cut{pairs.size(), pairs_at_once};
  if (!workers.several() || cut.parts() < 2) return confirm_pairs(scene, motion, pairs, stats);
  fetch(scene, motion, pairs);
  parts_.resize(std::max(parts_.size(), cut.parts()));
  workers.for_each(cut.parts(), [&](std::size_t i, std::uint32_t) {
    TriangleTestStats own;
    CandidateBlock<S> candidates(scene, motion, own, Positions::fetched);
    parts_[i].kept = keep_intersecting(candidates, pairs, cut.begin(i), cut.end(i));
    parts_[i].stats = own;
  });
  std::size_t kept = parts_[0].kept;
  for (std::size_t i = 0; i < cut.parts(); ++i) {
    stats.tests += parts_[i].stats.tests;
    stats.filtered += parts_[i].stats.filtered;
    stats.exact += parts_[i].stats.exact;
    if (i == 0) continue;
    const auto first = pairs.begin() + std::ptrdiff_t(cut.begin(i));
    std::copy(first, first + std::ptrdiff_t(parts_[i].kept), pairs.begin() + std::ptrdiff_t(kept));
    kept += parts_[i].kept;
  }
  pairs.resize(kept);
}

/// Fetches all positions that the tests read: a fetch changes the playback, so threads cannot.
template <class S>
void SharedConfirmation<S>::fetch(const SceneView<S>& scene, const SampledMotion<S>& motion,
                                  const PairBuffer& pairs) {
  bool all_current = true;
  for (std::uint32_t body = 0; body < scene.body_count(); ++body)
    all_current = all_current && motion.all_current(body);
  if (all_current) return;
  for (std::size_t begin = 0, end = 0; begin < pairs.size(); begin = end) {
    const std::uint32_t bodies[2] = {pairs[begin].body_a, pairs[begin].body_b};
    while (end < pairs.size() && pairs[end].body_a == bodies[0] && pairs[end].body_b == bodies[1]) ++end;
    for (int side = 0; side < 2; ++side) {
      if (motion.all_current(bodies[side])) continue;
      const Primitives& primitives = scene.primitives(bodies[side]);
      to_fetch_.clear();
      for (std::size_t i = begin; i < end; ++i) {
        const auto vertices = primitives[side == 0 ? pairs[i].primitive_a : pairs[i].primitive_b];
        for (const std::uint32_t vertex : vertices) to_fetch_.push_back(vertex);
      }
      motion.fetch(bodies[side], to_fetch_);
    }
  }
}

template class SharedConfirmation<float>;
template class SharedConfirmation<double>;
template void confirm_pairs(const SceneView<float>&, const SampledMotion<float>&, PairBuffer&,
                            TriangleTestStats&);
template void confirm_pairs(const SceneView<double>&, const SampledMotion<double>&, PairBuffer&,
                            TriangleTestStats&);

}  // namespace kbvh
