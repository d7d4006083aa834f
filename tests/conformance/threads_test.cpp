// Strategies with a parameter `threads` answer the same with any number of threads: the same pairs in the
// same order, the same positions, boxes and counters. Built with ThreadSanitizer, this program also detects
// data races (CONTRIBUTING.md).

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>
#include <thread>

#include "core/base/hasher.hpp"
#include "core/families/wide/shared_front.hpp"
#include "core/judge/session.hpp"
#include "core/parallel/workers.hpp"
#include "core/scene/pairs_by_thread.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/ray_sets.hpp"

#if defined(KBVH_TEST_HAS_TBB)
#include <tbb/global_control.h>
#endif

namespace kbvh::test {
namespace {

#if defined(KBVH_TEST_HAS_TBB)
// Allows eight threads on machines with fewer cores, too; set before the registry states its parameters.
const tbb::global_control eight(tbb::global_control::max_allowed_parallelism, 8);
#endif

/// A sheet of 2 side^2 triangles that waves over one keyframe after another.
template <class S>
Body<S> sheet(std::uint32_t side, std::uint32_t keyframes, double tilt) {
  return placed_grid<S>(
      side, keyframes, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
        const double x = i / double(side), y = j / double(side), phase = 9 * x + 7 * y + 0.4 * k;
        const double bend = phase - 4 * double(int(phase / 4)) - 2;
        return axis == 0 ? x : axis == 1 ? y + 0.02 * k * x : tilt * (x - 0.5) + 0.05 * bend * bend;
      });
}

enum class Self : std::uint8_t { without, with };

/// Two large sheets that cut each other, and a small one.
template <class S>
Scene<S> sheets(std::uint32_t side, Self self) {
  Scene<S> scene;
  scene.name = "sheets";
  scene.bodies = {sheet<S>(side, 3, 0.3), sheet<S>(side, 3, -0.3), sheet<S>(6, 3, 0.1)};
  scene.pairs = all_pairs(scene.bodies);
  if (self == Self::with) scene.pairs.insert(scene.pairs.begin(), {0, 0});
  std::sort(scene.pairs.begin(), scene.pairs.end(), [](const BodyPair& a, const BodyPair& b) {
    return a.first != b.first ? a.first < b.first : a.second < b.second;
  });
  return scene;
}

/// The answers of a strategy, frame by frame, in its own order.
template <class S>
std::vector<std::uint64_t> answers(const StrategyEntry& entry, const Scene<S>& scene,
                                   std::map<std::string, std::string> params, std::uint32_t threads,
                                   const BuilderConfig& builder) {
  params["threads"] = std::to_string(threads);
  Session<S> session(scene, {&entry, params, builder});
  EXPECT_EQ(session.playback().workers().threads(), threads);
  std::vector<std::uint64_t> hashes;
  PairBuffer pairs, begun, ended;
  PhaseTimes times;
  std::size_t frame = 0;
  for (const double t : frame_times(scene, 5)) {
    if (frame++ == 0)
      session.reset(t);
    else
      session.advance(t, times);
    Hasher hasher;
    pairs.clear();
    session.strategy().candidates_at(t, pairs, {});
    const auto add = [&hasher](const PairBuffer& list) {
      hasher.mix(list.size());
      hasher.bytes(list.data(), list.size() * sizeof(PrimitivePair));
    };
    add(pairs);
    session.strategy().confirm(t, pairs);
    add(pairs);
    session.changes(Answer::pairs, begun, ended, times);
    add(begun);
    add(ended);
    session.playback().evaluate_all();
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
      hasher.bytes(session.playback().positions(body),
                   std::size_t(3) * scene.bodies[body].plans.vertex_count() * sizeof(S));
      if (const auto view = session.strategy().audit_view(body))
        for (const Box<double>& box : view->boxes)
          for (int axis = 0; axis < 3; ++axis)
            for (const double bound : {box.lower[axis] + 0.0, box.upper[axis] + 0.0})
              hasher.bytes(&bound, sizeof bound);
    }
    const Counters counters = session.strategy().counters();
    for (const Counter counter :
         {Counter::box_tests, Counter::nodes_visited, Counter::vertex_reads, Counter::triangle_tests,
          Counter::triangle_tests_exact, Counter::span_tests, Counter::span_verdicts})
      hasher.mix(counters[counter]);
    hashes.push_back(hasher.value());
  }
  return hashes;
}

bool takes_threads(const StrategyEntry& entry) {
  const auto& list = entry.info.parameters;
  return std::any_of(list.begin(), list.end(), [](const Parameter& one) { return one.name == "threads"; });
}

template <class S>
void expect_same_answers(const StrategyEntry& entry, std::uint32_t side, Self self) {
  const Scene<S> scene = sheets<S>(side, self);
  for (const std::uint32_t leaf : {1u, 16u}) {
    if (leaf < entry.info.topology.min_leaf_size) continue;
    BuilderConfig builder = entry.info.topology.preferred;
    builder.leaf_size = leaf;
    const auto expected = answers<S>(entry, scene, {}, 1, builder);
    for (const std::uint32_t threads : {2u, 4u})
      EXPECT_EQ(answers<S>(entry, scene, {}, threads, builder), expected)
          << entry.info.id << ", " << threads << " threads, leaves of " << leaf
          << (self == Self::with ? ", self" : "");
  }
}

