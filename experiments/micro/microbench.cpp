// Micro-benchmarks of kernels, builders, exact tests, queue operations and events: ns each. Google Benchmark
// runs them; its tools compare two commits (compare.py benchmarks old.json new.json). Only `kbvh run`
// measures clips.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <span>

#include "core/families/events/event_queue.hpp"
#include "core/families/events/segment_queue.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/geometry/triangle_batch.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/judge/session.hpp"

namespace kbvh::experiments {
namespace {

/// A sheet of 2 n^2 triangles at this height; with `keyframes` of a wave.
Body<float> sheet(std::uint32_t n, double height, std::uint32_t keyframes) {
  Body<float> body;
  std::vector<double> times;
  std::vector<float> positions;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(k);
    for (std::uint32_t j = 0; j <= n; ++j)
      for (std::uint32_t i = 0; i <= n; ++i) {
        const double x = double(i) / n, y = double(j) / n;
        positions.push_back(float(x));
        positions.push_back(float(y));
        positions.push_back(float(height + 0.05 * std::sin(20 * x + 15 * y + 0.5 * k)));
      }
  }
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t corner = j * (n + 1) + i;
      body.primitives.add(std::vector<std::uint32_t>{corner, corner + 1, corner + n + 1});
      body.primitives.add(std::vector<std::uint32_t>{corner + 1, corner + n + 2, corner + n + 1});
    }
  body.plans = FlightPlans<float>((n + 1) * (n + 1), std::move(times), std::move(positions));
  return body;
}

