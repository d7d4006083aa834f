#include "experiments/common/steps_left.hpp"

#include <algorithm>
#include <cmath>

namespace kbvh::experiments {

std::string time_left_in_words(double seconds) {
  if (seconds < 0) return {};
  if (seconds < 95)
    return "about " + std::to_string(std::max(10, 10 * int(std::lround(seconds / 10)))) + " s left: ";
  if (seconds < 95 * 60.0) return "about " + std::to_string(std::lround(seconds / 60)) + " min left: ";
  return "about " + std::to_string(std::lround(seconds / 3600)) + " h left: ";
}

void StepsLeft::made(std::uint64_t left, double now) {
  left_ = left;
  if (steps_++ == 0) {
    began_ = last_ = now;
    return;
  }
  const double kept = std::exp(-1 / memory);
  weight_ = kept * weight_ + 1;
  weighted_ = kept * weighted_ + (now - last_);
  last_ = now;
}

double StepsLeft::seconds() const {
  constexpr double least = 3;  // seconds of work, before which an estimate is a guess
  if (weight_ == 0 || last_ - began_ < least) return -1;
  return double(left_) * weighted_ / weight_;
}

}  // namespace kbvh::experiments
