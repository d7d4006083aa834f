#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/families/wide/shared_front.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// The query of WideQuery on several threads, for stored boxes and current positions: the same pairs in the
/// same order, and the same number of tests, for any number of threads.
///
/// Threads traverse the items of a SharedFront, and compute the boxes of primitives in leaves that they are
/// the first to reach. Then they compare primitives, a batch of leaf pairs at a time.
template <class S>
class SharedQuery {
 public:
  using Side = WideSide<S>;

  /// Makes queries of the bodies of a scene, at the time of the motion.
  SharedQuery(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), motion_(motion) {}

  /// Starts over, without bodies.
  void start() { pairs_.clear(); }
  /// Adds a pair of bodies, or a body with itself, as in WideQuery::run. Fetches all their positions.
  void add(const Side& a, const Side& b) {
    for (const Side* side : {&a, &b})
      if (side->positions == nullptr) motion_.fetch_all(side->body);
    pairs_.push_back({a, b});
  }
  /// Appends the pairs of primitives of all added bodies; adds the box tests made to `tests`.
  void run(Workers& workers, PairBuffer& out, std::uint64_t& tests);
  std::size_t bytes() const;

 private:
  using Batch = SharedFront::Batch;
  struct Bodies {
    Side a, b;
    bool self() const { return a.body == b.body; }
  };
  struct alignas(cache_line) Runner {
    std::vector<std::uint32_t> claimed;
    std::vector<LeafSlot> leaves, own, own_pairs;  ///< of a batch within one body
    std::vector<FoundPair> chunk;
    PairBuffer found, found_own;  ///< of two leaves, or of two bodies, and of one leaf
    std::uint64_t tests = 0;
  };
  /// The pairs of a batch, [begin, end) of a runner's lists, and their place in the answer.
  struct Result {
    std::uint32_t runner;
    std::size_t begin, end, begin_own, end_own, to, to_own;
  };
  /// Number of batches whose pairs one thread copies at once.
  static constexpr std::size_t copied_at_once = 8;
  void claim_leaves(const Batch& batch, Runner& room);
  void compare(std::size_t batch, std::uint32_t runner);
  void copy_found(Workers& workers, PairBuffer& out);
  void append(const Bodies& bodies, const LeafSlot* leaves, std::size_t count, Runner& room,
              PairBuffer& out) {
    append_leaf_pairs(bodies.a, positions(bodies.a), bodies.b, positions(bodies.b), leaves, 0, count,
                      room.chunk, out, room.tests);
  }
  const S* positions(const Side& side) const {
    return side.positions != nullptr ? side.positions : motion_.positions(side.body);
  }

  SceneView<S> scene_;
  SampledMotion<S> motion_;
  std::vector<Bodies> pairs_;
  SharedFront front_;
  std::vector<Runner> runners_;
  std::vector<Result> results_;
};

extern template class SharedQuery<float>;
extern template class SharedQuery<double>;

}  // namespace kbvh
