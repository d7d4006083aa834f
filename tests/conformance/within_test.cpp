// Primitives within balls: every strategy that answers probes, against exact arithmetic on every primitive,
// on every synthetic scene, between queries of pairs. Contestants without a guarantee are not judged.

#include <gtest/gtest.h>

#include <map>

#include "core/scene/distance_comparison.hpp"
#include "tests/conformance/within_check.hpp"

namespace kbvh::test::within_test {
namespace {

class Within : public testing::TestWithParam<std::string> {};

TEST_P(Within, IsWhatEveryPrimitiveSays) {
  const auto run = [&]<class S>(const TestScene<S>& test) {
    std::map<std::size_t, WithinTruth<S>> truth;
    std::uint64_t hits = 0;
    for (const StrategyEntry& entry : registry()) {
      if (!entry.info.can.probes || entry.info.guarantee != Guarantee::exact) continue;
      const std::string where =
          entry.info.id + " on " + test.scene.name + (sizeof(S) == 4 ? ", float" : ", double");
      EXPECT_EQ(within_violation(entry, test, entry.info.topology.preferred, {}, truth, hits), "") << where;
    }
  };
  run(synthetic_scene<float>(GetParam()));
  if (in_both_scalars()) run(synthetic_scene<double>(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Scenes, Within, testing::ValuesIn(all_synthetic_names()),
                         [](const auto& test) { return test.param; });

// The other paths: widths, leaf sizes, lazy work of every kind, kinds of volumes.
TEST(WithinInEveryWay, IsWhatEveryPrimitiveSays) {
  using Params = std::map<std::string, std::string>;
  const std::pair<const char*, Params> ways[] = {
      {"bottom_up", {}},
      {"hybrid", {{"levels", "0"}}},
      {"hybrid", {{"levels", "1"}, {"below", "top_down"}}},
      {"inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.5"}}},
      {"kinetic_calendar", {}},
      {"kinetic_aabb", {}},
      {"kinetic_separation_list", {}},
      {"linear_bounds", {}},
      {"interval_join", {}},
      {"drift_boxes", {}},
      {"drift_boxes_bounded", {}},
      {"auto", {}},
      {"bottom_up_volumes", {{"volume", "sphere"}}},
      {"bottom_up_volumes", {{"volume", "obb"}}},
  };
  const auto test = synthetic_scene<float>("soups");
  std::map<std::size_t, WithinTruth<float>> truth;
  std::uint64_t hits = 0;
  for (const auto& [id, params] : ways) {
    const StrategyEntry& entry = find_strategy(id);
    for (const std::uint32_t width : {2U, 4U, 8U})
      for (const std::uint32_t leaf : {1U, 3U}) {
        const auto& widths = entry.info.topology.widths;
        if (std::find(widths.begin(), widths.end(), width) == widths.end()) continue;
        EXPECT_EQ(
            within_violation(entry, test, {.method = BuildMethod::sah, .width = width, .leaf_size = leaf},
                             params, truth, hits),
            "")
            << id << ", width " << width << ", leaf size " << leaf;
      }
  }
  EXPECT_GT(hits, 1000U);
}

/// The exact comparison alone, without filters, as a check of the oracle.
template <class S>
void oracle_is_exact(const char* name) {
  const auto test = synthetic_scene<S>(name);
  Playback<S> playback(test.scene);
  playback.seek(frame_times(test.scene, 1)[0]);
  playback.evaluate_all();
  const std::vector<Ball<S>> balls = balls_at(test.scene, playback, 3, 7);
  BallHits exact;
  for (std::uint32_t i = 0; i < balls.size(); ++i)
    for (std::uint32_t body = 0; body < test.scene.bodies.size(); ++body)
      for (std::uint32_t p = 0; p < test.scene.bodies[body].primitives.count(); ++p) {
        const PolygonTriangles triangles = test.scene.bodies[body].primitives.triangles(p);
        bool met = false;
        for (std::uint32_t k = 0; k < triangles.count() && !met; ++k) {
          const auto point = [&](const S* at) {
            const double numbers[3] = {double(at[0]), double(at[1]), double(at[2])};
            return DistanceComparison<Dyadic>::point(numbers);
          };
          const auto corner = [&](std::size_t c) {
            return point(playback.positions(body) + std::size_t(3) * triangles[k][c]);
          };
          DistanceComparison<Dyadic> distance{double(balls[i].radius)};
          met = distance.point_triangle(point(balls[i].centre), corner(0), corner(1), corner(2));
        }
        if (met) exact.push_back({i, body, p});
      }
  EXPECT_EQ(brute_force_within<S>(test.scene, playback, balls), exact) << name;
  EXPECT_FALSE(exact.empty()) << name;
}

TEST(WithinOracle, IsExact) {
  for (const char* name : {"soups", "polygons", "sheets", "integer_ties"}) {
    oracle_is_exact<float>(name);
    oracle_is_exact<double>(name);
  }
}

TEST(WithinOfStrategies, IsRefusedByPeersThatAnswerRaysAlone) {
  for (const StrategyEntry& entry : registry())
    EXPECT_TRUE(!entry.info.can.probes || entry.info.can.rays) << entry.info.id;
  for (const char* id : {"bottom_up", "kinetic_boxtree", "interval_join", "lbvh", "brute_force"})
    EXPECT_TRUE(find_strategy(id).info.can.probes) << id;
  for (const char* id : {"sweep", "hash_grid"}) EXPECT_FALSE(find_strategy(id).info.can.probes) << id;
}

TEST(WithinOfStrategies, IsCheckedBeforeItIsAnswered) {
  const auto test = synthetic_scene<float>("soups");
  const StrategyEntry& entry = find_strategy("bottom_up");
  Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes ignored;
  session.reset(frame_times(test.scene, 1)[0]);
  BallHits found{{7, 7, 7}};
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Ball<float>& wrong :
       {Ball<float>{{0, 0, 0}, -1}, Ball<float>{{0, 0, 0}, nan}, Ball<float>{{0, nan, 0}, 1},
        Ball<float>{{0, 0, 0}, std::numeric_limits<float>::infinity()}}) {
    const std::vector<Ball<float>> balls{{{0, 0, 0}, 100}, wrong};
    EXPECT_THROW(session.probe(BallProbes<float>{balls, &found}, ignored), std::invalid_argument);
  }
  EXPECT_THROW(session.probe(BallProbes<float>{{}, nullptr}, ignored), std::invalid_argument);
  EXPECT_EQ(found, (BallHits{{7, 7, 7}}));  // no partial result
}

// Faults, seeded into a strategy without a hierarchy.
enum class Fault { none, open_ball, box_only, one_triangle, stale, first_body, radius_of_first, repeated };

template <class S, Fault fault>
class Simple : public CountedStrategy<S>, public AnswersProbes<S>, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  Simple(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies, const Params&)
      : CountedStrategy<S>(scene, motion) {}
  std::size_t bytes() const override { return 0; }

