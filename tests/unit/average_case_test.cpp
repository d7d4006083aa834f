// Average-case collision detection: the predicted probability that two nodes intersect against the observed
// frequency, on scenes of several kinds; how much a grid of an earlier frame is still worth; and that the
// traversal finds everything in descending order of probability. Prints its tables if KBVH_TABLES is set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <set>

#include "core/families/average/probable_pairs.hpp"
#include "core/judge/oracle.hpp"
#include "core/topology/builders.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments::average_case_test {
namespace {

/// Pairs of nodes with a predicted probability in one tenth of [0, 1].
struct Bin {
  double predicted = 0, observed = 0, count = 0;
};
/// Pairs of overlapping nodes of all levels.
struct Calibration {
  Bin bins[10];
  double brier = 0, uninformed = 0;  ///< mean squared errors: of the prediction, and of the mean frequency
  std::vector<std::pair<double, bool>> all;
  double ranking = 0;  ///< the probability that of a pair that meets and one that does not, the former has
                       ///< the higher prediction; 0.5: no information
  double filled = 0, changed = 0;  ///< cells; of the first frame, and filled in only one of two frames

  void add(double predicted, bool observed) {
    Bin& bin = bins[std::min(9, int(10 * predicted))];
    bin.predicted += predicted;
    bin.observed += observed;
    ++bin.count;
    brier += (predicted - observed) * (predicted - observed);
    all.emplace_back(predicted, observed);
  }
  double pairs() const {
    double total = 0;
    for (const Bin& bin : bins) total += bin.count;
    return total;
  }
  void finish() {
    double hits = 0;
    for (const Bin& bin : bins) hits += bin.observed;
    const double share = hits / pairs();
    brier /= pairs();
    uninformed = share * (1 - share);
    std::sort(all.begin(), all.end());
    double misses = 0, right = 0;
    for (std::size_t i = 0; i < all.size();) {
      std::size_t end = i;
      double equal_hits = 0;
      for (; end < all.size() && all[end].first == all[i].first; ++end) equal_hits += all[end].second;
      const double equal_misses = double(end - i) - equal_hits;
      right += equal_hits * (misses + equal_misses / 2);
      misses += equal_misses;
      i = end;
    }
    ranking = right / (hits * misses);
  }
  void print(const char* name) const {
    if (std::getenv("KBVH_TABLES") == nullptr) return;
    std::printf(
        "%s: %.0f pairs of nodes, squared error %.4f, of the mean %.4f, ranking %.3f, cells changed %.3f\n",
        name, pairs(), brier, uninformed, ranking, filled > 0 ? changed / filled : 0);
    for (const Bin& bin : bins)
      if (bin.count > 0)
        std::printf("  predicted %.2f  observed %.2f  pairs %.0f\n", bin.predicted / bin.count,
                    bin.observed / bin.count, bin.count);
  }
};

/// Whether the grids are those of the current frame or of the first keyframe.
enum class Grids : std::uint8_t { current, first };

/// Box tests until the first intersecting pair of leaves, summed over frames and pairs of bodies.
struct FirstHits {
  double by_probability = 0, in_order = 0, cases = 0;
};

struct Study {
  explicit Study(const char* name, std::uint32_t triangles) {
    SceneSpec spec;
    spec.builtin = name;
    spec.options = {.triangles = triangles, .seed = 1, .keyframes = 9};
    scene = assemble<float>(load(spec));
  }

  Calibration run(Distribution distribution, Grids grids) {
    Calibration result;
    Playback<float> playback(scene);
    const auto times = scene.bodies[0].plans.keyframe_times();
    std::vector<WideHierarchy<float>> trees(scene.bodies.size());
    std::vector<CellMasks<float>> masks(scene.bodies.size());
    for (std::size_t frame = 0; frame < times.size(); frame += 2) {
      playback.seek(times[frame]);
      for (std::uint32_t body = 0; body < trees.size(); ++body) playback.fetch_all(body);
      for (std::uint32_t body = 0; body < trees.size(); ++body) {
        const Primitives& primitives = scene.bodies[body].primitives;
        const float* const positions = playback.positions(body);
        if (frame == 0) {
          trees[body].assign(build_topology(primitives, positions,
                                            {.method = BuildMethod::median, .width = 8, .leaf_size = 8}),
                             primitives, active_kernel_set());
          masks[body].assign(trees[body]);
        }
        trees[body].refit(positions);
        CellMasks<float> fresh;
        fresh.assign(trees[body]);
        fresh.sample(trees[body], primitives, positions);
        if (frame == 0) masks[body] = fresh;
        for (std::uint32_t slot = 0; slot < fresh.slots(); ++slot) {
          result.filled += std::popcount(masks[body].of(slot));
          result.changed += std::popcount(masks[body].of(slot) ^ fresh.of(slot));
        }
        if (grids == Grids::current) masks[body] = fresh;
      }
      judge(playback, trees, masks, distribution, result);
    }
    result.finish();
    return result;
  }

