// The suite can fail for the hash grid: in its simplest form, sound and with one seeded fault.

#include <gtest/gtest.h>

#include "core/contract/registry.hpp"
#include "core/families/grid/hash_grid.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test {
namespace {

enum class Fault : std::uint8_t {
  none,
  unmade_boxes,    // boxes are those of the first frame
  lost_primitive,  // the last primitive of each body is not entered
};

template <Fault fault>
struct Seeded {
  template <class S, class Count>
  class Strategy : public CountedStrategy<S, Count> {
   public:
    static constexpr Foresight foresight = Foresight::none;
    Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies&, const Params&)
        : CountedStrategy<S, Count>(scene, motion), bodies_(scene.body_count()) {
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

/// The first violations in float and in double.
template <Fault fault>
std::pair<std::string, std::string> violations(const char* scene) {
  Info info;
  info.id = "faulty";
  info.tightness = Tightness::none;
  info.topology = {.own = true};
  const StrategyEntry entry = make_entry<Seeded<fault>::template Strategy>(info);
  constexpr std::uint32_t l = 7;
  return {check(entry, synthetic_scene<float>(scene, l), l, {}, {}),
          check(entry, synthetic_scene<double>(scene, l), l, {}, {})};
}
template <Fault fault>
void expect_caught(const char* scene) {
  const auto [in_float, in_double] = violations<fault>(scene);
  EXPECT_NE(in_float.find("not among the candidates"), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find("not among the candidates"), std::string::npos) << "in double: " << in_double;
}

TEST(GridFaults, SoundGridsPass) {
  for (const char* const scene : {"soups", "sheets", "four_bodies_own_keyframes"}) {
    const auto [in_float, in_double] = violations<Fault::none>(scene);
    EXPECT_EQ(in_float, "") << scene;
    EXPECT_EQ(in_double, "") << scene;
  }
}
TEST(GridFaults, BoxesOfTheFirstFrame) {
  expect_caught<Fault::unmade_boxes>("soups");
}
TEST(GridFaults, APrimitiveThatIsNotEntered) {
  expect_caught<Fault::lost_primitive>("soups");
}

}  // namespace
}  // namespace kbvh::test
