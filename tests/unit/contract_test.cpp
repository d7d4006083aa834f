// The checks of the contract on behalf of every strategy: abilities are those of the class; the base class
// handles times and counters; limits of parameters and kinds of primitives are data.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test::contract_test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A strategy without any checks or clearing of its own.
template <class S>
class Careless : public CountedStrategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  Careless(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies, const Params&)
      : CountedStrategy<S>(scene, motion) {}
  std::size_t bytes() const override { return 0; }
  double now() const { return this->time(); }
  double before() const { return this->previous_time(); }
  int resets = 0, advances = 0, queries = 0;

 protected:
  void reset_to(double) override {
    ++resets;
    this->count_.add(Counter::nodes_visited, 100);
    own_ = 100;
  }
  void advance_to(double) override {
    ++advances;
    ++own_;
    this->count_.add(Counter::nodes_visited);
    if (this->scene_.body_count() > 0) this->sampled_.position(0, 0);
  }
  QueryStatus find_candidates(double, PairBuffer&, const Budget&) override {
    ++queries;
    return {};
  }
  void counts_cleared() override { own_ = 0; }
  void add_counts(Counters& table) const override { table.add("advances_of_its_own", own_); }

 private:
  std::uint64_t own_ = 0;
};

/// The same with every ability.
template <class S>
class Able : public Careless<S>,
             public AnswersChanges<S>,
             public AnswersSelfPairs,
             public AnswersSpans<S>,
             public AnswersSweeps<S>,
             public AnswersProbes<S>,
             public TakesPlanChanges<S>,
             public TakesGeometryChanges<S> {
 public:
  using Careless<S>::Careless;
  std::vector<std::string> calls;

 protected:
  void find_changes(double, Answer, PairBuffer&, PairBuffer&) override { calls.push_back("changes"); }
  void find_spans(double, double, SpanBuffer&) override { calls.push_back("spans"); }
  void find_swept_pairs(double, double, std::span<const S* const>, PairBuffer&) override {
    calls.push_back("sweep");
  }
  void answer_probes(double, const Probes<S>& probes) override {
    calls.push_back(std::holds_alternative<RayProbes<S>>(probes) ? "rays" : "balls");
  }
  void follow_plans(double, std::span<const PlanChange<S>>) override { calls.push_back("plans"); }
  void follow_geometry(double, const GeometryChange<S>&) override { calls.push_back("geometry"); }
};

template <class S>
class MisnamedCounter : public Careless<S> {
 public:
  using Careless<S>::Careless;

 protected:
  void add_counts(Counters& table) const override { table.add("box_tests", 1); }
};

Info described(const char* id) {
  Info info;
  info.id = id;
  info.topology.own = true;
  return info;
}

Scene<float> two_grids() {
  return grids<float>(6, 0.2, [](std::uint32_t i) { return 0.1 * std::sin(0.9 * i); });
}

/// A strategy with the scene and playback that it sees.
template <template <class> class T>
struct Made {
  Scene<float> scene = two_grids();
  SceneView<float> view{scene};
  Playback<float> playback{scene};
  T<float> strategy{view, SampledMotion<float>(playback), {}, {}};
  PairBuffer pairs;
};

TEST(About, TellsEveryStrategyInWholeSentences) {
  for (const StrategyEntry& entry : registry()) {
    const std::string_view text = about(entry.info.id);
    ASSERT_GE(text.size(), 40U) << entry.info.id;
    EXPECT_TRUE(text.back() == '.' || text.back() == ')') << entry.info.id << ": " << text;
    EXPECT_EQ(text.find("//"), text.npos) << entry.info.id << ": " << text;
  }
  EXPECT_EQ(about("no such strategy"), "");
}

TEST(Contract, AbilitiesAreThoseOfTheClass) {
  Info boasting = described("boasting");
  boasting.can = {.event_driven = true,
                  .plan_changes = true,
                  .geometry_changes = true,
                  .spans = true,
                  .self_pairs = true,
                  .contacts = true,
                  .changes = true,
                  .rays = true};
  boasting.declares.continuous = true;
  const Capabilities none = make_entry<Careless>(boasting).info.can;
  EXPECT_FALSE(none.event_driven || none.events || none.plan_changes || none.geometry_changes || none.spans ||
               none.self_pairs || none.contacts || none.changes || none.rays || none.restructures ||
               none.time_budget);
  EXPECT_TRUE(none.continuous);
  const Capabilities all = make_entry<Able>(described("able")).info.can;
  EXPECT_TRUE(all.plan_changes && all.geometry_changes && all.spans && all.self_pairs && all.contacts &&
              all.changes && all.rays);
  EXPECT_FALSE(all.events || all.continuous);
}

