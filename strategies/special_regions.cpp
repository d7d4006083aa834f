// Refits only where a body deforms: Lau, Chan, Luk & Li (2002) find the regions that a user's edit of a NURBS
// surface moves, and update only their boxes. A control point moves the patches near it and no others, just
// as a vertex moves only its triangles. Here the regions are found once for each segment between keyframes,
// by comparing its two ends: nodes below which nothing moves keep their boxes until the segment ends. Boxes
// are tight, for control nets, polygons and points.
//
// Speed relative to the best refit, measured at 65k triangles: 1.2 where a twentieth of a sheet moves and l =
// 10 (dented_sheet). Where all of a body moves, the search is added to the refit once per segment: 0.84 at l
// = 1, 0.95 to 0.98 at l = 10.
#include <limits>
#include <utility>

#include "core/contract/registry.hpp"
#include "core/families/wide/moving_region.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class SpecialRegions final : public StoredHierarchyStrategy<S>, public AnswersSelfPairs {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;
  SpecialRegions(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                 const Params& params)
      : Base(scene, motion, std::move(topologies), params), motion_(motion), bodies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      auto& hierarchy = this->hierarchies_[body];
      bodies_[body].region.assign(hierarchy, scene.vertex_count(body));
      bodies_[body].moves.assign(hierarchy.node_count(), 0);
      bodies_[body].moved.assign(hierarchy.node_count(), 0);
    }
  }

  void reset_to(double t) override {
    for (Body& body : bodies_) body.end = none;
    Base::reset_to(t);
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const Body& body : bodies_)
      total += body.region.bytes() + body.moves.capacity() + body.moved.capacity();
    return total;
  }

 private:
  static constexpr double none = -std::numeric_limits<double>::infinity();
  struct Body {
    MovingRegion<S> region;
    typename MovingRegion<S>::Marks moves, moved;  ///< in this segment and in the previous one
    double end = none;                             ///< of the segment; none: no segment is known
    bool settled = false;                          ///< nodes that rest in this segment have their boxes
  };

  void update(std::uint32_t index) override {
    Body& body = bodies_[index];
    auto& hierarchy = this->hierarchies_[index];
    if (hierarchy.empty()) return;
    if (!motion_.as_in_the_scene(index)) {  // vertices have their own plans: all may move
      body.end = none;
      this->refit_counted(index);
      return;
    }
    if (!(this->time() < body.end)) {
      const bool continues = body.end != none && body.end == motion_.lines_begin(index);
      enter_segment(index);
      if (!continues) {
        this->refit_counted(index);
        body.settled = true;
        body.region.take(hierarchy, body.moves);
        return;
      }
      // Anything that moved in the previous segment has to reach its end, too.
      for (std::size_t node = 0; node < body.moves.size(); ++node) body.moved[node] |= body.moves[node];
      body.settled = false;
      body.region.take(hierarchy, body.moved);
    } else if (!std::exchange(body.settled, true)) {
      body.region.take(hierarchy, body.moves);
    }
    body.region.refit(hierarchy, this->sampled_.positions(index));
    count_boxes(this->count_, body.region.boxes(), body.region.reads());
  }

  void enter_segment(std::uint32_t index) {
    Body& body = bodies_[index];
    std::swap(body.moves, body.moved);
    body.end = motion_.lines_end(index);
    if (motion_.at_rest(index))
      std::fill(body.moves.begin(), body.moves.end(), 0);
    else
      body.region.mark(this->hierarchies_[index],
                       motion_.positions_on_lines(index, motion_.lines_begin(index), unused_),
                       motion_.positions_on_lines(index, body.end, unused_), body.moves);
  }

  SegmentMotion<S> motion_;
  std::vector<Body> bodies_;
  std::vector<S> unused_;  ///< ends of segments are keyframes, which are stored
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(special_regions) {
  using namespace kbvh;
  return {make_entry<SpecialRegions>({
      .id = "special_regions",
      .title = "refit of deformed regions",
      .family = "lazy",
      .citation = "Lau, Chan, Luk & Li 2002",
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
  })};
}
