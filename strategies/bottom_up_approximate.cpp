// Bottom-up refits that trade exactness for speed: common shortcuts of real programs, each with a dial. They
// show what exactness costs and what it is worth (Z&W 2006, s.2, takes correctly rounded positions and valid
// boxes for granted). Refit, query and triangle tests are those of the fastest exact refits (`bottom_up`, and
// `leaf_slabs` with query = slabs); with every dial at zero (refit_every = 1, margin = 0, boxes = scene or
// rounding = outward, positions = rounded) the answers are exact.
//
// `reduced_refit` makes boxes at every n-th frame only, inflates them by a margin, and rounds them. Between
// two refits the boxes of nodes are stale; those of triangles are current, as in all queries here, and
// positions are evaluated where the query reads them. `bottom_up_approximate` interpolates positions in the
// scalar's own arithmetic, by one multiplication, instead of rounding them correctly. With tests = own the
// query and the triangle tests read these positions, too, like programs that have no others; it then also
// reports pairs that do not intersect. Boxes with fewer digits are stored in the scalar, so smaller boxes
// save no memory here and cost an extra pass: their time is an upper bound.
//
// When it wins: hardly ever. Where there are contacts most time goes to the query, and a margin costs more
// tests than rarer refits save: on a tablecloth of 4k triangles (float, l = 10) the refit is 1 to 3 % of a
// frame, and boxes of every 8th frame miss 0.3 % of the pairs. On passing spheres of 41k triangles boxes of
// every 8th frame halve the time, positions included, and miss 79 % of the pairs (Intel Xeon, a busy
// machine).

#include <algorithm>
#include <cmath>

#include "core/contract/registry.hpp"
#include "core/families/slabs/slab_strategy.hpp"
#include "core/families/wide/kernels/reduce.hpp"
#include "core/geometry/triangle_batch.hpp"

namespace kbvh {
namespace {

/// Implements the dials for boxes: `boxes`, `rounding`, `refit_every`, `margin`, `query`. A derived class may
/// use other positions.
template <class S, class Base>
class ReducedBase : public SlabStrategy<S, Base> {
 public:
  ReducedBase(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
              const Params& params)
      : SlabStrategy<S, Base>(scene, motion, std::move(topologies), params),
        dropped_(dropped_digits(params.word("boxes"))),
        outward_(params.word("rounding") == "outward"),
        refit_every_(std::uint64_t(params.number("refit_every"))),
        margin_(params.number("margin")) {
    if (params.word("query") != "slabs") std::fill(this->accepted_.begin(), this->accepted_.end(), 0);
  }

  void reset_to(double /*t*/) override {
    this->plans_changed_ = false;
    this->near_bodies_.start_over();
    this->probes_.start_over();
    frame_ = 0;
    margins_.clear();
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) {
      positions_changed(body);
      margins_.push_back(margin_ > 0 ? S(margin_ * mean_edge(body)) : S(0));
      update(body);
    }
  }

  void advance_to(double /*t*/) override {
    const bool due = ++frame_ % refit_every_ == 0;
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) {
      if (!this->scene_.moving(body) && !this->plans_changed_) continue;
      positions_changed(body);
      if (due) update(body);
    }
  }