  /// Follows all pairs of overlapping nodes, and compares each prediction with the truth.
  void judge(Playback<float>& playback, std::vector<WideHierarchy<float>>& trees,
             const std::vector<CellMasks<float>>& masks, Distribution distribution, Calibration& result) {
    std::set<std::array<std::uint32_t, 3>> meeting;  // pair of bodies, leaves
    std::vector<std::vector<std::uint32_t>> leaf_of;
    for (std::uint32_t body = 0; body < trees.size(); ++body) {
      leaf_of.emplace_back(scene.bodies[body].primitives.count());
      for (std::uint32_t leaf = 0; leaf < trees[body].leaf_count(); ++leaf)
        for (const std::uint32_t primitive : trees[body].leaf_primitives(leaf))
          leaf_of[body][primitive] = leaf;
    }
    const auto number_of = [&](std::uint32_t first, std::uint32_t second) {
      const auto found = std::find_if(scene.pairs.begin(), scene.pairs.end(), [&](const BodyPair& pair) {
        return pair.first == first && pair.second == second;
      });
      return std::uint32_t(found - scene.pairs.begin());
    };
    for (const PrimitivePair& pair : sweep_pairs(scene, playback))
      meeting.insert({number_of(pair.body_a, pair.body_b), leaf_of[pair.body_a][pair.primitive_a],
                      leaf_of[pair.body_b][pair.primitive_b]});
    for (std::uint32_t i = 0; i < scene.pairs.size(); ++i) {
      const auto [first, second] = scene.pairs[i];
      if (first == second) continue;
      const ProbablePairs<float>::Side a{&trees[first], &masks[first]}, b{&trees[second], &masks[second]};
      const std::function<bool(ProbablePairs<float>&)> follow = [&](ProbablePairs<float>& below) {
        bool any = false;
        while (!below.empty()) {
          const auto entry = below.pop();
          bool meets = false;
          if (ProbablePairs<float>::is_leaf(a, entry.a) && ProbablePairs<float>::is_leaf(b, entry.b)) {
            meets =
                meeting.count({i, trees[first].leaf_number({entry.a}), trees[second].leaf_number({entry.b})});
          } else {
            ProbablePairs<float> children;
            children.expand(entry, a, b, distribution);
            meets = follow(children);
          }
          result.add(entry.probability, meets);
          any = any || meets;
        }
        return any;
      };
      if (trees[first].empty() || trees[second].empty()) continue;
      const auto meets = [&](const ProbablePairs<float>::Entry& entry) {
        return ProbablePairs<float>::is_leaf(a, entry.a) && ProbablePairs<float>::is_leaf(b, entry.b) &&
               meeting.count(
                   {i, trees[first].leaf_number({entry.a}), trees[second].leaf_number({entry.b})}) != 0;
      };
      find_first(i, a, b, distribution, meets);
      ProbablePairs<float> top;
      top.start(i, a, b, distribution);
      follow(top);
    }
  }

