// The program with its own list of strategies, as an external project links it: one correct strategy and some
// faulty ones, to check that the program refuses them a time and reports it.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <new>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "experiments/cli/program.hpp"

namespace kbvh {
namespace {

enum class Fault {
  none,
  loses_a_pair,
  repeats_a_pair,
  throws,
  needs_memory,
  aborts,
  works_in_reset,
  works_in_first_query,
  lazy_when_timed,
  lazy_unless_judged
};

/// Works for 30 ms.
void work() {
  const auto begin = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(30)) {
  }
}

/// Every pair of primitives is a candidate, except for the fault.
template <class S, Fault fault>
class EveryPair : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  EveryPair(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies, const Params&)
      : Strategy<S>(scene, motion) {}
  void reset_to(double) override {
    ++plays_;
    frame_ = 0;
    confirmed_ = -2;
    if (fault == Fault::works_in_reset) work();
  }
  void advance_to(double) override {
    ++frame_;
    if (fault == Fault::throws) throw std::runtime_error("out of luck");
    if (fault == Fault::aborts && ++advances_ > number_of("KBVH_TEST_ABORT", 1000)) std::abort();
    if (fault == Fault::needs_memory && ++advances_ > memory_for()) {
      if (memory_for() < 0) std::terminate();
      throw std::bad_alloc();
    }
  }
  QueryStatus find_candidates(double, PairBuffer& out, const Budget&) override {
    if (fault == Fault::works_in_first_query && frame_ == 0) work();
    for (const BodyPair& pair : this->scene_.pairs())
      for (std::uint32_t a = 0; a < this->scene_.primitives(pair.first).count(); ++a)
        for (std::uint32_t b = 0; b < this->scene_.primitives(pair.second).count(); ++b)
          out.push_back({pair.first, a, pair.second, b});
    if (fault == Fault::repeats_a_pair && !out.empty()) out.push_back(out.front());
    return {};
  }
  void confirm_candidates(double t, PairBuffer& pairs) override {
    Strategy<S>::confirm_candidates(t, pairs);
    const bool loses = fault == Fault::loses_a_pair || (fault == Fault::lazy_when_timed && is_timed()) ||
                       (fault == Fault::lazy_unless_judged && confirmed_ + 1 == frame_);
    if (loses && !pairs.empty()) pairs.pop_back();
    confirmed_ = frame_;
  }
  std::size_t bytes() const override { return 0; }

 protected:
  /// A timed instance plays several times, other instances once.
  bool is_timed() const { return plays_ > 1; }

 private:
  /// The number of advances before memory runs out. Below 0 there is none left to throw either, and the
  /// strategy terminates the program, as Embree can.
  static int memory_for() { return number_of("KBVH_TEST_MEMORY", 0); }
  static int number_of(const char* variable, int otherwise) {
    const char* said = std::getenv(variable);
    return said == nullptr ? otherwise : std::atoi(said);
  }
  int advances_ = 0, plays_ = 0;
  int frame_ = 0, confirmed_ = -2;  ///< the current frame, and the last one whose pairs were confirmed
};

/// Answers the other queries, too: no ray hits anything, and every pair may touch.
template <class S, Fault fault>
class EveryAnswer : public EveryPair<S, fault>, public AnswersProbes<S>, public AnswersSweeps<S> {
 public:
  using EveryPair<S, fault>::EveryPair;
  void answer_probes(double, const Probes<S>& probes) override {
    const bool wrong = fault == Fault::lazy_when_timed && this->is_timed();
    if (const auto* rays = std::get_if<RayProbes<S>>(&probes)) {
      std::fill(rays->hits.begin(), rays->hits.end(), RayHit{});
      if (wrong) rays->hits[0] = {0, 0, 1};
    } else if (wrong) {
      std::get<BallProbes<S>>(probes).found->push_back({0, 0, 0});
    }
  }
  void find_swept_pairs(double, double, std::span<const S* const>, PairBuffer& out) override {
    if (fault == Fault::lazy_when_timed && this->is_timed()) return;
    this->find_candidates(0, out, {});
  }
};

template <Fault fault>
struct Pairs {
  template <class S>
  using With = EveryPair<S, fault>;
};
template <Fault fault>
struct Answers {
  template <class S>
  using With = EveryAnswer<S, fault>;
};

Info info(const char* id, Guarantee guarantee) {
  Info info;
  info.id = id;
  info.title = id;
  info.family = guarantee == Guarantee::exact ? "refit" : "loose";
  info.citation = "nobody";
  info.tightness = Tightness::none;
  info.guarantee = guarantee;
  info.rays_guarantee = Guarantee::approximate;
  info.topology.own = true;
  return info;
}

}  // namespace

const std::vector<StrategyEntry>& registry() {
  Info small = info("only_small", Guarantee::exact);
  small.max_primitive_pairs = 10;
  Info near = info("only_near", Guarantee::exact);
  near.max_coordinate = 100;
  static const std::vector<StrategyEntry> entries{
      make_entry<Answers<Fault::none>::With>(info("honest", Guarantee::exact)),
      make_entry<Pairs<Fault::loses_a_pair>::With>(info("loses", Guarantee::exact)),
      make_entry<Pairs<Fault::loses_a_pair>::With>(info("admits_to_lose", Guarantee::approximate)),
      make_entry<Pairs<Fault::repeats_a_pair>::With>(info("repeats", Guarantee::candidate_superset)),
      make_entry<Pairs<Fault::throws>::With>(info("throws", Guarantee::exact)),
      make_entry<Pairs<Fault::needs_memory>::With>(info("needs_memory", Guarantee::exact)),
      make_entry<Pairs<Fault::aborts>::With>(info("aborts", Guarantee::exact)),
      make_entry<Answers<Fault::lazy_when_timed>::With>(info("lazy_when_timed", Guarantee::exact)),
      make_entry<Pairs<Fault::lazy_unless_judged>::With>(info("lazy_unless_judged", Guarantee::exact)),
      make_entry<Pairs<Fault::works_in_reset>::With>(info("works_in_reset", Guarantee::exact)),
      make_entry<Pairs<Fault::works_in_first_query>::With>(info("works_in_first_query", Guarantee::exact)),
      make_entry<Answers<Fault::none>::With>(small),
      make_entry<Answers<Fault::none>::With>(near),
      make_entry<Answers<Fault::none>::With, Scalars::double_only>(info("only_double", Guarantee::exact))};
  return entries;
}
std::string_view about(std::string_view /*id*/) {
  return "Deliberately at fault.";
}

}  // namespace kbvh

int main(int argc, char** argv) {
  return kbvh::experiments::run_program(argc, argv);
}
