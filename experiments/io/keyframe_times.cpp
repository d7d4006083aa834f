#include "experiments/io/keyframe_times.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kbvh::io {
namespace {

constexpr int most_halvings = 12;

class Follower {
 public:
  Follower(const CurvedMotion& motion, double tolerance, std::size_t most)
      : motion_(motion), tolerance_(tolerance), most_(most) {}

  std::optional<KeyframeTimes> run() {
    std::vector<double> before, here;
    for (const double key : motion_.keys) {
      motion_.points(key, here);
      if (!result_.times.empty()) {
        double end = key;
        std::vector<double> arriving = here;
        if (std::binary_search(motion_.jumps.begin(), motion_.jumps.end(), key)) {
          ++result_.jumps;
          end = std::nextafter(key, -std::numeric_limits<double>::infinity());
          motion_.points(end, arriving);
        }
        // A jump may follow its predecessor at the next double; then there is no time in between.
        if (result_.times.back() < end && !pieces(result_.times.back(), before, end, arriving, 0)) return {};
      }
      if (result_.times.empty() || result_.times.back() < key) result_.times.push_back(key);
      if (result_.times.size() > most_) return {};
      before.swap(here);
    }
    return std::move(result_);
  }

 private:
  /// Appends the ends of the pieces from a (not included) to b, which has the points `at_b`.
  bool pieces(double a, const std::vector<double>& at_a, double b, const std::vector<double>& at_b,
              int halvings) {
    const double middle = a + (b - a) / 2;
    std::vector<double> at_middle;
    if (a < middle && middle < b && !straight(a, at_a, b, at_b, middle, at_middle)) {
      if (halvings == most_halvings || result_.times.size() >= most_) return false;
      ++result_.added;
      return pieces(a, at_a, middle, at_middle, halvings + 1) &&
             pieces(middle, at_middle, b, at_b, halvings + 1);
    }
    result_.times.push_back(b);
    return true;
  }

  bool straight(double a, const std::vector<double>& at_a, double b, const std::vector<double>& at_b,
                double middle, std::vector<double>& at_middle) {
    motion_.points(middle, at_middle);
    if (!near_chord(at_a, at_b, (middle - a) / (b - a), at_middle)) return false;
    for (const double t : {a + (middle - a) / 2, middle + (b - middle) / 2}) {
      motion_.points(t, probe_);
      if (!near_chord(at_a, at_b, (t - a) / (b - a), probe_)) return false;
    }
    return true;
  }

  bool near_chord(const std::vector<double>& at_a, const std::vector<double>& at_b, double u,
                  const std::vector<double>& points) const {
    for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
      double square = 0;
      for (std::size_t axis = i; axis < i + 3; ++axis) {
        const double off = points[axis] - ((1 - u) * at_a[axis] + u * at_b[axis]);
        square += off * off;
      }
      if (!(square <= tolerance_ * tolerance_)) return false;
    }
    return true;
  }

  const CurvedMotion& motion_;
  double tolerance_;
  std::size_t most_;
  KeyframeTimes result_;
  std::vector<double> probe_;
};

}  // namespace

std::optional<KeyframeTimes> follow(const CurvedMotion& motion, double tolerance, std::size_t most) {
  return Follower(motion, tolerance, most).run();
}

}  // namespace kbvh::io