 protected:
  void reset_to(double) override { take(); }
  void advance_to(double) override {
    if (fault != Fault::stale) take();
  }
  void follow_plans(double, std::span<const PlanChange<S>>) override {}
  QueryStatus find_candidates(double, PairBuffer&, const Budget&) override { return {}; }

  void answer_probes(double, const Probes<S>& probes) override {
    const auto& asked = std::get<BallProbes<S>>(probes);
    for (std::uint32_t i = 0; i < asked.size(); ++i) {
      Ball<S> ball = asked.balls[i];
      if (fault == Fault::radius_of_first) ball.radius = asked.balls[0].radius;
      if (fault == Fault::open_ball) ball.radius = std::nextafter(ball.radius, S(0));
      BallSearch<S> search(ball, i, *asked.found);
      for (std::uint32_t body = 0; body < positions_.size(); ++body) {
        if (fault == Fault::first_body && body > 0) break;
        const Primitives& primitives = this->scene_.primitives(body);
        if (!asked.meets(primitives.kind)) continue;
        for (std::uint32_t p = 0; p < primitives.count(); ++p) {
          if (!primitives.alive(p)) continue;
          const S* const positions = positions_[body].data();
          PolygonTriangles polygon = primitives.triangles(p);
          if (fault == Fault::one_triangle) polygon = polygon.first();
          double near = 0;
          if (fault == Fault::box_only &&
              search.box_test().meet(primitive_box(primitives[p], positions), 0, near))
            asked.found->push_back({i, body, p});
          if (fault != Fault::box_only) search.offer(body, p, polygon, positions, this->triangle_stats_);
          if (fault == Fault::repeated && p == 0)
            search.offer(body, p, polygon, positions, this->triangle_stats_);
        }
      }
    }
  }

 private:
  void take() {
    positions_.resize(this->scene_.body_count());
    for (std::uint32_t body = 0; body < positions_.size(); ++body) {
      const S* const from = this->sampled_.positions(body);
      positions_[body].assign(from, from + std::size_t(3) * this->scene_.vertex_count(body));
    }
  }
  std::vector<std::vector<S>> positions_;
};

template <Fault fault>
struct With {
  template <class S>
  using Strategy = Simple<S, fault>;
};

/// Returns the first violation on some scenes, in float and double.
template <Fault fault>
std::string first_violation() {
  Info info;
  info.id = "simple";
  info.guarantee = Guarantee::approximate;  // of pairs, which it does not find
  const StrategyEntry entry = make_entry<With<fault>::template Strategy>(info);
  std::uint64_t hits = 0;
  const auto play = [&]<class S>(const TestScene<S>& test) {
    std::map<std::size_t, WithinTruth<S>> truth;
    return within_violation(entry, test, {}, {}, truth, hits);
  };
  for (const char* name : {"soups", "polygons", "sheets", "integer_ties"}) {
    if (std::string found = play(synthetic_scene<float>(name)); !found.empty()) return found;
    if (std::string found = play(synthetic_scene<double>(name)); !found.empty()) return found;
  }
  EXPECT_GT(hits, 200U);
  return {};
}

TEST(WithinFaults, ASoundStrategyPasses) {
  EXPECT_EQ(first_violation<Fault::none>(), "");
}

TEST(WithinFaults, EverySeededFaultIsCaught) {
  EXPECT_NE(first_violation<Fault::open_ball>(), "");
  EXPECT_NE(first_violation<Fault::box_only>(), "");
  EXPECT_NE(first_violation<Fault::one_triangle>(), "");
  EXPECT_NE(first_violation<Fault::stale>(), "");
  EXPECT_NE(first_violation<Fault::first_body>(), "");
  EXPECT_NE(first_violation<Fault::radius_of_first>(), "");
  EXPECT_NE(first_violation<Fault::repeated>(), "");
}

}  // namespace
}  // namespace kbvh::test::within_test
