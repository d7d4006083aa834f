#include "experiments/stress/shrink.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace kbvh::experiments::stress {

namespace {

using Clock = std::chrono::steady_clock;

class Shrinker {
 public:
  Shrinker(StressScene scene, const std::function<bool(const StressScene&)>& fails,
           const ShrinkBudget& budget)
      : best_(std::move(scene)), fails_(fails), budget_(budget) {}

  StressScene run() {
    bool smaller = true;
    while (smaller && !spent()) {
      smaller = false;
      smaller |= fewer_bodies();
      smaller |= fewer_steps();
      smaller |= fewer_keyframes();
      smaller |= fewer_frames();
      smaller |= fewer_primitives();
      smaller |= fewer_vertices();
      smaller |= fewer_changes();
      smaller |= rounder_numbers();
    }
    return best_;
  }

 private:
  bool spent() const {
    return tries_ >= budget_.tries ||
           std::chrono::duration<double>(Clock::now() - begin_).count() > budget_.seconds;
  }
  /// Accepts the candidate if it fails, too.
  bool attempt(StressScene candidate) {
    if (spent()) return false;
    ++tries_;
    if (!fails_(candidate)) return false;
    best_ = std::move(candidate);
    return true;
  }

  /// Removes runs of elements, halves first; `remove(scene, begin, end)` removes [begin, end).
  template <class Count, class Remove>
  bool remove_runs(Count&& count, std::size_t least, Remove&& remove) {
    bool any = false;
    for (std::size_t run = std::max<std::size_t>(1, count(best_) / 2); !spent(); run /= 2) {
      for (std::size_t begin = 0; begin < count(best_) && !spent();) {
        const std::size_t end = std::min(begin + run, count(best_));
        if (count(best_) - (end - begin) < least) break;
        StressScene candidate = best_;
        remove(candidate, begin, end);
        if (attempt(std::move(candidate)))
          any = true;
        else
          begin = end;
      }
      if (run <= 1) break;
    }
    return any;
  }
  template <class T>
  static void cut(std::vector<T>& list, std::size_t begin, std::size_t end) {
    list.erase(list.begin() + std::ptrdiff_t(begin), list.begin() + std::ptrdiff_t(end));
  }

  bool fewer_bodies() {
    return remove_runs([](const StressScene& scene) { return scene.bodies.size(); }, 1,
                       [](StressScene& scene, std::size_t begin, std::size_t end) {
                         cut(scene.bodies, begin, end);
                         for (auto& step : scene.steps) {
                           std::erase_if(step.changes, [&](const PlanChange<double>& change) {
                             return change.body >= begin && change.body < end;
                           });
                           for (auto& change : step.changes)
                             if (change.body >= end) change.body -= std::uint32_t(end - begin);
                         }
                       });
  }
  bool fewer_steps() {
    return remove_runs(
        [](const StressScene& scene) { return scene.steps.size(); }, 0,
        [](StressScene& scene, std::size_t begin, std::size_t end) { cut(scene.steps, begin, end); });
  }
  bool fewer_changes() {
    bool any = false;
    for (std::size_t s = 0; s < best_.steps.size(); ++s) {
      any |= remove_runs([s](const StressScene& scene) { return scene.steps[s].changes.size(); }, 0,
                         [s](StressScene& scene, std::size_t begin, std::size_t end) {
                           cut(scene.steps[s].changes, begin, end);
                         });
      for (std::size_t c = 0; c < best_.steps[s].changes.size(); ++c) {
        if (best_.steps[s].changes[c].times.empty()) continue;
        StressScene candidate = best_;
        candidate.steps[s].changes[c].times.clear();
        candidate.steps[s].changes[c].positions.clear();
        any |= attempt(std::move(candidate));
      }
    }
    return any;
  }
  bool fewer_frames() {
    return remove_runs(
        [](const StressScene& scene) { return scene.frames.size(); }, 1,
        [](StressScene& scene, std::size_t begin, std::size_t end) { cut(scene.frames, begin, end); });
  }
  bool fewer_keyframes() {
    bool any = false;
    for (std::size_t b = 0; b < best_.bodies.size(); ++b)
      any |= remove_runs([b](const StressScene& scene) { return scene.bodies[b].times.size(); }, 1,
                         [b](StressScene& scene, std::size_t begin, std::size_t end) {
                           StressBody& body = scene.bodies[b];
                           const std::size_t each = std::size_t(3) * body.vertex_count;
                           cut(body.times, begin, end);
                           cut(body.positions, begin * each, end * each);
                         });
    return any;
  }
  bool fewer_primitives() {
    bool any = false;
    for (std::size_t b = 0; b < best_.bodies.size(); ++b)
      any |= remove_runs([b](const StressScene& scene) { return scene.bodies[b].primitives.size(); }, 0,
                         [b](StressScene& scene, std::size_t begin, std::size_t end) {
                           cut(scene.bodies[b].primitives, begin, end);
                         });
    return any;
  }
  /// Removes all unused vertices at once, with the changes of their plans.
  bool fewer_vertices() {
    StressScene candidate = best_;
    bool any = false;
    for (std::uint32_t b = 0; b < candidate.bodies.size(); ++b) {
      StressBody& body = candidate.bodies[b];
      constexpr std::uint32_t unused = ~std::uint32_t(0);
      std::vector<std::uint32_t> place(body.vertex_count, unused);
      for (const auto& primitive : body.primitives)
        for (const std::uint32_t v : primitive) place[v] = 0;
      std::uint32_t left = 0;
      for (std::uint32_t& p : place)
        if (p != unused) p = left++;
      if (left == body.vertex_count) continue;
      any = true;
      std::vector<double> positions;
      for (std::size_t k = 0; k < body.times.size(); ++k)
        for (std::uint32_t v = 0; v < body.vertex_count; ++v)
          if (place[v] != unused)
            positions.insert(positions.end(), body.position(k, v), body.position(k, v) + 3);
      for (auto& primitive : body.primitives)
        for (std::uint32_t& v : primitive) v = place[v];
      body.positions = std::move(positions);
      body.vertex_count = left;
      for (auto& step : candidate.steps) {
        std::erase_if(step.changes, [&](const PlanChange<double>& change) {
          return change.body == b && place[change.vertex] == unused;
        });
        for (auto& change : step.changes)
          if (change.body == b) change.vertex = place[change.vertex];
      }
    }
    return any && attempt(std::move(candidate));
  }

