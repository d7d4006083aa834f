#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// Returns the rest of a frame's budget for the next pair of bodies, after `tests` box tests.
inline Budget rest_of(const Budget& budget, std::uint64_t tests) {
  return {tests < budget.box_tests ? budget.box_tests - tests : 0};
}

/// The broad phase over bodies: selects the pairs of bodies that a query must visit. Scenes with few pairs
/// are not searched: all their pairs count as near. Scenes with many small bodies have a tree over the
/// bodies' boxes, refitted at each search and rebuilt when the bodies have mixed; a search joins the tree
/// with itself. Time and memory are proportional to bodies and near pairs; if a scene's list of pairs is not
/// sorted, it needs 4 more bytes per pair.
///
/// Boxes are closed and compared exactly. The result does not depend on earlier searches.
class NearBodies {
 public:
  /// `pairs` must outlive this object and stay unchanged.
  NearBodies(std::span<const BodyPair> pairs, std::uint32_t body_count);
  ~NearBodies();
  NearBodies(const NearBodies&) = delete;
  NearBodies& operator=(const NearBodies&) = delete;

  /// Returns false if `find` returns all pairs without reading boxes.
  bool searches() const { return searches_; }

  /// Returns the indices of the pairs whose boxes overlap, and of all pairs within one body, ascending.
  /// `box_of(body)` is a Box<double> that contains the body for as long as the result is used; empty for a
  /// body without primitives. Adds the box tests made to `tests`. Allocates when the tree is rebuilt and when
  /// there are more near pairs than ever before. Valid until the next search.
  template <class BoxOf>
  std::span<const std::uint32_t> find(const BoxOf& box_of, std::uint64_t& tests) {
    if (!searches_) return near_;
    for (std::uint32_t body = 0; body < bodies_; ++body) put(body, box_of(body));
    search(tests);
    return near_;
  }
  /// Returns the result of the last `find`.
  std::span<const std::uint32_t> last() const { return near_; }

  /// Rebuilds the tree at the next search, so that a restarted clip costs the same as the first run.
  void start_over() { build_due_ = true; }

  std::size_t bytes() const;

 private:
  void put(std::uint32_t body, const Box<double>& box);
  void build();
  void search(std::uint64_t& tests);
  void append_pairs(std::uint32_t first, std::uint32_t second);

  std::span<const BodyPair> pairs_;
  std::uint32_t bodies_;
  bool searches_, build_due_ = true, learn_work_ = true;
  std::vector<std::uint32_t> near_;
  // Used only with a search:
  std::vector<std::uint32_t> order_;   ///< pairs of two bodies by first and second; empty: as in the scene
  std::vector<std::uint32_t> begin_;   ///< [first body, and one more]: index of its first pair in that order
  std::vector<std::uint32_t> within_;  ///< pairs within one body
  std::vector<double> corners_;        ///< [body][lower, upper][3], one scalar past the end
  std::vector<std::uint8_t> empty_;    ///< [body]
  Primitives primitives_;              ///< one primitive per body: its two corners
  WideHierarchy<double> tree_;
  WideQuery<double> query_;
  PairBuffer found_;
  std::vector<std::uint64_t> keys_;
  double work_ = 0;  ///< box tests per body and pair when the tree was new
};

}  // namespace kbvh
