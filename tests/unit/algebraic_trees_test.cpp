// Kinetic BoxTrees and k-DOP trees over curves: at frames and between them every realiser is extremal in
// rational arithmetic on the (projected) plans, all queues handle the same number of events, and k-DOPs
// contain every vertex at its rounded position. Faults seeded into clocks, trees and margins are found.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/realiser_dops.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/rational_curves.hpp"
#include "tests/support/seeded_clock.hpp"
#include "tests/support/vertices_below.hpp"

namespace kbvh::test::algebraic_trees_test {
namespace {

using seeded_clock::Fault;
using seeded_clock::Seeded;

template <class S, template <class, class, class> class Tree, Fault fault = Fault::none>
using ForestOf = KineticForest<S, AnyEventQueue<typename Seeded<fault>::template Clock<S>>, NoObserver, Tree>;

/// Leaves the certificate above the changed realisers alone, which keeps the candidate that was replaced.
template <class S, class Queue, class Observer>
class ForgetsTheExchange : public KineticBoxTree<S, Queue, Observer> {
  using Base = KineticBoxTree<S, Queue, Observer>;

 public:
  using Base::Base;
  void handle(const Event& event) {
    typename Base::Now::Exact crossing;
    const typename Base::Now now = this->certifier_.instant_of(event, false, crossing);
    std::uint32_t at = this->slots_.place(event.slot);
    for (;;) {
      this->replace(at, event.side, event.loser, now);
      this->certify(at, event.side, now);
      if (at < 6) return;
      at = this->above(at, event.side);
      if (this->bounds_[at].realiser != event.winner) return;
    }
  }
};

template <class Tree>
std::uint32_t realiser_of(const Tree& tree, std::uint32_t node, Side side) {
  if constexpr (requires { tree.realiser_or_none(node, side); })
    return tree.realiser_or_none(node, side);
  else
    return tree.realiser(node, side);
}

template <class S, class Forest, int K>
class Play {
  using Clock = typename Forest::Clock;

 public:
  Play(const Scene<S>& scene, std::uint32_t width, std::uint32_t leaf_size, const std::string& queue)
      : scene_(&scene),
        view_(scene),
        playback_(scene),
        forest_(view_, ClipMotion<S>(playback_),
                build_topologies(view_, playback_,
                                 {.method = BuildMethod::median, .width = width, .leaf_size = leaf_size}),
                count_) {
    forest_.choose_queue(queue);
    for (std::uint32_t body = 0; body < forest_.size(); ++body)
      below_.push_back(vertices_below(forest_.tree(body)));
  }

  Forest& forest() { return forest_; }

  /// Plays the scene and checks at its frames and at `between` random times. Stops after so many events as a
  /// sound play has: faulty trees may not come to an end.
  void run(int between, std::uint64_t seed, std::uint64_t most_events = 2000000) {
    const std::vector<double> times = frames_and_between(*scene_, between, seed);
    playback_.seek(times[0]);
    forest_.reset(times[0]);
    for (const double t : times) {
      for (; forest_.due(t) && events_ < most_events; ++events_) forest_.handle_next();
      check_realisers(t);
      if constexpr (K > 6) check_volumes(t);
    }
  }
  std::uint64_t events() const { return events_; }
  std::uint64_t sides() const { return sides_; }
  std::uint64_t not_extremal() const { return not_extremal_; }
  /// Returns how often a slab of a node's k-DOP leaves a vertex out, with this share of the margin: 0,
  /// 1/20, 1.
  std::uint64_t outside(std::size_t margin) const { return outside_[margin]; }

 private:
  static constexpr double margin_shares[] = {0, 0.05, 1};

  /// Returns the vertex's projected plan at t, from the definition.
  Rational value(const FlightPlans<S>& plans, std::uint32_t v, std::size_t direction, double t) const {
    const auto along = [&](const S* x) {
      return direction < 3 ? x[direction] : projected(direction_at(direction), x);
    };
    const auto times = plans.keyframe_times();
    const std::size_t k = plans.segment_at(t);
    const S* const here = plans.keyframe(k) + std::size_t(3) * v;
    if (t <= times[k] || k + 1 == times.size()) return Rational(double(along(here)));
    S bend[3], twist[3];
    for (int axis = 0; axis < 3; ++axis) {
      const CurvedPiece<S> piece = plans.curved_piece(v, axis, k);
      bend[axis] = piece.bend;
      twist[axis] = piece.twist;
    }
    const S* const next = plans.keyframe(k + 1) + std::size_t(3) * v;
    return rational_value(
        CurvedPiece<S>{times[k], times[k + 1], along(here), along(next), along(bend), along(twist)},
        Rational(t));
  }
  static const SlabDirection& direction_at(std::size_t i) { return Dop<S, K>::directions[i]; }