TEST(Contract, WhatAClassCannotDoThrows) {
  Made<Careless> made;
  made.strategy.reset(0);
  SpanBuffer spans;
  EventDescription<float> event;
  EXPECT_THROW(made.strategy.spans(0, 1, spans), std::logic_error);
  EXPECT_THROW(made.strategy.start_sweep(0), std::logic_error);
  EXPECT_THROW(made.strategy.swept_pairs(0, 1, {}, made.pairs), std::logic_error);
  EXPECT_THROW(made.strategy.probe_at(0, RayProbes<float>{RayQuery::any, {}, {}}), std::logic_error);
  EXPECT_THROW(made.strategy.flight_plans_changed(0, {}), std::logic_error);
  EXPECT_THROW(made.strategy.geometry_changed(0, {}), std::logic_error);
  EXPECT_THROW(made.strategy.step_event(1, event), std::logic_error);
  EXPECT_EQ(made.strategy.events(), nullptr);
  made.strategy.advance(0);  // the clock has not moved
}

// Over the registry: a flag is set if and only if the corresponding calls succeed.
TEST(Contract, NoFlagLies) {
  const Scene<float> scene = two_grids();
  const auto refused = [](auto&& call) {
    try {
      call();
    } catch (const std::logic_error& error) {
      return std::string(error.what()).find("does not declare") != std::string::npos;
    }
    return false;
  };
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    const Capabilities& can = entry.info.can;
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
    session.reset(0);
    Strategy<float>& strategy = session.strategy();
    EXPECT_EQ(refused([&] { strategy.flight_plans_changed(0, {}); }), !can.plan_changes) << entry.info.id;
    EXPECT_EQ(refused([&] { strategy.geometry_changed(0, {}); }), !can.geometry_changes) << entry.info.id;
    EXPECT_EQ(refused([&] { strategy.start_sweep(0); }), !can.contacts) << entry.info.id;
    EXPECT_EQ(refused([&] {
                strategy.probe_at(0, RayProbes<float>{RayQuery::any, {}, {}});
              }),
              !can.rays)
        << entry.info.id;
    BallHits met;
    EXPECT_EQ(refused([&] {
                strategy.probe_at(0, BallProbes<float>{{}, &met});
              }),
              !can.probes)
        << entry.info.id;
    EventDescription<float> event;
    EXPECT_EQ(refused([&] { strategy.step_event(0, event); }), !can.events) << entry.info.id;
    EXPECT_EQ(strategy.events() != nullptr, can.events) << entry.info.id;
    EXPECT_TRUE(can.event_driven || !can.events) << entry.info.id;
    session.reset(0);
    SpanBuffer spans;
    EXPECT_EQ(refused([&] { session.spans(0.25, spans); }), !can.spans) << entry.info.id;
  }
}

