// The kinetic k-DOP tree: the kinetic AABB tree (Z&W 2006, s.4) over k-DOPs (Klosowski et al. 1998). A side
// is a direction instead of an axis; certificates, queue and events are those of the AABB tree. Sides along
// the axes are tight. The other sides follow the projected plans (core/families/events/projected_plan.hpp),
// with a margin for their rounding. Vertices may move on curves of degree 2 or 3: certificates then compare
// polynomials, whose coefficients are projected.

#include "core/contract/registry.hpp"
#include "core/families/events/algebraic_clock.hpp"
#include "core/families/events/kinetic_tree_strategy.hpp"

namespace kbvh {
namespace {

/// In the same order as the forests of OfAnyDop, which has all of them twice.
const std::vector<std::string>& volume_words() {
  static const std::vector<std::string> words{"dop14", "dop18", "dop26"};
  return words;
}

template <class S, int K, class Clock>
using DopForest =
    KineticForest<S, SegmentHeapEventQueue<Clock>, BoundObserver<S>, KineticDop<K>::template Tree>;

/// On lines alone, then on curves.
template <class S, class Lines = EventClock<S>, class Curves = AlgebraicClock<S>>
using OfAnyDop =
    ExactKineticTreeStrategy<S, DopForest<S, 14, Lines>, DopForest<S, 18, Lines>, DopForest<S, 26, Lines>,
                             DopForest<S, 14, Curves>, DopForest<S, 18, Curves>, DopForest<S, 26, Curves>>;

template <class S>
class KineticKdop final : public OfAnyDop<S> {
 public:
  KineticKdop(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
              const Params& params)
      : OfAnyDop<S>(
            scene, motion, std::move(topologies),
            chosen(params.word("volume")) + (any_on_curves(scene, motion) ? volume_words().size() : 0),
            KineticQuery::node_pairs) {}

 private:
  static std::size_t chosen(const std::string& word) {
    const auto& words = volume_words();
    return std::size_t(std::find(words.begin(), words.end(), word) - words.begin());
  }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_kdop) {
  using namespace kbvh;
  return {make_entry<KineticKdop>({
      .id = "kinetic_kdop",
      .title = "kinetic k-DOP tree",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.4; Klosowski et al. 1998 (k-DOPs)",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .declares = {.continuous = true, .time_budget = true, .curves = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"volume", "dop18", volume_words(),
                      "bounding volume of every node: k-DOP with 14, 18 or 26 sides"}},
  })};
}
