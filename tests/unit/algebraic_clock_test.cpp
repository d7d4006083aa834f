// Kinetic AABB trees over curves: at frames, between frames and next to events every realiser is extremal in
// rational arithmetic; all queues handle the same events in one order; seeded faults are found; and the
// number of changes of a bound stays below that of Davenport-Schinzel sequences of order 2 and 3, which a
// worst case reaches.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/rational_curves.hpp"
#include "tests/support/seeded_clock.hpp"
#include "tests/support/vertices_below.hpp"

namespace kbvh::test::algebraic_clock_test {
namespace {

using seeded_clock::Fault;
using seeded_clock::Seeded;

struct HandledEvent {
  double hint;
  std::uint32_t body, node, side, winner, loser;
  bool operator==(const HandledEvent&) const = default;
};

template <class S, template <class> class Clock>
class Play {
  using Forest = KineticForest<S, AnyEventQueue<Clock<S>>>;

 public:
  Play(const Scene<S>& scene, std::uint32_t width, std::uint32_t leaf_size, const std::string& queue)
      : scene_(&scene),
        view_(scene),
        playback_(scene),
        forest_(view_, ClipMotion<S>(playback_),
                at_start({.method = BuildMethod::median, .width = width, .leaf_size = leaf_size}), count_) {
    forest_.choose_queue(queue);
    for (std::uint32_t body = 0; body < forest_.size(); ++body)
      below_.push_back(vertices_below(forest_.tree(body)));
  }

  /// Plays the scene and checks at its frames and at `between` random times. Stops after so many
  /// events as a sound play has: faulty clocks may not come to an end.
  void run(int between, std::uint64_t seed, std::size_t most_events = 2000000) {
    // Also a little before and after the clip.
    const std::vector<double> times = frames_and_between(*scene_, between, seed, 0.52, 0.54);
    playback_.seek(times[0]);
    forest_.reset(times[0]);
    for (const double t : times) {
      while (forest_.due(t) && events_.size() < most_events) {
        const Event event = forest_.queue().top();
        const auto& tree = forest_.tree(event.body);
        events_.push_back(
            {event.hint, event.body, tree.node_of(event.slot), event.side, event.winner, event.loser});
        if (has_last_ && forest_.clock().compare_times(last_, event) > 0) ++out_of_order_;
        last_ = event;
        has_last_ = true;
        forest_.handle_next();
      }
      check_realisers(t);
    }
  }
  const std::vector<HandledEvent>& events() const { return events_; }
  std::uint64_t not_extremal() const { return not_extremal_; }
  std::uint64_t out_of_order() const { return out_of_order_; }
  Forest& forest() { return forest_; }

 private:
  Topologies at_start(const BuilderConfig& config) { return build_topologies(view_, playback_, config); }
  void check_realisers(double t) {
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      const std::vector<Rational> values = rational_values(playback_.plans(body), t);
      const auto& tree = forest_.tree(body);
      for (std::uint32_t node = 0; node < tree.topology().size(); ++node)
        for (Side side = 0; side < 6; ++side) {
          const std::size_t axis = direction_of(side);
          const Rational& bound = values[3 * tree.realiser(node, side) + axis];
          for (const std::uint32_t v : below_[body][node]) {
            const int ahead = values[3 * v + axis].compare(bound);
            if (is_upper(side) ? ahead > 0 : ahead < 0) {
              ++not_extremal_;
              break;
            }
          }
        }
    }
  }

  const Scene<S>* scene_;
  SceneView<S> view_;
  Playback<S> playback_;
  Counters count_;
  Forest forest_;
  std::vector<std::vector<std::vector<std::uint32_t>>> below_;
  std::vector<HandledEvent> events_;
  Event last_;
  bool has_last_ = false;
  std::uint64_t not_extremal_ = 0, out_of_order_ = 0;
};

template <class S, Fault fault = Fault::none>
using PlayOf = Play<S, Seeded<fault>::template Clock>;

template <class S>
void check_scene(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  std::vector<HandledEvent> events;
  for (const std::string& queue : AnyEventQueue<AlgebraicClock<S>>::names()) {
    PlayOf<S> play(scene, 2, 1, queue);
    play.run(queue == "avl" ? 8 : 0, 5);
    EXPECT_EQ(play.not_extremal(), 0u) << name << ", " << queue;
    EXPECT_EQ(play.out_of_order(), 0u) << name << ", " << queue;
    if (queue == AnyEventQueue<AlgebraicClock<S>>::names()[0])
      events = play.events();
    else
      EXPECT_TRUE(events == play.events())
          << name << ", " << queue << ": " << events.size() << " and " << play.events().size() << " events";
  }
  EXPECT_GT(events.size(), 10u) << name;
  PlayOf<S> wide(scene, 8, 5, "");
  wide.run(4, 6);
  EXPECT_EQ(wide.not_extremal(), 0u) << name;
}

TEST(AlgebraicClock, RealisersAreExtremalAtAndBetweenFramesInFloat) {
  for (const std::string& name : curved_scene_names()) check_scene<float>(name);
}
TEST(AlgebraicClock, RealisersAreExtremalAtAndBetweenFramesInDouble) {
  for (const std::string& name : curved_scene_names()) check_scene<double>(name);
}

// Longer than one search for a failure: certificates are reviewed at keyframes.
TEST(AlgebraicClock, LongClipsAreSearchedInParts) {
  constexpr std::uint32_t triangles = 8, keyframes = 150;
  Random random(9);
  Scene<float> scene;
  Body<float> body;
  std::vector<double> times;
  std::vector<float> positions;
  std::vector<SegmentBends<float>> bends(keyframes - 1);
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(0.1 * k);
    for (std::uint32_t i = 0; i < 9 * triangles; ++i) {
      // Some vertices lead for long.
      positions.push_back(float((i % 9 < 3 ? 3.0 : 1.0) * random.unit() + (i < 3 ? 5 : 0)));
      if (k + 1 == keyframes) continue;
      bends[k].bend.push_back(float(random.unit()));
      bends[k].twist.push_back(float(k % 3 == 0 ? random.unit() : 0));
    }
  }
  for (std::uint32_t p = 0; p < triangles; ++p)
    body.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
  body.plans = FlightPlans<float>(3 * triangles, std::move(times), std::move(positions), std::move(bends));
  scene.bodies.push_back(std::move(body));
  std::vector<HandledEvent> events;
  for (const std::string& queue : AnyEventQueue<AlgebraicClock<float>>::names()) {
    PlayOf<float> play(scene, 2, 1, queue);
    play.run(0, 5);
    EXPECT_EQ(play.not_extremal(), 0u) << queue;
    EXPECT_EQ(play.out_of_order(), 0u) << queue;
    if (events.empty()) events = play.events();
    EXPECT_TRUE(events == play.events()) << queue;
  }
  EXPECT_GT(events.size(), 500u);
}

