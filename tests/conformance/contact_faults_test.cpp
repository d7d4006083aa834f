// The search for contacts can fail: a refit that answers sweeps, in its simplest form, without a fault and
// with a seeded fault. (family_faults_test.cpp: other families.)

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/continuous/contacts.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::contact_faults_test {
namespace {

enum class ContactFault : std::uint8_t {
  none,
  ends_only,  // a sweep considers only the end of the motion
};

/// A refit that answers sweeps by boxes over both ends of the motion.
template <ContactFault fault>
struct Sweeps {
  template <class S>
  class Strategy : public StoredHierarchyStrategy<S>, public AnswersSweeps<S> {
    using Base = StoredHierarchyStrategy<S>;

   public:
    static constexpr Foresight foresight = Foresight::none;
    using Base::Base;

   private:
    void update(std::uint32_t body) override { this->refit(body); }
    void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                          PairBuffer& out) override {
      std::vector<const S*> from(before.begin(), before.end());
      if (fault == ContactFault::ends_only)
        for (std::uint32_t body = 0; body < from.size(); ++body) from[body] = this->sampled_.positions(body);
      this->sweep(from, out);
    }
  };
};

/// Returns how many contacts of a scene the strategy's sweeps miss.
template <class S, ContactFault fault>
std::size_t missed_contacts(const char* name) {
  const auto test = synthetic_scene<S>(name);
  Info info;
  info.id = "faulty";
  info.tightness = Tightness::conservative;
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  const StrategyEntry entry = make_entry<Sweeps<fault>::template Strategy>(info);
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  ContactFinder<S> finder(test.scene);
  Playback<S> playback(test.scene);
  const std::vector<double> knots = overlaid_keyframes(test.scene);
  PhaseTimes ignored;
  std::size_t missed = 0;
  session.reset(knots[0]);
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    playback.seek(knots[k]);
    playback.evaluate_all();
    finder.start(playback);
    playback.seek(knots[k + 1]);
    playback.evaluate_all();
    ContactBuffer truth, found;
    finder.find_all(playback, truth);
    session.contacts(knots[k + 1], found, ignored);
    std::sort(truth.begin(), truth.end());
    std::sort(found.begin(), found.end());
    for (const Contact& contact : truth)
      missed += std::binary_search(found.begin(), found.end(), contact) ? 0 : 1;
  }
  return missed;
}
TEST(ContactFaults, SoundSweepsPass) {
  EXPECT_EQ((missed_contacts<float, ContactFault::none>("soups")), 0u);
  EXPECT_EQ((missed_contacts<double, ContactFault::none>("soups")), 0u);
}
TEST(ContactFaults, SweepsOfTheEndOnly) {
  EXPECT_GT((missed_contacts<float, ContactFault::ends_only>("soups")), 0u);
  EXPECT_GT((missed_contacts<double, ContactFault::ends_only>("soups")), 0u);
}

}  // namespace
}  // namespace kbvh::test::contact_faults_test
