#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/front/kernels/front.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// The fronts of all pairs of bodies in the tree of tests of their hierarchies (bounding volume test tree),
/// kept from frame to frame. An entry is a pair of nodes with overlapping boxes, and has a bit for each pair
/// of their children that overlaps. One sweep over all children compares the disjoint pairs below the entry
/// and the overlapping ones, from which new entries descend. An entry whose own boxes are apart is dropped,
/// and its parent finds the same bit cleared: the front climbs. If no bit changes, an update reads the
/// entries one after another, and no branch in it is hard to predict.
///
/// A frame is `start_frame`, then `run` for pairs of bodies in ascending order; skipped pairs lose their
/// entries. As long as the topologies stay, the result equals that of WideQuery::run at any time and in any
/// order of times.
template <class S>
class PairFront {
 public:
  using Side = WideSide<S>;

  /// Drops all entries: for new topologies, or to start over.
  void clear();
  void start_frame();
  /// Appends the pairs of primitives whose boxes, and those of all nodes above them, overlap. `body_pair` is
  /// greater than at the last call of the frame. `query` turns pairs of leaves into pairs of primitives. The
  /// stored boxes of both sides must be current. Returns the number of entries that the budget left untested;
  /// if there are any, this pair of bodies starts from scratch next time. Adds the box tests made to `tests`.
  /// Allocates if the front is larger than ever before.
  QueryStatus run(std::uint32_t body_pair, const Side& a, const Side& b, WideQuery<S>& query, PairBuffer& out,
                  std::uint64_t& tests, const Budget& budget = {});

  /// Returns the entries, of all pairs of bodies, after the last query.
  std::span<FrontPair> entries() { return {kept_.data(), kept_count_}; }
  /// Return the numbers of entries made and dropped so far, without those that `clear` dropped.
  std::uint64_t descended() const { return descended_; }
  std::uint64_t climbed() const { return climbed_; }
  std::size_t bytes() const;

 private:
  /// The entries of one pair of bodies.
  struct Part {
    std::uint32_t body_pair;
    std::size_t begin, end;
    std::size_t entries() const { return end - begin; }
  };
  /// Returns the entries of the last frame, and skips those of pairs of bodies that are not queried.
  Part old_part(std::uint32_t body_pair);
  FrontUpdate make_update(const Part& part, std::uint64_t test_limit);
  /// Makes room for the next step, in both arrays of entries, because they are exchanged.
  void grow(FrontUpdate& update);
  void make_room(std::size_t entries);

  std::vector<FrontPair> old_, kept_, stack_;
  std::vector<Part> old_parts_, kept_parts_;
  std::size_t kept_count_ = 0, next_part_ = 0;
  std::vector<LeafSlot> leaf_pairs_;
  std::uint64_t descended_ = 0, climbed_ = 0;
};

extern template class PairFront<float>;
extern template class PairFront<double>;

}  // namespace kbvh
