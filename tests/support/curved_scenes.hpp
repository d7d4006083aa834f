#pragma once
#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Scenes whose vertices move on curves of degree 2 and 3: those of other names, bent between their
/// keyframes. Contestants that foresee linear motion only do not take part.
const std::vector<std::string>& curved_scene_names();

/// Makes one by name; deterministic.
template <class S>
TestScene<S> curved_scene(const std::string& name, std::uint32_t frames_per_keyframe = 1);

/// Returns the keyframes of a scene and `between` random times, ascending, each once. Random times lie within
/// `reach` of `centre`, both in lengths of the clip from its beginning on.
template <class S>
std::vector<double> frames_and_between(const Scene<S>& scene, int between, std::uint64_t seed,
                                       double centre = 0.5, double reach = 0.5) {
  Random random(seed);
  std::vector<double> times = frame_times(scene, 1);
  const double first = times.front(), last = times.back();
  for (int i = 0; i < between; ++i)
    times.push_back(first + (last - first) * (centre + reach * random.unit()));
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

/// Makes `copies` control nets over the same vertices, which move along x on these curves in one segment, of
/// one second.
template <class S>
Body<S> net_of_curves(const std::vector<CurvedPiece<S>>& curves, int copies = 1) {
  const std::size_t n = curves.size();
  std::vector<std::uint32_t> all(n);
  std::vector<S> positions(6 * n, S(0));
  SegmentBends<S> bends{std::vector<S>(3 * n, S(0)), std::vector<S>(3 * n, S(0))};
  for (std::size_t v = 0; v < n; ++v) {
    all[v] = std::uint32_t(v);
    positions[3 * v] = curves[v].x0;
    positions[3 * (n + v)] = curves[v].x1;
    bends.bend[3 * v] = curves[v].bend;
    bends.twist[3 * v] = curves[v].twist;
  }
  Body<S> body;
  body.primitives.kind = PrimitiveKind::control_nets;
  for (int copy = 0; copy < copies; ++copy) body.primitives.add(all);
  body.plans = FlightPlans<S>(std::uint32_t(n), {0, 1}, std::move(positions), {bends});
  return body;
}

/// Returns a line, and n - 1 narrow parabolas that rise above it one after the other. Their upper envelope is
/// 1 2 1 3 1 4 ... 1: as long as order 2 allows.
inline std::vector<CurvedPiece<double>> line_and_parabolas(std::uint32_t n) {
  std::vector<CurvedPiece<double>> curves(1);
  const double gaps = n - 1, height = 0.09 / (gaps * gaps);
  for (std::uint32_t v = 1; v < n; ++v) {
    const double top = (v - 0.5) / gaps;
    curves.push_back({0, 1, height - top * top, height - (1 - top) * (1 - top), 1, 0});
  }
  return curves;
}

}  // namespace kbvh::test
