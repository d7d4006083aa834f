#pragma once
#include <gtest/gtest.h>

#include <vector>

#include "experiments/theory/claim.hpp"

// Every claim both ways: a verdict that no number can change is no verdict.

namespace kbvh::theory {

/// Spoils one number of good data and expects a different verdict, and a different reason.
template <class Run, class Judge, class Spoil>
void expect_flip(const std::vector<Run>& good, Verdict expected, Verdict spoilt, Judge judge, Spoil spoil) {
  const Claim right = judge(good);
  EXPECT_EQ(right.verdict(), expected) << right.id << ": " << right.why;
  std::vector<Run> wrong = good;
  spoil(wrong.back());
  const Claim flipped = judge(wrong);
  EXPECT_EQ(flipped.verdict(), spoilt) << flipped.id << ": " << flipped.why;
}

inline constexpr Verdict holds = Verdict::holds, condition = Verdict::with_condition,
                         fails = Verdict::does_not_hold;

}  // namespace kbvh::theory
