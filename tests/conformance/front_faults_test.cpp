// The suite can fail for fronts: one in its simplest form, without a fault and with a seeded fault.
// (family_faults_test.cpp: other families.)

#include <gtest/gtest.h>

#include "core/families/front/pair_front.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::front_faults_test {
namespace {

enum class FrontFault : std::uint8_t {
  none,
  no_descent,   // all pairs of children count as met: no entry ever descends again
  wrong_climb,  // pairs of children that are still in the front count as dropped
};

template <FrontFault fault>
struct Fronts {
  template <class S>
  class Strategy : public StoredHierarchyStrategy<S> {
   public:
    static constexpr Foresight foresight = Foresight::none;
    using StoredHierarchyStrategy<S>::StoredHierarchyStrategy;
    QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
      for (FrontPair& entry : front_.entries()) {
        if (fault == FrontFault::no_descent) entry.met = ~std::uint64_t(0);
        if (fault == FrontFault::wrong_climb) entry.met = 0;
      }
      std::uint64_t tests = 0;
      front_.start_frame();
      for (std::uint32_t i = 0; i < this->scene_.pairs().size(); ++i) {
        const BodyPair& pair = this->scene_.pairs()[i];
        front_.run(i, this->side(pair.first), this->side(pair.second), this->query_, out, tests);
      }
      return {};
    }

   private:
    void update(std::uint32_t body) override { this->refit(body); }
    PairFront<S> front_;
  };
};

/// Returns the first violation.
template <class S, FrontFault fault>
std::string violation(const char* scene) {
  Info info;
  info.id = "faulty";
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  return check(make_entry<Fronts<fault>::template Strategy>(info), synthetic_scene<S>(scene, 7), 7, {},
               info.topology.preferred);
}
template <FrontFault fault>
void expect_caught(const std::string& expected) {
  const std::string in_float = violation<float, fault>("soups"),
                    in_double = violation<double, fault>("soups");
  EXPECT_NE(in_float.find(expected), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find(expected), std::string::npos) << "in double: " << in_double;
}

TEST(FrontFaults, SoundFrontsPass) {
  for (const char* const scene : {"soups", "sheets", "plan_changes", "four_bodies_own_keyframes"}) {
    EXPECT_EQ((violation<float, FrontFault::none>(scene)), "") << scene;
    EXPECT_EQ((violation<double, FrontFault::none>(scene)), "") << scene;
  }
}
TEST(FrontFaults, AFrontThatNeverDescendsAgain) {
  expect_caught<FrontFault::no_descent>("not among the candidates");
}
TEST(FrontFaults, AFrontThatClimbsWrongly) {
  expect_caught<FrontFault::wrong_climb>("reported more than once");
}

}  // namespace
}  // namespace kbvh::test::front_faults_test
