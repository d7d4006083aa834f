// Bottom-up refit of any bounding volume, written once over the concept BoundingVolume
// (core/geometry/volumes/bounding_volume.hpp): it isolates the effect of the kind of volume. With boxes it is
// a simple refit of a stored tree; `bottom_up` is the fast one.

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/volumes/volume_strategy.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/geometry/volumes/obb.hpp"
#include "core/geometry/volumes/sphere.hpp"

namespace kbvh {
namespace {

/// In the same order as the volumes of BottomUpVolumes.
const std::vector<std::string>& volume_words() {
  static const std::vector<std::string> words{"aabb", "dop14", "dop18", "dop26", "sphere", "obb"};
  return words;
}

std::size_t chosen_volume(const Params& params) {
  const auto& words = volume_words();
  return std::size_t(std::find(words.begin(), words.end(), params.word("volume")) - words.begin());
}

template <class S>
class BottomUpVolumes final
    : public VolumeStrategy<S, Box<S>, Dop<S, 14>, Dop<S, 18>, Dop<S, 26>, Sphere<S>, Obb<S>> {
  using Base = VolumeStrategy<S, Box<S>, Dop<S, 14>, Dop<S, 18>, Dop<S, 26>, Sphere<S>, Obb<S>>;

 public:
  BottomUpVolumes(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                  const Params& params)
      : Base(scene, motion, std::move(topologies), chosen_volume(params)) {}
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_volumes) {
  using namespace kbvh;
  return {make_entry<BottomUpVolumes>({
      .id = "bottom_up_volumes",
      .title = "refit of any volume",
      .family = "volumes",
      .citation = "Klosowski et al. 1998 (k-DOPs); Ritter 1990 (spheres); Gottschalk et al. 1996, Larsson & "
                  "Källberg 2011 (oriented boxes)",
      // Boxes and k-DOPs over polygons are tight; spheres and oriented boxes are only large enough.
      .tightness = Tightness::conservative,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
      .parameters =
          {{"volume", "aabb", volume_words(),
            "bounding volume of every node: axis-aligned box, k-DOP with 14, 18 or 26 sides, sphere, "
            "oriented box"}},
  })};
}
