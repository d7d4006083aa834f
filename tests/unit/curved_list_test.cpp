// Separation lists over curves: at frames, between frames and next to events the list contains every two
// leaves whose boxes overlap in rational arithmetic; chains contain the curves; faults seeded into events and
// chains are found.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/families/events/any_queue.hpp"
#include "core/families/separation/kinetic_collision.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/rational_curves.hpp"
#include "tests/support/seeded_clock.hpp"

namespace kbvh::test::curved_list_test {
namespace {

using seeded_clock::Fault;
using seeded_clock::Seeded;

/// The ranks of all coordinates at one time among those of all bodies on the same axis.
struct Ranks {
  std::vector<std::uint32_t> rank[3];  ///< [axis][vertex of all bodies]
  std::vector<std::size_t> first_of;   ///< [body]: its first vertex
};
/// By time. Plays of one scene share them: queues and leaf sizes change nothing about positions.
using KnownRanks = std::map<double, Ranks>;

struct RankBox {
  std::uint32_t lower[3], upper[3];
};

bool overlap(const RankBox& a, const RankBox& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (a.lower[axis] > b.upper[axis] || b.lower[axis] > a.upper[axis]) return false;
  return true;
}

struct Findings {
  std::uint64_t events = 0, overlapping = 0, listed = 0, all = 0;
  std::uint64_t missing = 0;  ///< overlapping leaves that are not in the list
};

template <class S, Fault fault = Fault::none>
class Play {
  using Collision = KineticCollision<S, AnyEventQueue, typename Seeded<fault>::template Clock<S>>;

 public:
  Play(const Scene<S>& scene, KnownRanks& known, std::uint32_t leaf_size, const std::string& queue,
       int look_ahead)
      : scene_(&scene),
        known_(&known),
        view_(scene),
        playback_(scene),
        collision_(view_, ClipMotion<S>(playback_),
                   build_topologies(view_, playback_,
                                    {.method = BuildMethod::median, .width = 2, .leaf_size = leaf_size}),
                   count_, look_ahead, queue) {}

  Findings run(int between, std::uint64_t seed, std::uint64_t most_events = 2000000) {
    const std::vector<double> times = frames_and_between(*scene_, between, seed);
    playback_.seek(times[0]);
    collision_.reset(times[0]);
    for (const double t : times) {
      for (; collision_.due(t) && found_.events < most_events; ++found_.events) {
        if (fault == Fault::none && found_.events % 16 == 15) audit_before_next(t);
        handled_until_ = std::max(handled_until_, collision_.after_next());
        collision_.handle_next();
      }
      audit(t);
    }
    return found_;
  }

 private:
  /// Audits right before the next event of a tree, if no event before it is as near.
  void audit_before_next(double t) {
    if (!collision_.tree_is_first() || collision_.forest().queue().empty()) return;
    const Event next = collision_.forest().queue().top();
    const double before = std::nextafter(next.hint - next.error, -1e300);
    if (before >= handled_until_ && before >= last_audit_ && before <= t) audit(before);
  }
  const Ranks& ranks_at(double t) {
    const auto [found, is_new] = known_->try_emplace(t);
    Ranks& made = found->second;
    if (!is_new) return made;
    std::vector<Rational> all[3];
    for (std::uint32_t body = 0; body < view_.body_count(); ++body) {
      made.first_of.push_back(all[0].size());
      const std::vector<Rational> values = rational_values(playback_.plans(body), t);
      for (std::size_t i = 0; i < values.size(); ++i) all[i % 3].push_back(values[i]);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) made.rank[axis] = ranks(all[axis]);
    return made;
  }
  void audit(double t) {
    last_audit_ = t;
    const Ranks& now = ranks_at(t);
    std::vector<std::vector<std::pair<std::uint32_t, RankBox>>> leaves;
    for (std::uint32_t body = 0; body < view_.body_count(); ++body) {
      const auto& tree = collision_.forest().tree(body);
      leaves.emplace_back();
      for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
        const auto vertices = tree.leaf_vertices(node);
        if (vertices.empty()) continue;
        RankBox box;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::uint32_t* const own = now.rank[axis].data() + now.first_of[body];
          box.lower[axis] = box.upper[axis] = own[vertices[0]];
          for (const std::uint32_t v : vertices) {
            box.lower[axis] = std::min(box.lower[axis], own[v]);
            box.upper[axis] = std::max(box.upper[axis], own[v]);
          }
        }
        leaves.back().emplace_back(node, box);
      }
    }
    const auto& list = collision_.list();
    std::set<std::vector<std::uint32_t>> listed;
    for (std::uint32_t i = 0; i < list.body_pair_count(); ++i) {
      if (!list.is_entered(i)) continue;
      const BodyPair& pair = list.body_pair(i);
      for (const auto& leaf : list.leaf_pairs(i)) {
        listed.insert({pair.first, leaf.a, pair.second, leaf.b});
        ++found_.listed;
        if (pair.first == pair.second) listed.insert({pair.first, leaf.b, pair.second, leaf.a});
      }
    }
    for (const BodyPair& pair : view_.pairs())
      for (const auto& [a, box_a] : leaves[pair.first])
        for (const auto& [b, box_b] : leaves[pair.second]) {
          if (pair.first == pair.second && a >= b) continue;
          ++found_.all;
          if (!overlap(box_a, box_b)) continue;
          ++found_.overlapping;
          found_.missing += listed.count({pair.first, a, pair.second, b}) == 0 ? 1 : 0;
        }
  }

