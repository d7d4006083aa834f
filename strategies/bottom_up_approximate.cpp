// Bottom-up refit in a common simplified form: positions interpolated in the scalar's own arithmetic, and
// boxes stored with fewer digits. It shows the benefit of correctly rounded positions and of boxes rounded
// outwards (Z&W 2006, s.2, takes both for granted).

#include <cmath>

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

/// Returns the nearest number of `digits` binary digits, or the next one below. The range of exponents is
/// double's.
double with_digits(double x, int digits, bool down) {
  if (x == 0 || !std::isfinite(x)) return x;
  int exponent = 0;
  const double scaled = std::ldexp(std::frexp(x, &exponent), digits);
  return std::ldexp(down ? std::floor(scaled) : std::nearbyint(scaled), exponent - digits);
}

template <class S>
class BottomUpApproximate final : public FixedPlansHierarchyStrategy<S> {
  using Base = FixedPlansHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  BottomUpApproximate(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                      const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        motion_(motion),
        plain_(params.word("positions") == "plain"),
        digits_(digits_of(params.word("boxes"))),
        outward_(params.word("rounding") == "outward"),
        plain_positions_(scene.body_count()) {}

  void reset_to(double /*t*/) override {
    this->near_bodies_.start_over();
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) {
      this->hierarchies_[body].positions_changed();
      update(body);
    }
  }

 private:
  /// Returns the binary digits of a box's sides; 0: those of the scalar.
  static int digits_of(const std::string& word) {
    const int digits = word == "float" ? 24 : word == "bfloat16" ? 8 : 0;
    return digits < std::numeric_limits<S>::digits ? digits : 0;
  }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    hierarchy.refit(plain_ ? plain_positions(body) : this->sampled_.positions(body));
    if (digits_ == 0) return;
    for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
      Box<S> box = hierarchy.box(node);
      for (int axis = 0; axis < 3; ++axis) {
        box.lower[axis] = S(with_digits(double(box.lower[axis]), digits_, outward_));
        box.upper[axis] = S(-with_digits(-double(box.upper[axis]), digits_, outward_));
      }
      hierarchy.set_box(node, box);
    }
  }

  /// Computes x0 + u (x1 - x0) in the scalar's arithmetic.
  const S* plain_positions(std::uint32_t body) {
    const double t = this->time(), begin = motion_.lines_begin(body), end = motion_.lines_end(body);
    if (!std::isfinite(begin) || !std::isfinite(end) || t <= begin) return this->sampled_.positions(body);
    const S* from = motion_.positions_on_lines(body, begin, room_[0]);
    const S* to = motion_.positions_on_lines(body, end, room_[1]);
    const S u = S((t - begin) / (end - begin));
    std::vector<S>& out = plain_positions_[body];
    out.resize(std::size_t(3) * this->scene_.vertex_count(body) + 1);
    for (std::size_t i = 0; i + 1 < out.size(); ++i) out[i] = from[i] + u * (to[i] - from[i]);
    return out.data();
  }

  SegmentMotion<S> motion_;
  bool plain_;
  int digits_;
  bool outward_;
  std::vector<std::vector<S>> plain_positions_;
  std::vector<S> room_[2];
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_approximate) {
  using namespace kbvh;
  return {make_entry<BottomUpApproximate>({
      .id = "bottom_up_approximate",
      .title = "bottom-up refit, rounded",
      .family = "approximate",
      .citation = "van den Bergen 1997",
      .tightness = Tightness::none,
      .guarantee = Guarantee::approximate,
      .rays_guarantee = Guarantee::approximate,
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"positions",
                      "plain",
                      {"plain", "rounded"},
                      "positions in the boxes: interpolated in the scalar's arithmetic, or correctly rounded "
                      "as in all queries"},
                     {"boxes",
                      "scene",
                      {"scene", "float", "bfloat16"},
                      "binary digits of the boxes: the scalar's, 24 or 8"},
                     {"rounding",
                      "nearest",
                      {"nearest", "outward"},
                      "rounding of boxes with fewer digits than positions"}},
  })};
}