  void check_realisers(double t) {
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      const FlightPlans<S>& plans = playback_.plans(body);
      const auto& tree = forest_.tree(body);
      for (std::size_t direction = 0; direction < K / 2; ++direction) {
        std::vector<Rational> values;
        for (std::uint32_t v = 0; v < plans.vertex_count(); ++v)
          values.push_back(value(plans, v, direction, t));
        const std::vector<std::uint32_t> rank = ranks(values);
        for (const Side side : {Side(2 * direction), Side(2 * direction + 1)})
          for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
            const std::uint32_t realiser = realiser_of(tree, node, side);
            if (realiser == no_vertex) continue;
            ++sides_;
            const std::vector<std::uint32_t>& below = below_[body][node];
            EXPECT_NE(std::find(below.begin(), below.end(), realiser), below.end());
            not_extremal_ += std::any_of(below.begin(), below.end(), [&](std::uint32_t v) {
              return is_upper(side) ? rank[v] > rank[realiser] : rank[v] < rank[realiser];
            });
          }
      }
    }
  }

  void check_volumes(double t) {
    playback_.seek(t);
    playback_.evaluate_all();
    for (std::uint32_t body = 0; body < forest_.size(); ++body) {
      const auto& tree = forest_.tree(body);
      ProjectionMargin<S> margin;
      margin.start_over(playback_.plans(body));
      RealiserDops<S, K, Clock> read(forest_.clock(), body, tree.topology().size());
      read.start_over();
      read.new_frame(t, tree.realisers(0));
      // [direction][vertex]: along each direction, exactly.
      std::vector<std::vector<Rational>> along(K / 2);
      std::vector<std::vector<std::uint32_t>> rank;
      for (std::size_t i = 0; i < K / 2; ++i) {
        for (std::uint32_t v = 0; v < playback_.plans(body).vertex_count(); ++v)
          along[i].push_back(dot(direction_at(i), playback_.position(body, v)));
        rank.push_back(ranks(along[i]));
      }
      const auto contains = [&](const Dop<S, K>& dop, std::uint32_t node, std::size_t i) {
        const std::vector<std::uint32_t>& below = below_[body][node];
        const auto [low, high] =
            std::minmax_element(below.begin(), below.end(),
                                [&](std::uint32_t v, std::uint32_t w) { return rank[i][v] < rank[i][w]; });
        return Rational(double(dop.lower[i])) <= along[i][*low] &&
               along[i][*high] <= Rational(double(dop.upper[i]));
      };
      for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
        for (std::size_t share = 0; share < 3; ++share) {
          const Dop<S, K> dop = dop_of_realisers<S, K>(tree.realisers(node), forest_.clock(), body, t,
                                                       margin_shares[share] * margin.at(t));
          if (share == 2) {
            read.ensure(node);
            EXPECT_EQ(read(node), dop);
          }
          for (std::size_t i = 0; i < dop.slabs; ++i) outside_[share] += contains(dop, node, i) ? 0 : 1;
        }
        Box<S> box;
        for (const std::uint32_t v : below_[body][node]) box.extend(playback_.position(body, v));
        const Dop<S, K>& dop = read(node);
        for (std::size_t axis = 0; axis < 3 && not_extremal_ == 0; ++axis) {
          EXPECT_EQ(dop.lower[axis], box.lower[axis]) << "a side along an axis is not tight";
          EXPECT_EQ(dop.upper[axis], box.upper[axis]) << "a side along an axis is not tight";
        }
      }
    }
  }
  static Rational dot(const SlabDirection& n, const S* p) {
    Rational sum = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) sum += Rational(double(p[axis])) * int(n[axis]);
    return sum;
  }

  const Scene<S>* scene_;
  SceneView<S> view_;
  Playback<S> playback_;
  Counters count_;
  Forest forest_;
  std::vector<std::vector<std::vector<std::uint32_t>>> below_;  ///< [body][node]
  std::uint64_t events_ = 0, sides_ = 0, not_extremal_ = 0, outside_[3] = {0, 0, 0};
};

// ---- BoxTrees

template <class S, Fault fault = Fault::none, template <class, class, class> class Tree = KineticBoxTree>
class BoxTreePlay : public Play<S, ForestOf<S, Tree, fault>, 6> {
 public:
  BoxTreePlay(const Scene<S>& scene, const BoxTreeConstruction& construction, std::uint32_t leaf_size,
              const std::string& queue)
      : Play<S, ForestOf<S, Tree, fault>, 6>(scene, 2, leaf_size, queue) {
    for (std::uint32_t body = 0; body < this->forest().size(); ++body)
      this->forest().tree(body).construct_as(construction);
  }
};

/// As in the paper, and as for queries of wide nodes.
std::vector<BoxTreeConstruction> constructions() {
  BoxTreeConstruction best;
  best.planes = PlaneChoice::clip;
  best.candidates = Candidates::listed;
  best.bare_leaves = 4;
  return {BoxTreeConstruction{}, best};
}