  /// Lists all numbers that may be rounded.
  static std::vector<double*> numbers(StressScene& scene) {
    std::vector<double*> all;
    for (StressBody& body : scene.bodies)
      for (double& x : body.positions) all.push_back(&x);
    for (auto& step : scene.steps)
      for (auto& change : step.changes) {
        for (double& x : change.positions) all.push_back(&x);
        for (double& x : change.velocity) all.push_back(&x);
      }
    return all;
  }
  /// Rounds a number to at most `bits` binary digits.
  static double rounded(double x, int bits) {
    if (x == 0 || !std::isfinite(x)) return 0;
    int exponent = 0;
    const double mantissa = std::frexp(x, &exponent);
    return std::ldexp(std::nearbyint(std::ldexp(mantissa, bits)), exponent - bits);
  }
  bool rounder_numbers() {
    bool any = false;
    const auto change_runs = [&](auto&& change) {
      for (std::size_t run = std::max<std::size_t>(1, numbers(best_).size());; run /= 2) {
        const std::size_t count = numbers(best_).size();
        for (std::size_t begin = 0; begin < count && !spent(); begin += run) {
          StressScene candidate = best_;
          const auto all = numbers(candidate);
          bool different = false;
          for (std::size_t i = begin; i < std::min(begin + run, count); ++i) {
            const double before = *all[i];
            *all[i] = change(before);
            different |= *all[i] != before || std::signbit(*all[i]) != std::signbit(before);
          }
          if (different) any |= attempt(std::move(candidate));
        }
        if (run <= 1 || spent()) break;
      }
    };
    change_runs([](double) { return 0.0; });
    change_runs([](double x) { return std::abs(x) < 1e15 ? std::round(x) + 0.0 : x; });
    for (const int bits : {1, 4, 12}) change_runs([bits](double x) { return rounded(x, bits); });
    return any;
  }

  StressScene best_;
  const std::function<bool(const StressScene&)>& fails_;
  ShrinkBudget budget_;
  std::size_t tries_ = 0;
  Clock::time_point begin_ = Clock::now();
};

}  // namespace

StressScene shrink(StressScene scene, const std::function<bool(const StressScene&)>& fails,
                   const ShrinkBudget& budget) {
  return Shrinker(std::move(scene), fails, budget).run();
}

}  // namespace kbvh::experiments::stress
