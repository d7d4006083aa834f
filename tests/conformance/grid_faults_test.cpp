// The suite can fail for the hash grid: in its simplest form, without a fault and with one seeded fault.

#include <gtest/gtest.h>

#include "core/contract/registry.hpp"
#include "core/families/grid/hash_grid.hpp"
#include "tests/conformance/list_faults.hpp"

namespace kbvh::test::grid_faults_test {
namespace {

enum class Fault : std::uint8_t {
  none,
  unmade_boxes,    // boxes are those of the first frame
  lost_primitive,  // the last primitive of each body is not entered
};

template <Fault fault>
struct Seeded {
  template <class S>
  class Strategy : public CountedStrategy<S> {
   public:
    static constexpr Foresight foresight = Foresight::none;
    Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies&, const Params&)
        : CountedStrategy<S>(scene, motion), bodies_(scene.body_count()) {
      for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
        lists_.emplace_back(scene.primitives(body));
        if (fault == Fault::lost_primitive) --lists_.back().count;
      }
    }
    void reset_to(double /*t*/) override {
      for (std::uint32_t body = 0; body < bodies_.size(); ++body) update(body);
    }
    void advance_to(double /*t*/) override {
      if (fault == Fault::unmade_boxes) return;
      for (std::uint32_t body = 0; body < bodies_.size(); ++body) update(body);
    }
    QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
      std::uint64_t tests = 0;
      for (const auto& [first, second] : this->scene_.pairs()) {
        grid_.search(bodies_[first], lists_[first], bodies_[second], lists_[second], tests,
                     [&, first = first, second = second](std::uint32_t a, std::uint32_t b) {
                       out.push_back({first, a, second, b});
                     });
      }
      return {};
    }
    std::size_t bytes() const override { return 0; }

   private:
    void update(std::uint32_t body) {
      bodies_[body].update(this->scene_.primitives(body), lists_[body], this->sampled_.positions(body),
                           active_kernel_set());
    }
    std::vector<GridBody<S>> bodies_;
    std::vector<PrimitiveList> lists_;
    HashGrid<S> grid_{2, active_kernel_set()};
  };
};

template <Fault fault>
void expect_caught(const char* scene) {
  expect_lost_candidates<Seeded<fault>::template Strategy>(scene);
}

TEST(GridFaults, SoundGridsPass) {
  for (const char* const scene : {"soups", "sheets", "four_bodies_own_keyframes"})
    expect_sound_candidates<Seeded<Fault::none>::Strategy>(scene);
}
TEST(GridFaults, BoxesOfTheFirstFrame) {
  expect_caught<Fault::unmade_boxes>("soups");
}
TEST(GridFaults, APrimitiveThatIsNotEntered) {
  expect_caught<Fault::lost_primitive>("soups");
}

}  // namespace
}  // namespace kbvh::test::grid_faults_test