template <class S>
void check_boxtrees(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  std::uint64_t most_events = 0;
  for (const BoxTreeConstruction& construction : constructions())
    for (const std::uint32_t leaf_size : {1u, 4u}) {
      std::uint64_t events = 0;
      for (const std::string& queue : AnyEventQueue<AlgebraicClock<S>>::names()) {
        BoxTreePlay<S> play(scene, construction, leaf_size, queue);
        play.run(queue == "avl" ? 6 : 0, 5);
        EXPECT_EQ(play.not_extremal(), 0u) << name << ", " << queue;
        EXPECT_GT(play.sides(), 0u);
        if (queue == AnyEventQueue<AlgebraicClock<S>>::names()[0])
          events = play.events();
        else
          EXPECT_EQ(events, play.events()) << name << ", " << queue;
      }
      most_events = std::max(most_events, events);
    }
  EXPECT_GT(most_events, 0u) << name;
}

TEST(AlgebraicBoxTree, SidesAreExtremalAtAndBetweenFramesInFloat) {
  for (const std::string& name : curved_scene_names()) check_boxtrees<float>(name);
}
TEST(AlgebraicBoxTree, SidesAreExtremalAtAndBetweenFramesInDouble) {
  for (const std::string& name : curved_scene_names()) check_boxtrees<double>(name);
}

template <Fault fault, template <class, class, class> class Tree = KineticBoxTree>
std::uint64_t faults_in_boxtrees() {
  std::uint64_t found = 0;
  for (const std::string name : {"curved_soups", "curved_ties", "curved_mirror"}) {
    const Scene<float> scene = curved_scene<float>(name).scene;
    for (const BoxTreeConstruction& construction : constructions()) {
      BoxTreePlay<float> sound(scene, construction, 1, "binary_heap");
      sound.run(0, 5);
      EXPECT_EQ(sound.not_extremal(), 0u);
      BoxTreePlay<float, fault, Tree> play(scene, construction, 1, "binary_heap");
      play.run(2, 5, 2 * sound.events());
      found += play.not_extremal();
    }
  }
  return found;
}

TEST(AlgebraicBoxTree, SeededFaultsAreFound) {
  EXPECT_GT(faults_in_boxtrees<Fault::lost_event>(), 0u);
  EXPECT_GT(faults_in_boxtrees<Fault::later_roots>(), 0u);
  EXPECT_GT(faults_in_boxtrees<Fault::end_points>(), 0u);
  EXPECT_GT((faults_in_boxtrees<Fault::none, ForgetsTheExchange>()), 0u);
}

// ---- k-DOPs

template <class S, int K, Fault fault = Fault::none>
using DopPlay = Play<S, ForestOf<S, KineticDop<K>::template Tree, fault>, K>;

template <class S, int K>
void check_dops(std::uint32_t width, std::uint32_t leaf_size) {
  std::uint64_t events = 0, outside[3] = {0, 0, 0};
  for (const std::string& name : curved_scene_names()) {
    const Scene<S> scene = curved_scene<S>(name).scene;
    DopPlay<S, K> play(scene, width, leaf_size, "");
    play.run(3, 7);
    EXPECT_EQ(play.not_extremal(), 0u) << name << ", " << K << " sides";
    EXPECT_EQ(play.outside(2), 0u) << name << ", " << K << " sides";
    events += play.events();
    for (std::size_t share = 0; share < 3; ++share) outside[share] += play.outside(share);
  }
  EXPECT_GT(events, 100u);
  EXPECT_GT(outside[0], 0u) << "no vertex needs the margin";
  EXPECT_GT(outside[1], 0u) << "no vertex needs more than a twentieth of the margin";
}

TEST(AlgebraicDop, RealisersAreExtremalAndVolumesContainEveryVertexInFloat) {
  check_dops<float, 14>(2, 1);
  check_dops<float, 18>(8, 4);
  check_dops<float, 26>(2, 2);
}
TEST(AlgebraicDop, RealisersAreExtremalAndVolumesContainEveryVertexInDouble) {
  check_dops<double, 18>(2, 1);
  check_dops<double, 26>(8, 4);
}

template <Fault fault>
std::uint64_t faults_in_dops() {
  std::uint64_t found = 0;
  for (const std::string name : {"curved_soups", "curved_mirror"}) {
    const Scene<float> scene = curved_scene<float>(name).scene;
    DopPlay<float, 18> sound(scene, 2, 1, "");
    sound.run(0, 5);
    DopPlay<float, 18, fault> play(scene, 2, 1, "");
    play.run(2, 5, 2 * sound.events());
    found += play.not_extremal();
  }
  return found;
}

TEST(AlgebraicDop, SeededFaultsAreFound) {
  EXPECT_GT(faults_in_dops<Fault::lost_event>(), 0u);
  EXPECT_GT(faults_in_dops<Fault::later_roots>(), 0u);
}

}  // namespace
}  // namespace kbvh::test::algebraic_trees_test
