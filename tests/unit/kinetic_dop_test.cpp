// Kinetic trees with any number of sides: at the exact times of events and at random times every realiser is
// extremal on the projected plans, in rational arithmetic, and the k-DOPs contain every vertex at its rounded
// position. Faults seeded into events and margins are found.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/realiser_dops.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/rational_volumes.hpp"
#include "tests/support/vertices_below.hpp"

namespace kbvh::test::kinetic_dop_test {
namespace {

enum class Clip { ties, random, far_away, tiny, mixed_scales };
constexpr Clip clips[] = {Clip::ties, Clip::random, Clip::far_away, Clip::tiny, Clip::mixed_scales};

double coordinate(Clip clip, Random& random) {
  switch (clip) {
    case Clip::ties:
      return double(random.below(4));
    case Clip::random:
      return random.unit();
    case Clip::far_away:
      return 1e6 + random.unit();
    case Clip::tiny:
      return 1e-30 * random.unit();
    case Clip::mixed_scales:
      return std::ldexp(random.unit(), int(random.below(60)) - 30);
  }
  return 0;
}

/// A soup of triangles and a body that rests.
template <class S>
Scene<S> random_clip(Clip clip, std::uint64_t seed) {
  Random random(seed);
  Scene<S> scene;
  for (const std::uint32_t keyframes : {5u, 1u}) {
    constexpr std::uint32_t triangles = 13, vertices = 20;
    Body<S> body;
    std::vector<double> times;
    std::vector<S> positions;
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      times.push_back(k + (clip == Clip::ties ? 0.0 : 0.3 * random.unit()));
      for (std::uint32_t i = 0; i < 3 * vertices; ++i) positions.push_back(S(coordinate(clip, random)));
    }
    for (std::uint32_t i = 0; i < triangles; ++i) {
      const std::uint32_t first = random.below(vertices - 2);
      body.primitives.add(std::vector<std::uint32_t>{first, first + 1, first + 2});
    }
    body.plans = FlightPlans<S>(vertices, std::move(times), std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

enum class Fault { none, lost_event, no_margin, small_margin };

struct Findings {
  std::uint64_t events = 0, not_extremal = 0, outside = 0;
};

template <class S, int K>
class Play {
  using Forest = KineticForest<S, SegmentHeapQueue<S>, NoObserver, KineticDop<K>::template Tree>;
  using Boxes = KineticForest<S, AvlQueue<S>>;

 public:
  Play(const Scene<S>& scene, const BuilderConfig& builder)
      : scene_(scene),
        view_(scene_),
        playback_(scene_),
        forest_(view_, ClipMotion<S>(playback_), at_start(builder), count_),
        boxes_(view_, ClipMotion<S>(playback_), at_start(builder), count_) {
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      dops_.emplace_back(forest_.clock(), body, forest_.tree(body).topology().size());
      dops_.back().start_over();
      margins_.emplace_back().start_over(playback_.plans(body));
      below_.push_back(vertices_below(forest_.tree(body)));
    }
  }

  Findings run(Fault fault, std::uint64_t seed, bool plans_change) {
    Random random(seed);
    std::vector<double> frames{-1.5, 0, 1, 2.5, 9};
    for (int i = 0; i < 5; ++i) frames.push_back(2.2 + 2.4 * random.unit());
    std::sort(frames.begin(), frames.end());
    playback_.seek(frames[0]);
    forest_.reset(frames[0]);
    boxes_.reset(frames[0]);
    for (const double t : frames) {
      playback_.seek(t);
      playback_.evaluate_all();
      while (forest_.due(t)) {
        const Event event = forest_.queue().top();
        const Rational time = root_of(forest_.clock().crossing(event));
        if (++found_.events == 15 && fault == Fault::lost_event)
          forest_.queue().pop();
        else
          forest_.handle_next();
        if (found_.events % 64 == 0) check_realisers(time);
      }
      boxes_.advance(t);
      if (fault == Fault::none) compare_with_boxes();
      check_realisers(exact(t));
      check_positions(t, fault);
      if (plans_change && t > 0) change_plans(t, random);
    }
    return found_;
  }

 private:
  Topologies at_start(const BuilderConfig& builder) {
    playback_.seek(0);
    playback_.evaluate_all();
    return build_topologies(view_, playback_, builder);
  }
  static Rational root_of(const Crossing<S>& crossing) {
    // Two lines, each by its values at two times.
    const auto line = [](const Piece<S>& piece) {
      const Rational x0 = exact(double(piece.x0)), x1 = exact(double(piece.x1)), t0 = exact(piece.t0);
      const Rational slope =
          piece.kind == PieceKind::ray ? x1 : Rational((x1 - x0) / (exact(piece.t1) - exact(piece.t0)));
      return std::array<Rational, 2>{x0 - slope * t0, slope};
    };
    const auto w = line(crossing.winner), l = line(crossing.loser);
    return (w[0] - l[0]) / (l[1] - w[1]);
  }
  /// Returns the place of a vertex on its projected plan, from the definition.
  Rational value(std::uint32_t body, std::uint32_t vertex, const SlabDirection& n, const Rational& t) const {
    const FlightPlans<S>& plans = playback_.plans(body);
    double from = double(t);
    while (exact(from) > t) from = std::nextafter(from, -1e9);
    Piece<S> piece[3];
    for (int axis = 0; axis < 3; ++axis) {
      piece[axis] = plans.piece_after(vertex, axis, from);
      while (!std::isinf(piece[axis].t1) && exact(piece[axis].t1) <= t)
        piece[axis] = plans.piece_after(vertex, axis, piece[axis].t1);
    }
    const auto along = [&](S Piece<S>::*end) {
      const S p[3] = {piece[0].*end, piece[1].*end, piece[2].*end};
      const S rounded = projected(n, p);
      const Rational sum =
          n[0] * exact(double(p[0])) + n[1] * exact(double(p[1])) + n[2] * exact(double(p[2]));
      EXPECT_LE(magnitude(exact(double(rounded)) - sum),
                magnitude(sum) * exact(double(std::numeric_limits<S>::epsilon())) +
                    exact(double(std::numeric_limits<S>::denorm_min())));
      return exact(double(rounded));
    };
    const Rational first = along(&Piece<S>::x0), second = along(&Piece<S>::x1);
    const Rational elapsed = t - exact(piece[0].t0);
    if (piece[0].kind == PieceKind::ray) return first + second * elapsed;
    return first + (second - first) * elapsed / (exact(piece[0].t1) - exact(piece[0].t0));
  }
  void check_realisers(const Rational& t) {
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      const auto& tree = forest_.tree(body);
      for (std::size_t direction = 0; direction < K / 2; ++direction) {
        std::vector<Rational> values;
        for (std::uint32_t v = 0; v < playback_.plans(body).vertex_count(); ++v)
          values.push_back(value(body, v, tree.directions[direction], t));
        for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
          const auto lower = tree.realiser(node, Side(2 * direction)),
                     upper = tree.realiser(node, Side(2 * direction + 1));
          const auto& below = below_[body][node];
          EXPECT_EQ(std::count(below.begin(), below.end(), lower) > 0, true);
          EXPECT_EQ(std::count(below.begin(), below.end(), upper) > 0, true);
          for (const std::uint32_t v : below)
            found_.not_extremal += (values[v] < values[lower] ? 1 : 0) + (values[v] > values[upper] ? 1 : 0);
        }
      }
    }
  }
  void check_positions(double t, Fault fault) {
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      const auto& tree = forest_.tree(body);
      const double margin = margins_[body].at(t) * (fault == Fault::no_margin      ? 0
                                                    : fault == Fault::small_margin ? 0.05
                                                                                   : 1);
      dops_[body].new_frame(t, tree.realisers(0));
      for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
        dops_[body].ensure(node);
        Dop<S, K> dop = dops_[body](node);
        const Dop<S, K> computed =
            dop_of_realisers<S, K>(tree.realisers(node), forest_.clock(), body, t, margin);
        if (fault == Fault::none)
          EXPECT_EQ(dop, computed);
        else
          dop = computed;
        Box<S> box;
        for (const std::uint32_t v : below_[body][node]) {
          const S* const position = playback_.position(body, v);
          box.extend(position);
          if (!contains(dop, rational(position))) ++found_.outside;
        }
        for (std::size_t axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(dop.lower[axis], box.lower[axis]) << "a side along an axis is not tight";
          EXPECT_EQ(dop.upper[axis], box.upper[axis]) << "a side along an axis is not tight";
        }
      }
    }
  }
  /// Checks that the sides along the axes have the events of the AABB tree.
  void compare_with_boxes() {
    for (std::uint32_t body = 0; body < forest_.size(); ++body)
      for (std::uint32_t node = 0; node < forest_.tree(body).topology().size(); ++node)
        EXPECT_TRUE(std::equal(boxes_.tree(body).realisers(node), boxes_.tree(body).realisers(node) + 6,
                               forest_.tree(body).realisers(node)));
  }
  void change_plans(double t, Random& random) {
    std::vector<PlanChange<S>> changes;
    for (std::uint32_t i = 0; i < 3; ++i) {
      PlanChange<S> change;
      change.body = random.below(2);
      change.vertex = random.below(playback_.plans(change.body).vertex_count());
      const double scale = std::fabs(double(playback_.position(change.body, change.vertex)[0]));
      for (S& v : change.velocity) v = S(scale * random.unit());
      if (random.below(2) == 0) {
        change.times = {t + 0.5};
        for (int axis = 0; axis < 3; ++axis) change.positions.push_back(S(scale * random.unit()));
      }
      changes.push_back(change);
    }
    playback_.change_plans(t, changes);
    forest_.plans_changed(t, changes);
    boxes_.plans_changed(t, changes);
    for (const PlanChange<S>& change : changes) {
      dops_[change.body].include(change.vertex, t);
      margins_[change.body].include(playback_.plans(change.body), change.vertex, t);
    }
    check_realisers(exact(t));
  }

  Scene<S> scene_;
  SceneView<S> view_;
  Playback<S> playback_;
  Counters count_;
  Forest forest_;
  Boxes boxes_;
  std::vector<RealiserDops<S, K>> dops_;
  std::vector<ProjectionMargin<S>> margins_;
  std::vector<std::vector<std::vector<std::uint32_t>>> below_;  ///< [body][node]
  Findings found_;
};