 protected:
  /// Returns how many binary digits fewer than the scalar numbers of this kind have.
  static unsigned dropped_digits(const std::string& word) {
    const int digits = word == "float" ? 24 : word == "bfloat16" ? 8 : std::numeric_limits<S>::digits;
    return unsigned(std::numeric_limits<S>::digits - std::min(digits, std::numeric_limits<S>::digits));
  }
  /// Returns all positions of a body from which boxes are made.
  virtual const S* positions_of_boxes(std::uint32_t body) { return scene_positions(body); }
  const S* scene_positions(std::uint32_t body) override {
    this->sampled_.fetch_all(body);
    return this->sampled_.positions(body);
  }
  /// Called when a body may have moved.
  virtual void positions_changed(std::uint32_t body) {
    this->hierarchies_[body].positions_changed();
    this->blocks_[body].positions_changed();
  }

  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    hierarchy.refit(positions_of_boxes(body));
    this->count_refit(body);
    const S margin = margins_[body];
    if (dropped_ == 0 && margin == 0) return;
    const ReduceKernels<S>& kernels = reduce_kernels<S>(hierarchy.kernels());
    const WideArrays<S> arrays = hierarchy.arrays();
    const auto reduce = [&](S* rows, std::size_t count) {
      if (margin != 0) kernels.widen(rows, count, margin);
      if (dropped_ != 0) (outward_ ? kernels.down : kernels.nearest)(rows, count, dropped_);
    };
    reduce(arrays.child_bounds, lane_scalars(hierarchy.width()) * hierarchy.node_count());
    for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node) {
      S* const box = arrays.node_bounds + std::size_t(8) * node;
      S rows[6] = {box[0], box[1], box[2], -box[4], -box[5], -box[6]};
      reduce(rows, 6);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box[axis] = rows[axis];
        box[axis + 4] = -rows[axis + 3];
      }
    }
  }

 private:
  /// Returns the mean length of the edges of a body's primitives; 0 without edges.
  double mean_edge(std::uint32_t body) {
    const Primitives& primitives = this->scene_.primitives(body);
    const S* positions = positions_of_boxes(body);
    double sum = 0;
    std::uint64_t edges = 0;
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const auto corners = primitives[p];
      for (std::size_t i = 0; corners.size() > 1 && i < corners.size(); ++i, ++edges) {
        const S* const a = positions + std::size_t(3) * corners[i];
        const S* const b = positions + std::size_t(3) * corners[(i + 1) % corners.size()];
        sum +=
            std::hypot(double(a[0]) - double(b[0]), double(a[1]) - double(b[1]), double(a[2]) - double(b[2]));
      }
    }
    return edges > 0 ? sum / double(edges) : 0;
  }

 protected:
  unsigned dropped_;

 private:
  bool outward_;
  std::uint64_t refit_every_, frame_ = 0;
  double margin_;
  std::vector<S> margins_;  ///< [body], units of the scene
};

template <class S>
class ReducedRefit final : public ReducedBase<S, StoredHierarchyStrategy<S>>, public AnswersSelfPairs {
 public:
  static constexpr Foresight foresight = Foresight::none;
  using ReducedBase<S, StoredHierarchyStrategy<S>>::ReducedBase;
};

template <class S>
class BottomUpApproximate final : public ReducedBase<S, FixedPlansHierarchyStrategy<S>> {
  using Base = ReducedBase<S, FixedPlansHierarchyStrategy<S>>;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  BottomUpApproximate(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                      const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        motion_(motion),
        plain_(params.word("positions") == "plain"),
        own_tests_(params.word("tests") == "own"),
        own_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      own_[body].resize(std::size_t(3) * scene.vertex_count(body) + 1);
  }

