// Prints a hash of all answers of this program's own strategies on the synthetic scenes: positions, pairs,
// boxes. Answers must be the same to the last bit for all compilers and machines: the sets of kernels and the
// numbers of threads are compared here, compilers and flags by comparing the output (compare).

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>

#include "core/base/hasher.hpp"
#include "core/judge/follow_script.hpp"
#include "core/judge/verify.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/support/synthetic_scenes.hpp"

#if defined(KBVH_TEST_HAS_TBB)
#include <tbb/global_control.h>
#endif

namespace kbvh::test {
namespace {

#if defined(KBVH_TEST_HAS_TBB)
// Allows four threads on machines with fewer cores, too; set before the registry states its parameters.
const tbb::global_control four(tbb::global_control::max_allowed_parallelism, 4);
#endif

using Params = std::map<std::string, std::string>;

template <class S>
void add_frame(Session<S>& session, Hasher& hasher) {
  PairBuffer pairs;
  PhaseTimes ignored;
  session.query(pairs, ignored);
  std::sort(pairs.begin(), pairs.end());
  for (const PrimitivePair& pair : pairs)
    for (const std::uint32_t id : {pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b})
      hasher.mix(id);
  hasher.mix(pairs.size());
  session.playback().evaluate_all();
  for (std::uint32_t body = 0; body < session.scene().bodies.size(); ++body) {
    hasher.bytes(session.playback().positions(body),
                 std::size_t(3) * session.scene().bodies[body].plans.vertex_count() * sizeof(S));
    const auto view = session.strategy().audit_view(body);
    if (!view) continue;
    for (std::size_t node = 0; node < view->boxes.size(); ++node) {
      if (!view->stale.empty() && view->stale[node]) continue;
      // Zeros of either sign count as the same number.
      for (int axis = 0; axis < 3; ++axis)
        for (const double bound : {view->boxes[node].lower[axis] + 0.0, view->boxes[node].upper[axis] + 0.0})
          hasher.bytes(&bound, sizeof bound);
    }
  }
}

template <class S>
std::uint64_t hash_of(const StrategyEntry& entry, const std::vector<std::string>& scenes,
                      const Params& params) {
  Hasher hasher;
  for (const std::string& name : scenes) {
    const TestScene<S> test = synthetic_scene<S>(name, 7);
    if (test.script.changes_plans() && !entry.info.can.plan_changes) continue;
    const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 7) : test.frames;
    Session<S> session(test.scene, {&entry, params, entry.info.topology.preferred});
    ScriptCursor<S> cursor(test.script.empty() ? nullptr : &test.script);
    PhaseTimes ignored;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (f == 0)
        session.reset(frames[0]);
      else
        session.advance(frames[f], ignored);
      add_frame(session, hasher);
      follow(session, cursor.at(frames[f]), ignored);
    }
  }
  return hasher.value();
}

template <class S>
bool print(const StrategyEntry& entry, const std::vector<std::string>& scenes, const char* scalar) {
  if (entry.factory<S>() == nullptr) return true;
  use_kernel_set(KernelSet::portable);
  const std::uint64_t expected = hash_of<S>(entry, scenes, {});
  std::printf("%-24s %-6s %016" PRIx64 "\n", entry.info.id.c_str(), scalar, expected);
  bool same = true;
  const auto expect = [&](const Params& params, const std::string& how) {
    const std::uint64_t found = hash_of<S>(entry, scenes, params);
    if (found == expected) return;
    std::fprintf(stderr, "%s, %s, %s: %016" PRIx64 "\n", entry.info.id.c_str(), scalar, how.c_str(), found);
    same = false;
  };
  for (const KernelSet set : supported_kernel_sets()) {
    if (set == KernelSet::portable) continue;
    use_kernel_set(set);
    expect({}, name(set));
  }
  use_kernel_set(KernelSet::portable);
  for (const Parameter& parameter : entry.info.parameters)
    for (const std::string& word : parameter.allowed)
      if (word != parameter.default_value)
        std::printf("%-24s %-6s %016" PRIx64 " %s=%s\n", entry.info.id.c_str(), scalar,
                    hash_of<S>(entry, scenes, {{parameter.name, word}}), parameter.name.c_str(),
                    word.c_str());
  for (const Parameter& parameter : entry.info.parameters)
    for (const int threads : {2, 4})
      if (parameter.name == "threads" && parameter.most >= threads)
        expect({{"threads", std::to_string(threads)}}, std::to_string(threads) + " threads");
  return same;
}

int run() {
  const std::vector<std::string> scenes{"soups", "sheets", "integer_ties", "four_bodies_own_keyframes",
                                        "plan_changes"};
  bool same = true;
  for (const StrategyEntry& entry : registry()) {
    // Peers have their own hierarchies; the all-pairs contestants have none.
    if (entry.info.topology.own || entry.info.guarantee == Guarantee::approximate) continue;
    same &= print<float>(entry, scenes, "float");
    same &= print<double>(entry, scenes, "double");
  }
  return same ? 0 : 1;
}

}  // namespace
}  // namespace kbvh::test

int main() {
  return kbvh::test::run();
}
