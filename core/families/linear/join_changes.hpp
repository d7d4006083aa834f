#pragma once
#include <span>
#include <vector>

#include "core/contract/queries.hpp"
#include "core/families/linear/triangle_span_filter.hpp"
#include "core/scene/pair_difference.hpp"

namespace kbvh {

/// Answers as changes, from the joins of one segment after another. Within a segment the cost is that of the
/// pairs that begin or end, and of the pairs whose triangles have to be tested at the frame. The first answer
/// in a segment is compared with the last one in an earlier segment: O(pairs), as the join itself.
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
        one.marks[i].for_reported(
            [&](std::uint32_t pair) { one.before.push_back(parts[i].join->primitives_of(pair)); });
    }
  }
  /// Appends the changes since the last call for the same answer. `confirm(pairs)` keeps those of the pairs
  /// that intersect, in their order.
  template <class Confirm>
  void find(Answer answer, std::span<const Part> parts, const Confirm& confirm, PairBuffer& begun,
            PairBuffer& ended) {
    One& one = of_[std::size_t(answer)];
    const bool follows = one.follows;
    if (!follows) after_.clear();
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!follows) touch_members(parts[i], one.marks[i]);
      report(answer, parts[i], one.marks[i], confirm, follows ? begun : after_, ended);
    }
    if (follows) return;
    one.follows = true;
    for (std::size_t i = 0; i < parts.size(); ++i) follow(parts[i], i);
    difference_.find(one.before, after_, begun, ended);
    one.before.clear();
  }

  std::size_t bytes() const {
    std::size_t total =
        (after_.capacity() + to_test_.capacity()) * sizeof(PrimitivePair) + difference_.bytes();
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
    PairBuffer before;             ///< reported in earlier segments, unless the marks follow
  };

  static bool is_candidate(const Part& part, std::uint32_t pair) {
    return part.filter == nullptr ? part.join->overlaps(pair) : part.filter->may_intersect(pair);
  }
  /// In the order of the join, which is similar in the next segment: answers in a similar order are compared
  /// faster.
  static void touch_members(const Part& part, PairMarks& marks) {
    const auto count = std::uint32_t(part.join->pairs().size());
    marks.start(count);
    for (std::uint32_t pair = 0; pair < count; ++pair)
      if (is_candidate(part, pair)) marks.touch(pair);
  }
  void follow(const Part& part, std::size_t i) {
    FollowingMarks marks;
    for (std::size_t answer = 0; answer < 2; ++answer)
      if (of_[answer].follows) marks.of[answer] = &of_[answer].marks[i];
    part.filter == nullptr ? part.join->follow(marks) : part.filter->follow(marks);
  }
  template <class Confirm>
  void report(Answer answer, const Part& part, PairMarks& marks, const Confirm& confirm, PairBuffer& begun,
              PairBuffer& ended) {
    const auto tell = [&](std::uint32_t pair, bool began) {
      (began ? begun : ended).push_back(part.join->primitives_of(pair));
    };
    const auto is_in = [&](std::uint32_t pair) { return is_candidate(part, pair); };
    if (answer == Answer::candidates) return marks.report(is_in, tell);
    test(part, marks, confirm);
    marks.report(
        [&](std::uint32_t pair) {
          return (part.filter != nullptr && part.filter->intersects(pair)) ||
                 (is_in(pair) && marks.is_hit(pair));
        },
        tell);
  }
  /// Tests the triangles of all pairs that are not decided.
  template <class Confirm>
  void test(const Part& part, PairMarks& marks, const Confirm& confirm) {
    to_test_.clear();
    const auto add = [&](std::uint32_t pair) {
      marks.touch(pair);
      to_test_.push_back(part.join->primitives_of(pair));
    };
    part.filter == nullptr ? part.join->for_overlapping(add) : part.filter->for_open(add);
    confirm(to_test_);
    std::size_t next = 0;
    const auto take = [&](std::uint32_t pair) {
      if (next == to_test_.size() || !(to_test_[next] == part.join->primitives_of(pair))) return;
      marks.set_hit(pair);
      ++next;
    };
    part.filter == nullptr ? part.join->for_overlapping(take) : part.filter->for_open(take);
  }

  One of_[2];  ///< [Answer]
  PairBuffer after_, to_test_;
  PairDifference difference_;
};

}  // namespace kbvh