TEST(Contract, TheBaseClassChecksTimes) {
  Made<Able> made;
  Able<float>& strategy = made.strategy;
  for (const double t : {std::nan(""), infinity, -infinity})
    EXPECT_THROW(strategy.reset(t), std::invalid_argument) << t;
  EXPECT_EQ(strategy.resets, 0);
  strategy.reset(1);
  EXPECT_EQ(strategy.now(), 1);
  EXPECT_EQ(strategy.before(), 1);
  for (const double t : {0.5, std::nan(""), infinity})
    EXPECT_THROW(strategy.advance(t), std::invalid_argument) << t;
  EXPECT_EQ(strategy.advances, 0);
  strategy.advance(2);
  EXPECT_EQ(strategy.now(), 2);
  EXPECT_EQ(strategy.before(), 1);
  EXPECT_THROW(strategy.candidates_at(1, made.pairs, {}), std::invalid_argument);
  EXPECT_THROW(strategy.confirm(3, made.pairs), std::invalid_argument);
  PairBuffer ended;
  EXPECT_THROW(strategy.changes_at(1, Answer::pairs, made.pairs, ended), std::invalid_argument);
  EXPECT_THROW(strategy.changes_at(2, Answer::pairs, ended, ended), std::invalid_argument);
  EXPECT_EQ(strategy.queries, 0);
  strategy.candidates_at(2, made.pairs, {});
  SpanBuffer spans;
  EXPECT_THROW(strategy.spans(1, 3, spans), std::invalid_argument);
  EXPECT_THROW(strategy.spans(2, 1, spans), std::invalid_argument);
  EXPECT_THROW(strategy.spans(2, infinity, spans), std::invalid_argument);
  EXPECT_THROW(strategy.start_sweep(3), std::invalid_argument);
  EXPECT_THROW(strategy.flight_plans_changed(1, {}), std::invalid_argument);
  EXPECT_THROW(strategy.geometry_changed(1, {}), std::invalid_argument);
  EXPECT_THROW(strategy.probe_at(1, RayProbes<float>{RayQuery::any, {}, {}}), std::invalid_argument);
  RayHit hit;
  EXPECT_THROW(strategy.probe_at(2, RayProbes<float>{RayQuery::any, {}, {&hit, 1}}), std::invalid_argument);
  const float* const none[] = {nullptr};
  EXPECT_THROW(strategy.swept_pairs(2, 3, none, made.pairs), std::invalid_argument);  // two bodies
  EXPECT_TRUE(strategy.calls.empty());
  made.pairs = {{0, 1, 1, 2}};  // from an earlier frame
  strategy.changes_at(2, Answer::candidates, made.pairs, ended);
  EXPECT_TRUE(made.pairs.empty());
  strategy.spans(2, 3, spans);
  const float* const both[] = {nullptr, nullptr};
  strategy.swept_pairs(3, 4, both, made.pairs);
  strategy.flight_plans_changed(4, {});
  strategy.probe_at(4, RayProbes<float>{RayQuery::any, {}, {}});
  EXPECT_EQ(strategy.calls, (std::vector<std::string>{"changes", "spans", "sweep", "plans", "rays"}));
  EXPECT_EQ(strategy.now(), 4);
  EXPECT_EQ(strategy.before(), 3);
}

TEST(Contract, TheBaseClassClearsCounters) {
  Made<Careless> made;
  for (int round = 0; round < 2; ++round) {
    made.playback.seek(0);
    made.strategy.reset(0);
    EXPECT_EQ(made.strategy.counters()[Counter::nodes_visited], 0u);
    EXPECT_EQ(made.strategy.counters()[Counter::positions_fetched], 0u);
    for (const double t : {0.5, 1.0}) {
      made.playback.seek(t);
      made.strategy.advance(t);
    }
    const Counters counters = made.strategy.counters();
    EXPECT_EQ(counters[Counter::nodes_visited], 2u);
    EXPECT_EQ(counters[Counter::positions_fetched], 2u);
    ASSERT_EQ(counters.named.size(), 1u);
    EXPECT_EQ(counters.named[0].name, "advances_of_its_own");
    EXPECT_EQ(counters.named[0].value, 2u);
  }
}

TEST(Contract, ACounterOfOnesOwnHasANameOfItsOwn) {
  Made<MisnamedCounter> made;
  made.strategy.reset(0);
  EXPECT_THROW(made.strategy.counters(), std::logic_error);
}

/// Returns refits without foresight that are not baselines, each with the reason in a sentence.
const std::map<std::string, std::string>& excused_refits() {
  static const std::map<std::string, std::string> excused;  // none: every refit takes part in the denominator
  return excused;
}

/// Returns the ids of refits without foresight that are neither declared baselines nor excused, and of
/// unnecessary excuses.
std::vector<std::string> undeclared_refits(const std::vector<StrategyEntry>& entries,
                                           const std::map<std::string, std::string>& excused) {
  std::vector<std::string> found;
  std::set<std::string> needed;
  for (const StrategyEntry& entry : entries) {
    const Info& info = entry.info;
    if (info.family != "refit" || info.foresight != Foresight::none || info.baseline) continue;
    needed.insert(info.id);
    const auto excuse = excused.find(info.id);
    if (excuse == excused.end() || !excuse->second.ends_with('.')) found.push_back(info.id);
  }
  for (const auto& [id, why] : excused)
    if (!needed.contains(id)) found.push_back(id);
  return found;
}