  /// Searches for the first intersecting pair of leaves: in order of probability, and depth first. A pair of
  /// leaves of 8 counts as 64 tests.
  template <class Meets>
  void find_first(std::uint32_t i, const ProbablePairs<float>::Side& a, const ProbablePairs<float>::Side& b,
                  Distribution distribution, const Meets& meets) {
    const auto both_leaves = [&](const ProbablePairs<float>::Entry& entry) {
      return ProbablePairs<float>::is_leaf(a, entry.a) && ProbablePairs<float>::is_leaf(b, entry.b);
    };
    double best_first = 0, depth_first = 0;
    bool found = false;
    ProbablePairs<float> queue;
    best_first += double(queue.start(i, a, b, distribution));
    while (!queue.empty() && !found) {
      const auto entry = queue.pop();
      found = meets(entry);
      best_first += both_leaves(entry) ? 64 : double(queue.expand(entry, a, b, distribution));
    }
    if (!found) return;
    found = false;
    std::vector<ProbablePairs<float>::Entry> stack;
    const auto push = [&](ProbablePairs<float>& children) {
      const std::size_t before = stack.size();
      while (!children.empty()) stack.push_back(children.pop());
      std::sort(stack.begin() + std::ptrdiff_t(before), stack.end(),
                [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
    };
    ProbablePairs<float> children;
    depth_first += double(children.start(i, a, b, distribution));
    push(children);
    while (!found) {
      const auto entry = stack.back();
      stack.pop_back();
      found = meets(entry);
      if (both_leaves(entry)) {
        depth_first += 64;
      } else {
        depth_first += double(children.expand(entry, a, b, distribution));
        push(children);
      }
    }
    hits.by_probability += best_first;
    hits.in_order += depth_first;
    ++hits.cases;
  }

  Scene<float> scene;
  FirstHits hits;
};

class AverageCase : public testing::TestWithParam<const char*> {};

TEST_P(AverageCase, PredictionsOrderAndBound) {
  Study study(GetParam(), 4000);
  const std::string name = GetParam();
  const Calibration cells = study.run(Distribution::cells, Grids::current);
  const FirstHits hits = study.hits;
  const Calibration count = study.run(Distribution::count, Grids::current),
                    old = study.run(Distribution::cells, Grids::first);
  cells.print((name + ", cells").c_str());
  count.print((name + ", count").c_str());
  old.print((name + ", cells of the first frame").c_str());
  if (std::getenv("KBVH_TABLES") != nullptr)
    std::printf("%s: box tests to the first hit: %.0f by probability, %.0f depth first; %.0f cases\n",
                name.c_str(), hits.by_probability / hits.cases, hits.in_order / hits.cases, hits.cases);
  EXPECT_GT(cells.pairs(), 500);
  EXPECT_EQ(cells.pairs(), count.pairs());
  // The order of the traversal is informative, and the place of filled cells more so than their number.
  EXPECT_GT(cells.ranking, 0.75);
  EXPECT_GT(cells.ranking, count.ranking);
  // Predictions from current grids are lower bounds, up to chance.
  for (const Bin& bin : cells.bins)
    if (bin.count >= 30) {
      EXPECT_GE(bin.observed / bin.count, bin.predicted / bin.count - 0.1);
    }
}
INSTANTIATE_TEST_SUITE_P(Scenes, AverageCase,
                         testing::Values("tablecloth", "mixing_swarms", "shattering_balls"));

TEST(PairProbability, GrowsWithTheFilledCellsInTheOverlap) {
  const auto box = [](double lower, double upper, CellMask filled) {
    return FilledBox{{lower, lower, lower}, {upper, upper, upper}, filled};
  };
  constexpr CellMask all = ~CellMask(0), first = 1, last = CellMask(1) << 63;
  const auto p = [&](const FilledBox& a, const FilledBox& b) {
    return probability_of_meeting(a, b, Distribution::cells);
  };
  EXPECT_EQ(p(box(0, 4, 0), box(3, 7, all)), 0);
  EXPECT_EQ(p(box(0, 4, first), box(3, 7, all)), 0);  // not in the overlap
  EXPECT_NEAR(p(box(0, 4, last), box(3, 7, all)), planes_meet, 1e-12);
  EXPECT_NEAR(p(box(0, 4, last), box(3, 7, all)), p(box(3, 7, all), box(0, 4, last)), 1e-12);
  EXPECT_GT(p(box(0, 4, all), box(2, 6, all)), p(box(0, 4, all), box(3, 7, all)));
  EXPECT_GT(p(box(0, 4, all), box(0, 4, all)), 0.999);
  EXPECT_LT(p(box(0, 4, all), box(3.9, 7.9, all)), 0.1);  // a corner of a cell
  EXPECT_EQ(p(box(0, 4, all), box(4, 8, all)), 0);        // boxes that only touch
  // Spread evenly, the cell counts wherever the overlap is.
  EXPECT_GT(probability_of_meeting(box(0, 4, first), box(3, 7, all), Distribution::count), 0);
}

}  // namespace
}  // namespace kbvh::experiments::average_case_test
