#pragma once
#include <span>
#include <vector>

#include "core/contract/queries.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "core/scene/pair_difference.hpp"

namespace kbvh {

/// Answers as changes, from the joins of one segment after another. Within a segment the cost is that of the
/// pairs that begin or end, and of the pairs whose triangles have to be tested at the frame. The first answer
/// in a segment is compared with the last one in an earlier segment: O(pairs), like the join itself.
template <class S>
class JoinChanges {
 public:
  /// A join of the segment and its span tests, both moved to the frame. Without span tests `filter` is null.
  struct Part {
    IntervalJoin<S>* join;
    TriangleSpanFilter<S>* filter;
  };

  explicit JoinChanges(std::size_t parts) {
    for (One& one : of_) one.marks.resize(parts);
  }
  /// Forgets what was reported.
  void start_over() {
    for (One& one : of_) {
      one.follows = false;
      one.before.clear();
    }
  }
  /// Ends the segment of `parts`, before its joins are replaced.
  void leave_segment(std::span<const Part> parts) {
    for (One& one : of_) {
      if (!one.follows) continue;
      one.follows = false;
      for (std::size_t i = 0; i < parts.size(); ++i)
        append(parts[i], one.before, [&](std::uint32_t pair) { return one.marks[i].is_reported(pair); });
    }
  }
  /// Records that the joins were repaired: a pair may end, and begin again in another place.
  void repaired() {
    for (One& one : of_) one.repaired = true;
  }
  /// Appends the changes since the last call for the same answer. Pairs need span tests in every part.
  /// `confirm(pairs)` keeps those that intersect, in their order.
  template <class Confirm>
  void find(Answer answer, std::span<const Part> parts, const Confirm& confirm, PairBuffer& begun,
            PairBuffer& ended) {
    One& one = of_[std::size_t(answer)];
    if (!one.follows) after_.clear();
    const bool again = one.follows && one.repaired;
    one.repaired = false;
    again_begun_.clear();
    again_ended_.clear();
    PairBuffer &begins = again ? again_begun_ : begun, &ends = again ? again_ended_ : ended;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      PairMarks& marks = one.marks[i];
      if (!one.follows) marks.start(parts[i].join->pairs().size());
      if (answer == Answer::pairs) test(parts[i], marks, confirm);
      const auto is_in = [&](std::uint32_t pair) {
        if (answer == Answer::candidates) return is_candidate(parts[i], pair);
        return parts[i].filter->intersects(pair) || marks.is_hit(pair);
      };
      // In the order of the join, which is similar in the next segment: answers in a similar order are
      // compared faster.
      if (!one.follows)
        append(parts[i], after_, [&](std::uint32_t pair) { return is_in(pair) && marks.set_reported(pair); });
      marks.report(is_in, [&](std::uint32_t pair, bool began) {
        (began ? begins : ends).push_back(parts[i].join->primitives_of(pair));
      });
    }
    if (again) difference_.find(again_ended_, again_begun_, begun, ended);
    if (one.follows) return;
    one.follows = true;
    for (std::size_t i = 0; i < parts.size(); ++i) follow(parts[i], i);
    difference_.find(one.before, after_, begun, ended);
    one.before.clear();
  }

  std::size_t bytes() const {
    std::size_t total =
        (after_.capacity() + to_test_.capacity() + again_begun_.capacity() + again_ended_.capacity()) *
            sizeof(PrimitivePair) +
        difference_.bytes();
    for (const One& one : of_) {
      total += one.before.capacity() * sizeof(PrimitivePair);
      for (const PairMarks& marks : one.marks) total += sizeof marks + marks.bytes();
    }
    return total;
  }

 private:
  /// The changes of one kind of answer.
  struct One {
    std::vector<PairMarks> marks;  ///< [part]
    bool follows = false;          ///< the marks belong to the current segment
    bool repaired = false;         ///< since the last answer
    PairBuffer before;             ///< reported in earlier segments, unless the marks follow
  };

  static bool is_candidate(const Part& part, std::uint32_t pair) {
    return part.filter == nullptr ? part.join->overlaps(pair) : part.filter->may_intersect(pair);
  }
  /// Appends the pairs that `is_in` selects, in the order of their discovery.
  template <class IsIn>
  static void append(const Part& part, PairBuffer& out, const IsIn& is_in) {
    std::size_t size = out.size();
    out.resize(size + part.join->pairs().size());
    part.join->for_found([&](std::uint32_t pair) {
      if (is_in(pair)) out[size++] = part.join->primitives_of(pair);
    });
    out.resize(size);
  }
  void follow(const Part& part, std::size_t i) {
    FollowingMarks marks;
    for (std::size_t answer = 0; answer < 2; ++answer)
      if (of_[answer].follows) marks.of[answer] = &of_[answer].marks[i];
    part.filter == nullptr ? part.join->follow(marks) : part.filter->follow(marks);
  }
  /// Tests the triangles of all pairs that are not decided.
  template <class Confirm>
  void test(const Part& part, PairMarks& marks, const Confirm& confirm) {
    to_test_.clear();
    part.filter->for_open([&](std::uint32_t pair) {
      marks.touch(pair);
      to_test_.push_back(part.join->primitives_of(pair));
    });
    confirm(to_test_);
    std::size_t next = 0;
    part.filter->for_open([&](std::uint32_t pair) {
      if (next == to_test_.size() || !(to_test_[next] == part.join->primitives_of(pair))) return;
      marks.set_hit(pair);
      ++next;
    });
  }

  One of_[2];  ///< [Answer]
  PairBuffer after_, to_test_, again_begun_, again_ended_;
  PairDifference difference_;
};

}  // namespace kbvh