TEST(Threads, AnswerTheSameInTheSameOrder) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  std::size_t tried = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!takes_threads(entry) || entry.info.guarantee == Guarantee::approximate || entry.info.topology.own)
      continue;
    ++tried;
    expect_same_answers<float>(entry, 96, Self::without);
    if (entry.info.can.self_pairs) expect_same_answers<double>(entry, 64, Self::with);
  }
  EXPECT_GE(tried, 1u);
}

/// Rays from one point through the sheets, row by row, and then rays in all directions; at the first frame.
template <class S>
std::vector<Ray<S>> views(const Scene<S>& scene) {
  Playback<S> playback(scene);
  playback.seek(0);
  playback.evaluate_all();
  std::vector<Ray<S>> rays;
  for (int j = 0; j < 32; ++j)
    for (int i = 0; i < 32; ++i)
      rays.push_back({{S(0.4), S(0.45), S(-3)}, {S((i - 15.5) / 90), S((j - 15.5) / 90), S(1)}});
  const std::vector<Ray<S>> others = rays_at(scene, playback, 110, 5);
  rays.insert(rays.end(), others.begin(), others.end());
  return rays;
}

/// The hits of a strategy and what it counts, frame by frame.
template <class S>
std::vector<std::uint64_t> ray_answers(const StrategyEntry& entry, const Scene<S>& scene,
                                       std::span<const Ray<S>> rays, std::uint32_t threads,
                                       std::uint32_t leaf_size) {
  BuilderConfig builder = entry.info.topology.preferred;
  builder.leaf_size = leaf_size;
  Session<S> session(scene, {&entry, {{"threads", std::to_string(threads)}}, builder});
  std::vector<std::uint64_t> hashes;
  std::vector<RayHit> hits(rays.size());
  PairBuffer pairs;
  PhaseTimes times;
  for (const double t : frame_times(scene, 1)) {
    hashes.empty() ? session.reset(t) : session.advance(t, times);
    Hasher hasher;
    for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
      std::fill(hits.begin(), hits.end(), RayHit{.body = 7, .primitive = 7, .parameter = 7});
      session.probe(RayProbes<S>{query, rays, std::span<RayHit>(hits)}, times);
      hasher.bytes(hits.data(), hits.size() * sizeof(RayHit));
    }
    session.query(pairs, times);
    const Counters counters = session.strategy().counters();
    for (const Counter counter : {Counter::box_tests, Counter::triangle_tests, Counter::triangle_tests_exact,
                                  Counter::ray_decisions_exact})
      hasher.mix(counters[counter]);
    for (const auto& own : counters.named)
      if (own.name.starts_with("ray_")) hasher.mix(own.value);
    hashes.push_back(hasher.value());
  }
  return hashes;
}

TEST(Threads, HitTheSameWithRays) {
  if (most_threads() < 7) GTEST_SKIP() << "built without TBB";
  // One body: its rays are followed together where they can be; three bodies: nearest first.
  std::vector<Scene<float>> scenes{sheets<float>(40, Self::with), sheets<float>(40, Self::without)};
  scenes[0].bodies.resize(1);
  scenes[0].pairs = {{0, 0}};
  std::size_t tried = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!takes_threads(entry) || !entry.info.can.rays || entry.info.topology.own) continue;
    for (const Scene<float>& scene : scenes) {
      if (scene.bodies.size() == 1 && !entry.info.can.self_pairs) continue;
      ++tried;
      const std::vector<Ray<float>> all = views(scene);
      // Around the numbers of rays in a block, 64, and in an item of a thread, 256.
      for (const std::size_t count : {std::size_t(0), std::size_t(256), std::size_t(257), all.size()}) {
        const std::span<const Ray<float>> rays(all.data(), count);
        const auto expected = ray_answers<float>(entry, scene, rays, 1, 16);
        for (const std::uint32_t threads : {2U, 4U, 7U}) {
          if (threads == 7 && count != all.size()) continue;
          EXPECT_EQ(ray_answers<float>(entry, scene, rays, threads, 16), expected)
              << entry.info.id << ", " << scene.bodies.size() << " bodies, " << count << " rays, " << threads
              << " threads";
        }
      }
    }
  }
  EXPECT_GE(tried, 2U);
}

TEST(Threads, HitTheSameWithRaysInDoubleAndLeavesOfOne) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  const Scene<double> scene = sheets<double>(40, Self::without);
  const std::vector<Ray<double>> rays = views(scene);
  const StrategyEntry& entry = find_strategy("bottom_up");
  for (const std::uint32_t leaf : {1U, 4U})
    EXPECT_EQ(ray_answers<double>(entry, scene, rays, 4, leaf),
              ray_answers<double>(entry, scene, rays, 1, leaf))
        << "leaves of " << leaf;
}