template <Fault fault>
std::uint64_t found_faults() {
  std::uint64_t found = 0;
  for (const std::string name : {"curved_soups", "curved_ties", "curved_mirror"}) {
    const Scene<float> scene = curved_scene<float>(name).scene;
    PlayOf<float> sound(scene, 2, 1, "binary_heap");
    sound.run(0, 5);
    EXPECT_EQ(sound.not_extremal(), 0u);
    PlayOf<float, fault> play(scene, 2, 1, "binary_heap");
    play.run(2, 5, 2 * sound.events().size());
    found += play.not_extremal();
  }
  return found;
}

TEST(AlgebraicClock, SeededFaultsAreFound) {
  EXPECT_GT(found_faults<Fault::lost_event>(), 0u);
  EXPECT_GT(found_faults<Fault::later_roots>(), 0u);
  EXPECT_GT(found_faults<Fault::end_points>(), 0u);
  EXPECT_GT(found_faults<Fault::half_open>(), 0u);
}

/// Returns the number of failures, by side, of the only node above vertices that move along x on these
/// curves: the node's upper x side is the curves' upper envelope.
template <class S>
std::vector<std::size_t> failures_by_side(const std::vector<CurvedPiece<S>>& curves) {
  Scene<S> scene;
  scene.bodies.push_back(net_of_curves(curves));
  PlayOf<S> play(scene, 2, 1, "");
  play.run(20, 7);
  EXPECT_EQ(play.not_extremal(), 0u);
  std::vector<std::size_t> failures(6, 0);
  for (const HandledEvent& event : play.events()) ++failures[event.side];
  return failures;
}

/// The length of the longest Davenport-Schinzel sequence of order 1 or 2, and an upper bound for order 3
/// (Sharir & Agarwal 1995): some symbol occurs at most l(n) / n times, and without it at most two neighbours
/// are equal, so that l(n) <= l(n - 1) + l(n) / n + 2.
std::size_t most_of_order(int order, std::uint32_t n) {
  if (order == 1) return n;
  if (order == 2) return 2 * n - 1;
  double sum = 1;
  for (std::uint32_t i = 1; i < n; ++i) sum += 2.0 / i;
  return std::size_t(n * sum + 1e-9);
}

TEST(DavenportSchinzel, RandomCurvesStayBelowTheBound) {
  Random random(8);
  for (int order = 1; order <= 3; ++order)
    for (const std::uint32_t n : {2u, 5u, 20u, 60u}) {
      std::size_t most = 0;
      for (int round = 0; round < 6; ++round) {
        std::vector<CurvedPiece<double>> curves;
        for (std::uint32_t v = 0; v < n; ++v)
          curves.push_back({0, 1, 0.2 * random.unit(), 0.2 * random.unit(), order > 1 ? random.unit() : 0,
                            order > 2 ? 3 * random.unit() : 0});
        const auto failures = failures_by_side(curves);
        for (const Side side : {0u, 1u}) {
          EXPECT_LE(failures[side] + 1, most_of_order(order, n)) << "order " << order << ", n = " << n;
          most = std::max(most, failures[side]);
        }
        EXPECT_EQ(failures[2] + failures[3] + failures[4] + failures[5], 0u);
      }
      EXPECT_GT(most, 0u);
    }
}

TEST(DavenportSchinzel, ParabolasReachTheBoundOfOrderTwo) {
  for (const std::uint32_t n : {2u, 10u, 50u, 200u}) {
    const auto failures = failures_by_side(line_and_parabolas(n));
    EXPECT_EQ(failures[1] + 1, most_of_order(2, n)) << n;
    EXPECT_LE(failures[0] + 1, most_of_order(2, n)) << n;
  }
}

// Two cubics that meet three times, and a third that is behind: order 3 is reached for n = 2.
TEST(DavenportSchinzel, TwoCubicsCrossThreeTimes) {
  // (s - 1/4) (s - 1/2) (s - 3/4) = s^3 - 3/2 s^2 + 11/16 s - 3/32
  const auto failures =
      failures_by_side<float>({{}, {0, 1, -3.0F / 32, 3.0F / 32, 0.5F, -1}, {0, 1, -1, -1, 0, 0}});
  EXPECT_EQ(failures[1], 3u);
}

}  // namespace
}  // namespace kbvh::test::algebraic_clock_test
