#include "core/motion/admissible.hpp"

#include <cmath>
#include <stdexcept>

#include "core/base/library_gaps.hpp"

namespace kbvh {

std::string number_text(double value) {
  return shortest_text(value);
}

template <class S>
std::string admissible_text() {
  return sizeof(S) == 4 ? "1e+30 in float" : "1e+100 in double";
}

void check_time(double t, const std::string& what) {
  if (std::abs(t) <= admissible_time) return;
  throw std::invalid_argument(what + " at t = " + number_text(t) + " s" +
                              (std::isfinite(t) ? ": times are limited to 2^900 s, 8e270 s" : ""));
}

template std::string admissible_text<float>();
template std::string admissible_text<double>();

}  // namespace kbvh