  const Scene<S>* scene_;
  KnownRanks* known_;
  SceneView<S> view_;
  Playback<S> playback_;
  Counters count_;
  Collision collision_;
  double handled_until_ = -1e300, last_audit_ = -1e300;
  Findings found_;
};

template <class S>
void check_scenes() {
  std::uint64_t events = 0, overlapping = 0, listed = 0, all = 0;
  for (const std::string& name : curved_scene_names()) {
    const Scene<S> scene = curved_scene<S>(name).scene;
    KnownRanks known;
    for (const std::string& queue : AnyEventQueue<AlgebraicClock<S>>::names())
      for (const std::uint32_t leaf_size : {1u, 4u}) {
        const int look_ahead = leaf_size == 1 ? 1 : OverlapClock<S>::usual_look_ahead;
        const Findings found = Play<S>(scene, known, leaf_size, queue, look_ahead).run(4, 11);
        EXPECT_EQ(found.missing, 0u) << name << ", " << queue << ", leaf size " << leaf_size;
        events += found.events;
        overlapping += found.overlapping;
        listed += found.listed;
        all += found.all;
      }
  }
  EXPECT_GT(events, 500u);
  EXPECT_GT(overlapping, 100u);
  EXPECT_GE(listed, overlapping);
  EXPECT_LT(listed, all) << "the list has every two leaves";
}

TEST(CurvedList, ContainsEveryTwoLeavesWhoseBoxesOverlapInFloat) {
  check_scenes<float>();
}
TEST(CurvedList, ContainsEveryTwoLeavesWhoseBoxesOverlapInDouble) {
  check_scenes<double>();
}

TEST(CurvedList, LostEventsOfTreesAreFound) {
  std::uint64_t missing = 0;
  for (const std::string name : {"curved_soups", "curved_thrown", "curved_mixed"}) {
    const Scene<float> scene = curved_scene<float>(name).scene;
    KnownRanks known;
    const Findings sound = Play<float>(scene, known, 1, "binary_heap", 32).run(0, 5);
    missing += Play<float, Fault::lost_event>(scene, known, 1, "binary_heap", 32)
                   .run(20, 5, 2 * sound.events)
                   .missing;
  }
  EXPECT_GT(missing, 0u);
}

/// Counts coordinates on curves that lie outside of a pair of chains at one of a few times.
template <class S>
std::uint64_t outside(const FlightPlans<S>& plans, const S* lower, const S* upper) {
  const auto times = plans.keyframe_times();
  const std::size_t scalars = std::size_t(3) * plans.vertex_count();
  std::uint64_t found = 0;
  for (std::size_t k = 0; k + 1 < times.size(); ++k)
    for (std::uint32_t v = 0; v < plans.vertex_count(); ++v)
      for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i <= 16; ++i) {
          const Rational s(i, 16);
          const CurvedPiece<S> piece = plans.curved_piece(v, axis, k);
          const Rational x =
              value(rational_difference(piece, CurvedPiece<S>{piece.t0, piece.t1, 0, 0, 0, 0}), s);
          const std::size_t at = k * scalars + 3 * v + std::size_t(axis);
          const auto chain = [&](const S* values) {
            const Rational begin(double(values[at])), end(double(values[at + scalars]));
            return Rational(begin + (end - begin) * s);
          };
          found += x < chain(lower) || x > chain(upper) ? 1 : 0;
        }
  return found;
}

template <class S>
void check_chains() {
  std::uint64_t outside_of_chords = 0;
  for (const std::string& name : curved_scene_names()) {
    const Scene<S> scene = curved_scene<S>(name).scene;
    std::vector<const FlightPlans<S>*> plans;
    for (const Body<S>& body : scene.bodies) plans.push_back(&body.plans);
    CurveHulls<S> hulls(plans);
    hulls.start();
    for (std::uint32_t body = 0; body < plans.size(); ++body) {
      EXPECT_EQ(hulls.lower(body) != nullptr, plans[body]->curved() && plans[body]->vertex_count() > 0);
      if (hulls.lower(body) == nullptr) continue;
      EXPECT_EQ(outside(*plans[body], hulls.lower(body), hulls.upper(body)), 0u) << name;
      outside_of_chords += outside(*plans[body], plans[body]->keyframe(0), plans[body]->keyframe(0));
    }
  }
  EXPECT_GT(outside_of_chords, 100u);
}

TEST(CurvedList, ChainsContainTheCurves) {
  check_chains<float>();
  check_chains<double>();
}

}  // namespace
}  // namespace kbvh::test::curved_list_test