/// Two sheets through each other, 2 n^2 triangles each.
Scene<float> sheets(std::uint32_t n, std::uint32_t keyframes) {
  Scene<float> scene;
  scene.bodies.push_back(sheet(n, 0, keyframes));
  scene.bodies.push_back(sheet(n, 0.02, 1));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

/// Reports how long one of `count` items in each iteration takes.
void report_each(benchmark::State& state, double count, const char* what) {
  state.counters[std::string("s_per_") + what] =
      benchmark::Counter(count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

constexpr std::uint32_t grid = 90;  // 16,200 triangles

WideHierarchy<float> hierarchy_of(const Body<float>& body, const float* positions, std::uint32_t width,
                                  std::uint32_t leaf_size, KernelSet kernels) {
  WideHierarchy<float> hierarchy;
  hierarchy.assign(build_topology(body.primitives, positions,
                                  {.method = BuildMethod::median, .width = width, .leaf_size = leaf_size}),
                   body.primitives, kernels);
  return hierarchy;
}

void refit(benchmark::State& state, std::uint32_t width, std::uint32_t leaf_size, KernelSet kernels) {
  const Scene<float> scene = sheets(grid, 1);
  Playback<float> playback(scene);
  playback.evaluate_all();
  WideHierarchy<float> hierarchy =
      hierarchy_of(scene.bodies[0], playback.positions(0), width, leaf_size, kernels);
  for (auto _ : state) {
    hierarchy.refit(playback.positions(0));
    benchmark::DoNotOptimize(hierarchy.box(0));
  }
  report_each(state, double(hierarchy.topology().size()), "node");
}

void overlap(benchmark::State& state, KernelSet kernels) {
  const Scene<float> scene = sheets(grid, 1);
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  playback.evaluate_all();
  std::vector<WideHierarchy<float>> sides;
  for (std::uint32_t body = 0; body < 2; ++body) {
    sides.push_back(hierarchy_of(scene.bodies[body], playback.positions(body), 8, 16, kernels));
    sides.back().refit(playback.positions(body));
  }
  WideQuery<float> query(view, SampledMotion<float>(playback));
  PairBuffer pairs;
  std::uint64_t tests = 0, of_one = 0;
  for (auto _ : state) {
    pairs.clear();
    const std::uint64_t before = tests;
    query.run({&sides[0], 0}, {&sides[1], 1}, pairs, tests, Budget{});
    of_one = tests - before;
  }
  report_each(state, double(of_one), "box_test");
}

enum class RayOrder : std::uint8_t {
  rows,    ///< of a camera's pixels
  tiles,   ///< of 8 x 8 pixels
  random,  ///< from anywhere to anywhere
};

std::vector<Ray<float>> rays_at_a_sheet(RayOrder order) {
  constexpr std::uint32_t side = 96;
  std::mt19937 random(1);
  const auto share = [&] { return float(random() >> 8) / float(1 << 24); };
  std::vector<Ray<float>> rays;
  for (std::uint32_t i = 0; i < side * side; ++i) {
    const std::uint32_t tile = i / 64, x = order == RayOrder::rows ? i % side : tile % 12 * 8 + i % 8,
                        y = order == RayOrder::rows ? i / side : tile / 12 * 8 + i / 8 % 8;
    Ray<float> ray{{1.9F, -1.2F, 1.1F}, {}};
    const float at[3] = {float(x) / side, float(y) / side, 0};
    for (int axis = 0; axis < 3; ++axis) {
      if (order == RayOrder::random) ray.origin[axis] = axis == 2 ? 0.2F * share() - 0.1F : share();
      ray.direction[axis] = order == RayOrder::random ? share() - 0.5F : at[axis] - ray.origin[axis];
    }
    rays.push_back(ray);
  }
  return rays;
}

/// The closest hits of rays on a sheet of 64,800 triangles, asked for `at_once` at a time.
void closest_hits(benchmark::State& state, RayOrder order, std::size_t at_once, KernelSet kernels) {
  Scene<float> scene;
  scene.bodies.push_back(sheet(180, 0, 1));
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  playback.evaluate_all();
  WideHierarchy<float> hierarchy = hierarchy_of(scene.bodies[0], playback.positions(0), 8, 16, kernels);
  hierarchy.refit(playback.positions(0));
  WideProbes<float> probes(view, SampledMotion<float>(playback));
  const std::vector<Ray<float>> rays = rays_at_a_sheet(order);
  std::vector<RayHit> hits(rays.size());
  TriangleTestStats stats;
  std::uint64_t tests = 0;
  const auto side_of = [&](std::uint32_t body) -> WideSide<float> { return {&hierarchy, body}; };
  for (auto _ : state)
    for (std::size_t begin = 0; begin < rays.size(); begin += at_once) {
      const std::size_t count = std::min(at_once, rays.size() - begin);
      probes.answer(
          RayProbes<float>{RayQuery::closest, std::span(rays).subspan(begin, count), {&hits[begin], count}},
          side_of, stats, tests);
    }
  report_each(state, double(rays.size()), "ray");
}

void build(benchmark::State& state, BuildMethod method) {
  const Scene<float> scene = sheets(grid, 1);
  Playback<float> playback(scene);
  playback.evaluate_all();
  for (auto _ : state)
    benchmark::DoNotOptimize(build_topology(scene.bodies[0].primitives, playback.positions(0),
                                            {.method = method, .width = 8, .leaf_size = 16}));
  report_each(state, double(scene.bodies[0].primitives.count()), "primitive");
}

/// Random triangles of which about a tenth intersect; `grazing`: with corners on a coarse grid, so that exact
/// arithmetic decides many.
std::vector<float> triangles(std::size_t count, bool grazing) {
  std::mt19937 random(1);
  std::vector<float> corners;
  for (std::size_t i = 0; i < 9 * count; ++i) {
    const double value = double(random() >> 8) / double(1 << 24);
    corners.push_back(float(grazing ? std::round(4 * value) / 4 : value));
  }
  corners.push_back(0);  // readers may load four scalars
  return corners;
}

void exact_test(benchmark::State& state, bool grazing) {
  constexpr std::size_t count = 2000;
  const std::vector<float> corners = triangles(2 * count, grazing);
  for (auto _ : state) {
    std::size_t found = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const float* const c = corners.data() + 18 * i;
      found += triangles_intersect(c, c + 3, c + 6, c + 9, c + 12, c + 15) ? 1 : 0;
    }
    benchmark::DoNotOptimize(found);
  }
  report_each(state, double(count), "pair");
}

template <class Queue>
void queue(benchmark::State& state) {
  constexpr std::uint32_t slots = 4096;
  const Scene<float> scene = sheets(20, 5);
  Playback<float> playback(scene);
  EventClock<float> clock({&playback.plans(0), &playback.plans(1)});
  clock.start();
  std::mt19937 random(1);
  std::vector<double> times;
  for (std::uint32_t i = 0; i < slots; ++i) times.push_back(double(random() >> 8) / double(1 << 24));
  const std::vector<double> cuts{0, 0.25, 0.5, 0.75, 1};
  for (auto _ : state) {
    Queue events(clock, slots);
    if constexpr (requires { events.split_at(cuts); }) events.split_at(cuts);
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      Event event;
      event.slot = slot;
      event.hint = times[slot];
      event.begin = 0;
      event.end = 1;
      events.schedule(event);
    }
    while (!events.empty()) events.pop();
  }
  report_each(state, 2.0 * slots, "operation");
}

/// A kinetic tree over one clip, without the clip's beginning.
void events(benchmark::State& state, const char* id) {
  const Scene<float> scene = sheets(40, 9);
  const StrategyEntry* entry = nullptr;
  for (const StrategyEntry& one : registry())
    if (one.info.id == id) entry = &one;
  if (entry == nullptr) {
    state.SkipWithError("this program was built without it");
    return;
  }
  const Contestant contestant{entry, {}, entry->info.topology.preferred};
  Session<float> counted(scene, contestant);
  PhaseTimes ignored;
  counted.reset(0);
  counted.advance(8, ignored);
  const auto failed = counted.strategy().counters()[Counter::certificates_failed];
  Session<float> session(scene, contestant);
  for (auto _ : state) {
    session.reset(0);
    PhaseTimes times;
    session.advance(8, times);
    state.SetIterationTime(times.update);
  }
  report_each(state, double(failed), "event");
}

void register_all() {
  using benchmark::RegisterBenchmark;
  for (const KernelSet kernels : supported_kernel_sets()) {
    const std::string set = name(kernels);
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf_size : {1u, 4u, 16u})
        RegisterBenchmark(
            ("refit/" + set + "/width " + std::to_string(width) + "/leaf " + std::to_string(leaf_size))
                .c_str(),
            [=](benchmark::State& state) { refit(state, width, leaf_size, kernels); });
    RegisterBenchmark(("overlap/" + set).c_str(), [=](benchmark::State& state) { overlap(state, kernels); });
    for (const auto& [order, word] :
         {std::pair(RayOrder::rows, "rows"), {RayOrder::tiles, "tiles"}, {RayOrder::random, "random"}})
      for (const auto& [at_once, how] :
           {std::pair<std::size_t, const char*>(1, "/1 at a time"), {64, "/64 at a time"}, {1U << 20, ""}})
        RegisterBenchmark(("rays/" + set + "/" + word + how).c_str(),
                          [order = order, at_once = at_once, kernels](benchmark::State& state) {
                            closest_hits(state, order, at_once, kernels);
                          });
  }
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
    RegisterBenchmark((std::string("build/") + name(method)).c_str(),
                      [=](benchmark::State& state) { build(state, method); });
  RegisterBenchmark("triangles/random", [](benchmark::State& state) { exact_test(state, false); });
  RegisterBenchmark("triangles/grazing", [](benchmark::State& state) { exact_test(state, true); });
  RegisterBenchmark("queue/avl", &queue<AvlQueue<float>>);
  RegisterBenchmark("queue/binary_heap", &queue<BinaryHeapQueue<float>>);
  RegisterBenchmark("queue/segment_heap", &queue<SegmentHeapQueue<float>>);
  for (const char* id : {"kinetic_aabb", "kinetic_boxtree", "kinetic_separation_list"})
    RegisterBenchmark((std::string("events/") + id).c_str(), [=](benchmark::State& state) {
      events(state, id);
    })->UseManualTime();
}

}  // namespace
}  // namespace kbvh::experiments

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  kbvh::experiments::register_all();
  benchmark::RunSpecifiedBenchmarks();
}