// Leaving a refit out of the best refit flatters everything that is compared with it.
TEST(Contract, RefitsAnswerPairsWithinABody) {
  for (const char* id : {"bottom_up", "leaf_slabs"}) EXPECT_TRUE(find_strategy(id).info.can.self_pairs) << id;
  // Both halves of Registry.SelfPairsAreDeclaredOrRefused must have members.
  EXPECT_TRUE(std::any_of(registry().begin(), registry().end(),
                          [](const StrategyEntry& entry) { return !entry.info.can.self_pairs; }));
}

// Curves are followed by positions and bounds of displacement alone, or declared.
TEST(Contract, StrategiesSayWhetherTheyFollowCurves) {
  for (const StrategyEntry& entry : registry())
    if (entry.info.foresight <= Foresight::step_bound) {
      EXPECT_TRUE(entry.info.can.curves) << entry.info.id;
    }
  for (const char* id : {"kinetic_aabb", "kinetic_boxtree", "kinetic_envelope", "kinetic_kdop",
                         "kinetic_separation_list", "linear_bounds"})
    EXPECT_TRUE(find_strategy(id).info.can.curves) << id;
  EXPECT_FALSE(find_strategy("interval_join").info.can.curves);
}

TEST(Contract, RefitsWithoutForesightAreBaselinesOrExcused) {
  EXPECT_EQ(undeclared_refits(registry(), excused_refits()), std::vector<std::string>{});
}

TEST(Contract, ARefitThatIsNotDeclaredIsFound) {
  std::vector<StrategyEntry> entries = registry();
  for (StrategyEntry& entry : entries)
    if (entry.info.id == "bottom_up") entry.info.baseline = false;
  using Ids = std::vector<std::string>;
  EXPECT_EQ(undeclared_refits(entries, {}), Ids{"bottom_up"});
  EXPECT_EQ(undeclared_refits(entries, {{"bottom_up", "no sentence"}}), Ids{"bottom_up"});
  EXPECT_EQ(undeclared_refits(entries, {{"bottom_up", "It is excused for the sake of this test."}}), Ids{});
  EXPECT_EQ(undeclared_refits(registry(), {{"bottom_up", "It needs no excuse."}}), Ids{"bottom_up"});
}

TEST(Contract, BaselinesAreDeclared) {
  std::vector<std::string> baselines;
  for (const StrategyEntry& entry : registry())
    if (entry.info.baseline) baselines.push_back(entry.info.id);
  std::sort(baselines.begin(), baselines.end());
  EXPECT_EQ(baselines, (std::vector<std::string>{"bottom_up", "bottom_up_recursive", "dirty_refit", "front",
                                                 "hybrid", "leaf_slabs", "top_down"}));
}

// Tables show the version of a peer, and the instruction set of its code, which may differ from kbvh's.
TEST(Contract, PeersStateTheirVersion) {
  std::set<std::string> families;
  for (const StrategyEntry& entry : registry()) {
    const Info& info = entry.info;
    const bool peer = std::set<std::string>{"fcl", "bullet", "embree", "cgal"}.contains(info.family);
    EXPECT_EQ(
        std::any_of(info.version.begin(), info.version.end(), [](char c) { return c >= '0' && c <= '9'; }),
        peer)
        << info.id << ": " << info.version;
    EXPECT_EQ(!info.instructions.empty(), peer) << info.id;
  }
}

