#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// What is left of a frame's budget for the next pair of bodies, after so many box tests.
inline Budget rest_of(const Budget& budget, std::uint64_t tests) {
  return {tests < budget.box_tests ? budget.box_tests - tests : 0};
}

/// A counting policy that knows box tests and nothing else: what a budget is held against.
struct BoxTests {
  std::uint64_t made = 0;
  void add(Counter counter, std::uint64_t n = 1) {
    if (counter == Counter::box_tests) made += n;
  }
};

/// The broad phase over bodies: which pairs of bodies a query has to look at. Scenes of few pairs are not
/// searched: all their pairs count as near. Scenes of many small bodies have a tree over the bodies' boxes,
/// refitted at each search and built anew when the bodies have mixed; a search joins the tree with itself.
/// Time and memory are in proportion to bodies and near pairs; a scene whose list of pairs is not sorted
/// takes 4 bytes a pair besides.
///
/// Boxes are closed and compared exactly. The result does not depend on earlier searches.
class NearBodies {
 public:
  /// `pairs` must outlive this object and stay as they are.
  NearBodies(std::span<const BodyPair> pairs, std::uint32_t body_count);

  /// False: `find` returns all pairs, and looks at no box.
  bool searches() const { return searches_; }

  /// The indices of the pairs whose boxes overlap, and of all pairs within one body, ascending.
  /// `box_of(body)` is a Box<double> that holds the body for as long as the result is used; empty for a body
  /// without primitives. Adds the box tests made to `tests`. Allocates where the tree is built anew and where
  /// there are more near pairs than ever before. Valid until the next search.
  template <class BoxOf>
  std::span<const std::uint32_t> find(const BoxOf& box_of, std::uint64_t& tests) {
    if (!searches_) return near_;
    for (std::uint32_t body = 0; body < bodies_; ++body) put(body, box_of(body));
    search(tests);
    return near_;
  }
  /// The result of the last `find`.
  std::span<const std::uint32_t> last() const { return near_; }

  /// The next search builds the tree anew, so that a clip that starts over costs what it cost before.
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
  // Only where there is a search:
  std::vector<std::uint32_t> order_;   ///< pairs of two bodies by first and second; empty: as in the scene
  std::vector<std::uint32_t> begin_;   ///< [first body, and one more]: where its pairs begin in that order
  std::vector<std::uint32_t> within_;  ///< pairs within one body
  std::vector<double> corners_;        ///< [body][lower, upper][3], one scalar past the end
  std::vector<std::uint8_t> empty_;    ///< [body]
  Primitives primitives_;              ///< a primitive for each body: its two corners
  WideHierarchy<double> tree_;
  WideQuery<double> query_;
  PairBuffer found_;
  std::vector<std::uint64_t> keys_;
  double work_ = 0;  ///< box tests for each body and pair when the tree was new
};

}  // namespace kbvh