TEST(Threads, AreCorrectOnChangingPlansAndManyBodies) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  for (const StrategyEntry& entry : registry()) {
    if (!takes_threads(entry) || entry.info.guarantee == Guarantee::approximate) continue;
    for (const char* name : {"plan_changes", "four_bodies_own_keyframes"}) {
      const std::string violation =
          check(entry, synthetic_scene<float>(name, 7), 7, {{"threads", "4"}}, entry.info.topology.preferred);
      EXPECT_TRUE(violation.empty() || violation.rfind("skipped", 0) == 0)
          << entry.info.id << " on " << name << ": " << violation;
    }
  }
}

TEST(Workers, CallEachItemOnceWithARunnerOfItsOwn) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  Workers workers(4);
  std::vector<std::uint32_t> calls(10000, 0);
  std::atomic<std::uint32_t> busy[4] = {};
  workers.for_each(calls.size(), [&](std::size_t item, std::uint32_t runner) {
    EXPECT_EQ(busy[runner].fetch_add(1), 0u);
    ++calls[item];
    busy[runner].fetch_sub(1);
  });
  EXPECT_EQ(std::count(calls.begin(), calls.end(), 1u), 10000);
}

TEST(Workers, TakeItemsOfThoseWhoAreBehind) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  Workers workers(4);
  for (const std::size_t slow : {std::size_t(0), std::size_t(40)}) {  // one runner's items are slow
    std::vector<std::uint32_t> calls(160, 0);
    workers.for_each(calls.size(), [&](std::size_t item, std::uint32_t) {
      std::atomic<int> work{0};
      while (item >= slow && item < slow + 40 && work.fetch_add(1) < 20000) {
      }
      ++calls[item];
    });
    EXPECT_EQ(std::count(calls.begin(), calls.end(), 1u), 160);
  }
}

TEST(Workers, GiveARunnerTheSameItemsAgain) {
  if (most_threads() < 2) GTEST_SKIP() << "built without TBB";
  Workers workers(2);
  // The first runner to arrive may take the other's items, but its own are available to it at every call.
  std::vector<std::uint32_t> first(200);
  std::atomic<std::uint32_t> begun[2];
  std::size_t own = 0, calls = 0;
  for (int i = 0; i < 200; ++i) {
    begun[0] = begun[1] = 0;
    workers.for_each(2, [&](std::size_t item, std::uint32_t runner) {
      first[item] = runner;
      ++begun[runner];
      std::atomic<int> work{0};
      while (work.fetch_add(1) < 2000) {
      }
    });
    if (begun[0] != 1) continue;  // the other one did not arrive in time
    ++calls;
    own += first[0] == 0 && first[1] == 1 ? 1 : 0;
  }
  EXPECT_EQ(own, calls);
}

TEST(Threads, OfALibraryCollectPairsWithoutALoss) {
  PairsByThread found;
  for (std::uint32_t query = 0; query < 3; ++query) {
    PairBuffer pairs{{9, 9, 9, 9}};
    found.start(pairs);
    std::vector<std::thread> threads;
    for (std::uint32_t t = 0; t < 4; ++t)
      threads.emplace_back([&found, t] {
        for (std::uint32_t i = 0; i < 1000; ++i) {
          found.mine().pairs->push_back({0, t, 1, i});
          ++found.mine().box_tests;
        }
      });
    for (std::thread& thread : threads) thread.join();
    found.mine().pairs->push_back({0, 4, 1, 0});
    EXPECT_EQ(found.collect(), 4000u);
    std::sort(pairs.begin(), pairs.end());
    ASSERT_EQ(pairs.size(), 4002u);
    EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end()), pairs.end());
    EXPECT_EQ(found.collect(), 0u);
    EXPECT_EQ(pairs.size(), 4002u);
  }
}

TEST(Workers, PassExceptionsOn) {
  Workers workers(std::min(2u, most_threads()));
  EXPECT_THROW(workers.for_each(100,
                                [](std::size_t item, std::uint32_t) {
                                  if (item == 50) throw std::runtime_error("item 50");
                                }),
               std::runtime_error);
}

TEST(Workers, RefuseMoreThreadsThanThereAre) {
  EXPECT_THROW(Workers(0), std::invalid_argument);
  EXPECT_THROW(Workers(most_threads() + 1), std::invalid_argument);
}

// The fault of an unordered implementation: items in the order in which threads finish them.
TEST(Faults, AnOrderOfCompletionIsNotTheOrderOfItems) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  Workers workers(4);
  std::vector<std::size_t> finished(4000), expected(4000);
  std::atomic<std::size_t> next{0};
  bool differs = false;
  for (int tries = 0; tries < 200 && !differs; ++tries) {
    next = 0;
    workers.for_each(finished.size(), [&](std::size_t item, std::uint32_t) {
      std::atomic<int> work{0};
      while (work.fetch_add(1) < 100) {
      }
      finished[next.fetch_add(1)] = item;
    });
    differs = !std::is_sorted(finished.begin(), finished.end());
  }
  EXPECT_TRUE(differs)
      << "four threads never overtook each other: the comparison of orders above shows nothing";
}

}  // namespace
}  // namespace kbvh::test
