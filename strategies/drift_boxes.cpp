// Drifting boxes: positions come frame by frame, without foresight. The known motion of a body is the
// interval, per axis, of its vertices' displacements since the frame in which its boxes were made. Old boxes
// inflated by these intervals contain every vertex; two bodies can only meet where the intervals let their
// old boxes touch. One traversal, over boxes swept over the motion of several frames, therefore finds the
// candidates of all these frames, in the order in which the motion lets them meet, and a frame takes a prefix
// of that list (core/families/drift/near_pairs.hpp). Bodies that cannot meet any other body get one box per
// frame and no boxes below it. Pairs within a body depend on how much the displacements of its own vertices
// differ: a body that moves as a whole keeps its list.
//
// The displacements are found by reading each vertex twice (then and now, in memory order), or, in the
// variant with a bound on steps, by one addition per body. `drift_boxes_approximate` assumes only a share of
// that bound, so it keeps its lists longer than they are valid.

#include "core/contract/registry.hpp"
#include "core/families/drift/drift_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class DriftBoxes final : public DriftStrategy<S, SampledMotion<S>> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  using DriftStrategy<S, SampledMotion<S>>::DriftStrategy;
};

template <class S>
class DriftBoxesBounded final : public DriftStrategy<S, SteppedMotion<S>> {
 public:
  static constexpr Foresight foresight = Foresight::step_bound;
  using DriftStrategy<S, SteppedMotion<S>>::DriftStrategy;
};

/// Assumes less motion than there is.
template <class S>
class DriftBoxesApproximate final : public DriftStrategy<S, SteppedMotion<S>> {
  using Base = DriftStrategy<S, SteppedMotion<S>>;

 public:
  static constexpr Foresight foresight = Foresight::step_bound;
  DriftBoxesApproximate(const SceneView<S>& scene, const SteppedMotion<S>& motion, Topologies topologies,
                        const Params& params)
      : Base(scene, motion, std::move(topologies), params) {
    this->believed_ = params.number("believed");
  }
};

Info drift_info() {
  return {.family = "lazy",
          .citation = "kbvh; lists of neighbours after Verlet 1967",
          .tightness = Tightness::conservative,
          .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
          .parameters = {
              {"lists",
               "tuned",
               {"tuned", "never"},
               "one search for several frames, chosen by a cost model of counts, or one search per frame"},
              {"candidates",
               "boxes",
               {"boxes", "listed"},
               "candidates: listed pairs whose boxes overlap at the frame, as in other queries; or all "
               "listed pairs that may overlap"}}};
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(drift_boxes) {
  using namespace kbvh;
  Info read = drift_info(), bounded = drift_info(), approximate = drift_info();
  read.id = "drift_boxes";
  read.title = "drifting boxes";
  bounded.id = "drift_boxes_bounded";
  bounded.title = "drifting boxes, bounded steps";
  approximate.id = "drift_boxes_approximate";
  approximate.title = "drifting boxes, bound too small";
  approximate.family = "approximate";
  approximate.guarantee = approximate.rays_guarantee = Guarantee::approximate;
  approximate.tightness = Tightness::none;
  approximate.parameters.push_back(
      {"believed",
       "0.5",
       {},
       "share of the bound on the motion of a step that is taken for all of it; 1: "
       "drift_boxes_bounded",
       0,
       1});
  return {make_entry<DriftBoxes>(std::move(read)), make_entry<DriftBoxesBounded>(std::move(bounded)),
          make_entry<DriftBoxesApproximate>(std::move(approximate))};
}
