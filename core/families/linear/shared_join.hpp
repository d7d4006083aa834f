#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/linear/linear_segment.hpp"
#include "core/families/slabs/kernels/slab_spans.hpp"
#include "core/families/wide/shared_front.hpp"
#include "core/parallel/workers.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// The pairs found by a join, in columns; the columns have spare space.
struct JoinedColumns {
  UnfilledArray<std::uint32_t> primitive_a, primitive_b;
  UnfilledArray<float> begin, end;

  /// Returns the columns, with room for some thousand pairs after the first `found`. Only `timed` pairs have
  /// a begin and an end.
  JoinColumns view(std::size_t found, bool timed);
  std::size_t bytes() const;
};

/// From a given index on, keeps only the valid pairs within a body.
void keep_self_columns(const Primitives* neighbours, LeavesOf leaves, JoinColumns& pairs, std::size_t from);

/// The traversals and leaf tests of an interval join on several threads: the same pairs in the same order,
/// and the same number of tests, for any number of threads (SharedFront).
template <class S>
class SharedJoin {
 public:
  /// Starts over, without bodies.
  void start();
  /// Adds a pair of bodies, or a body with itself: `bodies` holds their arrays, ends and leaves.
  /// `neighbours`: pairs that share a vertex are left out.
  void add(const WideLeafJoin<S>& bodies, KernelSet kernels, std::uint32_t padded, bool self,
           const Primitives* neighbours);
  /// Leaves out what slabs separate in the pair of bodies that was added last; `slabs` has no pairs.
  void use_slabs(const SlabSpanPairs<S>& slabs) {
    bodies_.back().slabs = slabs;
    bodies_.back().with_slabs = true;
  }
  /// Joins, and writes the pairs after those of `throughout` and `partly`; adds the box tests made to
  /// `tests`. For each added pair of bodies, `ends` receives the number of pairs found up to and including
  /// that pair.
  struct Ends {
    std::size_t throughout, partly;
  };
  void run(Workers& workers, JoinedColumns& throughout, JoinedColumns& partly, std::vector<Ends>& ends,
           std::uint64_t& tests);
  std::size_t bytes() const;

 private:
  using Batch = SharedFront::Batch;
  struct Bodies {
    WideLeafJoin<S> join;
    KernelSet kernels;
    std::uint32_t padded;
    bool self;
    const Primitives* neighbours;
    SlabSpanPairs<S> slabs{};
    bool with_slabs = false;
  };
  enum Kind : std::uint8_t { of_two, of_one, kinds };  ///< leaves, or bodies
  struct alignas(cache_line) Runner {
    std::vector<std::uint32_t> claimed;
    std::vector<LeafSlot> leaves, own, own_pairs;  ///< of a batch within one body, or that slabs filter
    std::vector<std::uint32_t> masks;              ///< that slabs leave
    JoinedColumns throughout[kinds], partly[kinds];
    std::size_t throughout_count[kinds], partly_count[kinds];
    std::uint64_t tests;
  };
  /// Pairs of a batch: [begin, end) of a runner's columns, and their destination.
  struct Range {
    std::size_t begin, end, to;
  };
  struct Result {
    std::uint32_t runner;
    Range throughout[kinds], partly[kinds];
  };
  void claim_leaves(const Batch& batch, Runner& room);
  void join_leaves(std::size_t batch, std::uint32_t runner);
  void join_some(const Bodies& bodies, const LeafSlot* leaves, std::size_t count, Runner& room, Kind kind,
                 const std::uint32_t* masks, Result& result);
  std::size_t filter_leaves(const Bodies& bodies, std::size_t count, Runner& room);

  std::vector<Bodies> bodies_;
  SharedFront front_;
  std::vector<Runner> runners_;
  std::vector<Result> results_;
};

extern template class SharedJoin<float>;
extern template class SharedJoin<double>;

}  // namespace kbvh