  void confirm_candidates(double t, PairBuffer& pairs) override {
    if (!own_tests_) return Base::confirm_candidates(t, pairs);
    std::size_t kept = 0;
    for (std::size_t begin = 0; begin < pairs.size(); begin += block) {
      const std::size_t count = std::min(block, pairs.size() - begin);
      std::size_t size = 0;
      for (std::size_t i = 0; i < count; ++i) decide(pairs[begin + i], i, size);
      triangles_intersect(std::span<const TrianglePair<S>>(triangles_, size), verdicts_,
                          this->triangle_stats_);
      for (std::size_t k = 0; k < size; ++k) intersect_[places_[k]] = verdicts_[k];
      for (std::size_t i = 0; i < count; ++i) {
        pairs[kept] = pairs[begin + i];
        kept += intersect_[i];
      }
    }
    pairs.resize(kept);
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const std::vector<S>& positions : own_) total += positions.capacity() * sizeof(S);
    return total;
  }

 private:
  static constexpr std::size_t block = 128;

  void positions_changed(std::uint32_t body) override {
    Base::positions_changed(body);
    if (own_tests_) make_own(body);
  }
  const S* positions_of_boxes(std::uint32_t body) override {
    if (own_tests_) return own_[body].data();
    return plain_ ? make_own(body) : Base::positions_of_boxes(body);
  }
  const S* own_positions(std::uint32_t body) const override {
    return own_tests_ ? own_[body].data() : nullptr;
  }

  /// Computes x0 + u (x1 - x0) in the scalar's arithmetic, or takes the scene's positions. Rounds them like
  /// the boxes if the query and the triangle tests read them, too.
  const S* make_own(std::uint32_t body) {
    std::vector<S>& out = own_[body];
    const ReduceKernels<S>& kernels = reduce_kernels<S>(this->hierarchies_[body].kernels());
    const double t = this->time(), begin = motion_.lines_begin(body), end = motion_.lines_end(body);
    if (!plain_ || !std::isfinite(begin) || !std::isfinite(end) || t <= begin) {
      const S* const positions = Base::positions_of_boxes(body);
      if (!own_tests_) return positions;
      std::copy_n(positions, out.size() - 1, out.data());
    } else {
      const S* const from = motion_.positions_on_lines(body, begin, room_[0]);
      const S* const to = motion_.positions_on_lines(body, end, room_[1]);
      kernels.interpolate(from, to, S((t - begin) / (end - begin)), out.data(), out.size() - 1);
    }
    if (own_tests_ && this->dropped_ != 0) kernels.nearest(out.data(), out.size() - 1, this->dropped_);
    return out.data();
  }

  /// Adds a pair of triangles to the block, or decides a pair of other primitives at once.
  void decide(const PrimitivePair& pair, std::size_t i, std::size_t& size) {
    const Primitives &a = this->scene_.primitives(pair.body_a), &b = this->scene_.primitives(pair.body_b);
    const auto p = a[pair.primitive_a], q = b[pair.primitive_b];
    const auto at = [&](std::uint32_t body) {
      return [positions = own_[body].data()](std::uint32_t v) { return positions + std::size_t(3) * v; };
    };
    const auto x = at(pair.body_a), y = at(pair.body_b);
    if (a.kind != PrimitiveKind::polygons || b.kind != PrimitiveKind::polygons) {
      intersect_[i] = 1;  // the query compared their boxes
    } else if (p.size() == 3 && q.size() == 3) {
      triangles_[size] = {{x(p[0]), x(p[1]), x(p[2]), y(q[0]), y(q[1]), y(q[2])}};
      places_[size++] = std::uint8_t(i);
    } else {
      intersect_[i] = polygons_intersect<S>(a.triangles(pair.primitive_a), x, b.triangles(pair.primitive_b),
                                            y, this->triangle_stats_)
                          ? 1
                          : 0;
    }
  }

  SegmentMotion<S> motion_;
  bool plain_, own_tests_;
  std::vector<std::vector<S>> own_;  ///< [body][vertex][3], and one for reads of four
  std::vector<S> room_[2];
  TrianglePair<S> triangles_[block];
  std::uint8_t places_[block], verdicts_[block], intersect_[block];
};

Info reduced_info() {
  return {
      .family = "approximate",
      .citation = "van den Bergen 1997",
      .tightness = Tightness::none,
      .guarantee = Guarantee::approximate,
      .rays_guarantee = Guarantee::approximate,
      .positions = PositionUse::fetched,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {
          {"boxes",
           "scene",
           {"scene", "float", "bfloat16"},
           "binary digits of the boxes: the scalar's, 24 or 8"},
          {"rounding",
           "nearest",
           {"nearest", "outward"},
           "rounding of boxes with fewer digits than positions"},
          {"refit_every",
           "1",
           {},
           "number of frames after which boxes are made again; in between they are stale",
           1,
           1e9,
           Numbers::whole},
          {"margin", "0", {}, "inflation of all boxes on every side, in mean edge lengths of the body"},
          {"query",
           "boxes",
           {"boxes", "slabs"},
           "comparison of two leaves: the boxes of their primitives, as in bottom_up, or slabs, too, as in "
           "leaf_slabs"}}};
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_approximate) {
  using namespace kbvh;
  Info reduced = reduced_info(), rounded = reduced_info();
  reduced.id = "reduced_refit";
  reduced.title = "stale or inflated boxes";
  rounded.id = "bottom_up_approximate";
  rounded.title = "bottom-up refit, rounded";
  rounded.parameters.insert(
      rounded.parameters.begin(),
      {{"positions",
        "plain",
        {"plain", "rounded"},
        "positions in the boxes: interpolated in the scalar's arithmetic, or correctly rounded as in all "
        "queries"},
       {"tests",
        "exact",
        {"exact", "own"},
        "positions that query and triangle tests read: correctly rounded ones, or those of the boxes, with "
        "the "
        "digits of the boxes"}});
  return {make_entry<ReducedRefit>(std::move(reduced)), make_entry<BottomUpApproximate>(std::move(rounded))};
}