TEST(Contract, LimitsOfParametersAreData) {
  const std::vector<Parameter> declared{{"words", "a", {"a", "b"}, ""},
                                        {"any", "1", {}, "", 0.5},
                                        {"some", "2", {}, "", 1, 64, Numbers::whole}};
  const auto said = [&](const char* key, const char* value) -> std::string {
    try {
      return "taken: " + Params("x", declared, {{key, value}}).word(key);
    } catch (const ConfigError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(said("words", "b"), "taken: b");
  EXPECT_EQ(said("words", "c"), "parameter 'words' of 'x' cannot be 'c': it is a | b");
  EXPECT_EQ(said("any", "1e300"), "taken: 1e300");
  EXPECT_EQ(said("any", "0.25"), "parameter 'any' of 'x' cannot be '0.25': it is a number of at least 0.5");
  for (const char* value : {"1", "64", "6.4e1"})
    EXPECT_EQ(said("some", value), std::string("taken: ") + value);
  for (const char* value : {"0", "65", "1.5", "nan", "inf", "", "3 "})
    EXPECT_EQ(said("some", value), "parameter 'some' of 'x' cannot be '" + std::string(value) +
                                       "': it is a whole number from 1 to 64");
  EXPECT_NE(said("none", "1").find("has no parameter 'none'"), std::string::npos);
}

TEST(Contract, KindsOfPrimitivesAreChecked) {
  Info picky = described("picky");
  picky.primitives = {PrimitiveKind::polygons};
  const StrategyEntry entry = make_entry<Careless>(picky);
  Scene<float> scene = two_grids();
  EXPECT_EQ(unsuitable_bodies(entry.info, scene), "");
  Session<float> fine(scene, {&entry, {}, {}});
  Primitives points;
  points.kind = PrimitiveKind::points;
  for (std::uint32_t v = 0; v < scene.bodies[1].plans.vertex_count(); ++v) points.add({&v, 1});
  scene.bodies[1].primitives = points;
  scene.bodies[1].name = "dust";
  EXPECT_EQ(unsuitable_bodies(entry.info, scene), "does not take points, as in body 'dust'");
  EXPECT_THROW(Session<float>(scene, {&entry, {}, {}}), ConfigError);
  const StrategyEntry any = make_entry<Careless>(described("any"));
  EXPECT_EQ(unsuitable_bodies(any.info, scene), "");
}

// Positions that are handed in, frame by frame, from the caller's arrays: the answers are those of the same
// positions as keyframes. Strategies that must know the motion beforehand refuse such a scene.
TEST(Contract, PositionsCanBeHandedIn) {
  const Scene<float> known = two_grids();
  Scene<float> unknown = known;
  for (Body<float>& body : unknown.bodies) {
    const float* first = body.plans.keyframe(0);
    const std::uint32_t count = body.plans.vertex_count();
    body.plans = FlightPlans<float>::handed_in(count, {first, first + std::size_t(3) * count});
  }
  std::size_t found = 0, able = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    if (entry.info.foresight != Foresight::none) {
      EXPECT_NE(unsuitable_bodies(entry.info, unknown).find("handed in"), std::string::npos);
      EXPECT_THROW(Session<float>(unknown, {&entry, {}, entry.info.topology.preferred}), ConfigError)
          << entry.info.id;
      continue;
    }
    ++able;
    Session<float> expected(known, {&entry, {}, entry.info.topology.preferred});
    Session<float> session(unknown, {&entry, {}, entry.info.topology.preferred});
    Playback<float> source(known);
    std::vector<std::vector<float>> arrays(known.bodies.size());
    const auto hand_in = [&](double t) {
      source.seek(t);
      source.evaluate_all();
      for (std::uint32_t body = 0; body < arrays.size(); ++body) {
        const std::size_t size = std::size_t(3) * known.bodies[body].plans.vertex_count() + 1;
        arrays[body].assign(source.positions(body), source.positions(body) + size);
        session.hand_in(body, arrays[body].data());
      }
    };
    PhaseTimes times;
    PairBuffer pairs, right;
    expected.reset(0);
    hand_in(0);
    session.reset(0);
    for (const double t : {0.0, 0.4, 0.8, 1.3, 1.9}) {
      if (t > 0) {
        expected.advance(t, times);
        hand_in(t);
        session.advance(t, times);
      }
      expected.query(right, times);
      session.query(pairs, times);
      std::sort(pairs.begin(), pairs.end());
      std::sort(right.begin(), right.end());
      EXPECT_EQ(pairs, right) << entry.info.id << ", t = " << t;
      found += pairs.size();
    }
    EXPECT_EQ(session.playback().positions(0), arrays[0].data()) << "copied";
    if (entry.info.can.plan_changes) {
      const std::vector<PlanChange<float>> up{{.body = 1, .vertex = 3, .velocity = {0, 0, 0.5F}}};
      EXPECT_THROW(session.change_plans(up, times), std::invalid_argument) << entry.info.id;
    }
  }
  EXPECT_GT(found, 0u);
  EXPECT_GE(able, 8u);
}

}  // namespace
}  // namespace kbvh::test::contract_test