template <class S, int K>
void expect_sound() {
  std::uint64_t events = 0;
  for (const Clip clip : clips)
    for (const std::uint32_t width : {2u, 8u})
      for (const bool plans_change : {false, true}) {
        const BuilderConfig builder{.method = BuildMethod::median, .width = width, .leaf_size = width / 2};
        Play<S, K> play(random_clip<S>(clip, 7 + width), builder);
        const Findings found = play.run(Fault::none, 3, plans_change);
        const std::string where = "clip " + std::to_string(int(clip)) + ", " + std::to_string(K) +
                                  " sides, width " + std::to_string(width) +
                                  (plans_change ? ", plans change" : "");
        EXPECT_EQ(found.not_extremal, 0u) << where;
        EXPECT_EQ(found.outside, 0u) << where;
        events += found.events;
      }
  EXPECT_GT(events, 1000u);
}

TEST(KineticDop, RealisersAreExtremalAndVolumesContainEveryVertexInFloat) {
  expect_sound<float, 6>();
  expect_sound<float, 14>();
  expect_sound<float, 18>();
  expect_sound<float, 26>();
}
TEST(KineticDop, RealisersAreExtremalAndVolumesContainEveryVertexInDouble) {
  expect_sound<double, 6>();
  expect_sound<double, 14>();
  expect_sound<double, 18>();
  expect_sound<double, 26>();
}

template <class S>
Findings with_fault(Fault fault, Clip clip) {
  return Play<S, 26>(random_clip<S>(clip, 5), {.method = BuildMethod::median, .width = 2, .leaf_size = 1})
      .run(fault, 4, false);
}

TEST(KineticDopFaults, ALostEventIsFound) {
  EXPECT_GT(with_fault<float>(Fault::lost_event, Clip::random).not_extremal, 0u);
  EXPECT_GT(with_fault<double>(Fault::lost_event, Clip::far_away).not_extremal, 0u);
}
TEST(KineticDopFaults, MissingMarginsAreFound) {
  for (const Fault fault : {Fault::no_margin, Fault::small_margin}) {
    EXPECT_GT(with_fault<float>(fault, Clip::far_away).outside, 0u);
    EXPECT_GT(with_fault<double>(fault, Clip::far_away).outside, 0u);
  }
  EXPECT_EQ(with_fault<float>(Fault::none, Clip::far_away).outside, 0u);
}

}  // namespace
}  // namespace kbvh::test::kinetic_dop_test
