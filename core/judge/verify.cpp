#include "core/judge/verify.hpp"

#include <algorithm>

#include "core/judge/sort_pairs.hpp"

namespace kbvh {

std::string text(const PrimitivePair& pair) {
  return "(" + std::to_string(pair.body_a) + ":" + std::to_string(pair.primitive_a) + ", " +
         std::to_string(pair.body_b) + ":" + std::to_string(pair.primitive_b) + ")";
}

namespace {

template <class S>
bool well_formed(const Scene<S>& scene, const PrimitivePair& pair) {
  const std::uint32_t bodies = std::uint32_t(scene.bodies.size());
  if (pair.body_a >= bodies || pair.body_b >= bodies || pair.body_a > pair.body_b) return false;
  if (pair.body_a == pair.body_b && pair.primitive_a >= pair.primitive_b) return false;
  const auto known = [&](std::uint32_t body, std::uint32_t primitive) {
    const Primitives& primitives = scene.bodies[body].primitives;
    return primitive < primitives.count() && primitives.alive(primitive);
  };
  return known(pair.body_a, pair.primitive_a) && known(pair.body_b, pair.primitive_b);
}

/// Sorts, counts and removes duplicates.
std::uint64_t sort_unique(PairBuffer& pairs) {
  sort_pairs(pairs);
  const auto end = std::unique(pairs.begin(), pairs.end());
  const auto repeated = std::uint64_t(pairs.end() - end);
  pairs.erase(end, pairs.end());
  return repeated;
}

PairBuffer difference(const PairBuffer& from, const PairBuffer& without) {
  PairBuffer result;
  std::set_difference(from.begin(), from.end(), without.begin(), without.end(), std::back_inserter(result));
  return result;
}

template <class S>
class FrameChecker {
 public:
  FrameChecker(Session<S>& session, Verification& result, Areas areas)
      : session_(session), result_(result), areas_(areas), sound_(session.scene().bodies.size()) {}

  /// Takes the answers by value: sorting must not disturb the warm buffers of strategies. `frame` counts all
  /// frames, from 0.
  void check_pairs(std::uint64_t frame, PairBuffer candidates, PairBuffer confirmed,
                   const PairBuffer& truth) {
    const Info& info = session_.info();
    ++result_.frames;
    result_.pairs += truth.size();
    result_.candidates += candidates.size();
    for (const PrimitivePair& pair : candidates)
      if (!well_formed(session_.scene(), pair)) {
        ++result_.malformed;
        violate("malformed pair " + text(pair));
      }
    const std::uint64_t repeated = sort_unique(candidates);
    const std::uint64_t repeated_confirmed = sort_unique(confirmed);
    result_.repeated += std::max(repeated, repeated_confirmed);
    if (repeated || repeated_confirmed) violate("a pair was reported more than once");
    const PairBuffer lost = difference(truth, candidates), missed = difference(truth, confirmed),
                     extra = difference(confirmed, truth);
    result_.missed_candidates += lost.size();
    result_.missed += missed.size();
    result_.extra += extra.size();
    if (!missed.empty() || !extra.empty()) ++result_.wrong_frames;
    if (!missed.empty() && !result_.first_missed) result_.first_missed = frame;
    for (const PrimitivePair& pair : missed) {
      const Penetration found = penetration(session_.scene(), session_.playback(), pair);
      result_.missed_depth_sum += found.depth;
      result_.missed_deepest = {std::max(result_.missed_deepest.depth, found.depth),
                                std::max(result_.missed_deepest.in_edges, found.in_edges)};
    }
    if (info.guarantee == Guarantee::approximate) return;
    if (!lost.empty()) violate("pair " + text(lost[0]) + " is not among the candidates");
    if (!missed.empty()) violate("pair " + text(missed[0]) + " is missed");
    if (!extra.empty()) violate("pair " + text(extra[0]) + " is reported but does not intersect");
  }

  /// `judged`: whether to record the quality of this frame's boxes, too.
  void check_bounds(bool judged) {
    const Info& info = session_.info();
    Quality quality{.t = session_.playback().time()};
    Audit frame;
    for (std::uint32_t body = 0; body < session_.scene().bodies.size(); ++body) {
      auto view = session_.strategy().audit_view(body);
      if (!view) continue;
      result_.audited = true;
      const Audit found = audit(*view, session_.scene().bodies[body].primitives,
                                session_.playback().positions(body), &sound_[body], areas_);
      frame.add(found);
      if (judged && found.topology_error.empty()) judge(body, *view, quality);
      if (found.topology_error.empty()) sound_[body] = std::move(view->topology);
      result_.audit.add(found);
      const std::string where = "body " + std::to_string(body) + ": ";
      if (!found.topology_error.empty()) violate(where + found.topology_error);
      if (info.guarantee != Guarantee::approximate && found.invalid) violate(where + found.first_fault);
      if (info.tightness == Tightness::tight && found.not_tight)
        violate(where + std::to_string(found.not_tight) + " bounds are not tight");
    }
    quality.looseness = frame.looseness();
    if (quality.sah_rebuilt > 0) result_.over_time.push_back(quality);
  }

  /// Topologies that passed the check may have changed.
  void geometry_changed() { std::fill(sound_.begin(), sound_.end(), Topology{}); }

 private:
  void judge(std::uint32_t body, const AuditView& view, Quality& quality) const {
    const Primitives& primitives = session_.scene().bodies[body].primitives;
    const S* positions = session_.playback().positions(body);
    const std::vector<Box<double>> tight = tight_boxes(view.topology, primitives, positions);
    std::vector<double> areas(tight.size());
    for (std::uint32_t node = 0; node < tight.size(); ++node) {
      const bool read = view.stale.empty() || !view.stale[node];
      areas[node] = !read          ? surface_area(tight[node])
                    : view.volumes ? view.volumes->surface(node)
                                   : surface_area(view.boxes[node]);
    }
    quality.sah += sah_cost(view.topology, areas);
    const Topology rebuilt = build_topology(
        primitives, positions,
        {.method = BuildMethod::sah, .width = view.topology.width, .leaf_size = view.topology.leaf_size});
    quality.sah_rebuilt += sah_cost(rebuilt, tight_boxes(rebuilt, primitives, positions));
  }
  void violate(const std::string& what) {
    if (result_.first_violation.empty())
      result_.first_violation = "t = " + number_text(session_.playback().time()) + ": " + what;
  }
  Session<S>& session_;
  Verification& result_;
  Areas areas_;
  std::vector<Topology> sound_;  ///< the last topology of each body that passed the check: most never change
};

}  // namespace

template <class S>
Verification verify(Session<S>& session, std::span<const double> frames, Oracle<S>& oracle,
                    const PlanScript<S>* script, const VerifyOptions& options) {
  Verification result;
  FrameChecker<S> checker(session, result, options.areas);
  PairBuffer pairs;
  PhaseTimes ignored;
  ScriptCursor<S> cursor(script);
  // The oracle knows the truth for one script.
  const bool known_truth = oracle.script() == (script ? hash(*script) : 0);
  std::uint32_t geometry_changes = 0;
  // Takes every n-th compared frame, so that there are no more samples than requested.
  const std::uint64_t compared_frames =
      (frames.size() + options.every_nth_frame - 1) / options.every_nth_frame + 1;
  const std::uint64_t judged_every =
      options.quality_samples > 0 ? (compared_frames + options.quality_samples - 1) / options.quality_samples
                                  : 0;
  std::uint64_t compared_before = 0;
  const auto query = [&](std::size_t frame, bool compared) {
    const double t = session.playback().time();
    pairs.clear();
    session.strategy().candidates_at(t, pairs, Budget{});
    if (!compared) return;
    const PairBuffer candidates = pairs;
    session.strategy().confirm(t, pairs);
    // Positions may be completed for the oracle and the audit only after the answer.
    session.playback().evaluate_all();
    checker.check_pairs(frame, candidates, pairs,
                        known_truth ? oracle.pairs(session.playback(), session.scene(), geometry_changes)
                                    : sweep_pairs(session.scene(), session.playback()));
    checker.check_bounds(judged_every > 0 && compared_before++ % judged_every == 0);
  };
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (f == 0)
      session.reset(frames[0]);
    else
      session.advance(frames[f], ignored);
    const bool compared = f % options.every_nth_frame == 0 || f + 1 == frames.size();
    query(f, compared);
    const auto* step = cursor.at(frames[f]);
    if (step == nullptr) continue;
    if (!step->changes.empty()) session.change_plans(step->changes, ignored);
    if (step->geometry.empty()) continue;
    session.change_geometry(step->geometry, ignored);
    checker.geometry_changed();
    ++geometry_changes;
    query(f, compared);  // bounds must be valid immediately after a change
  }
  return result;
}

template Verification verify(Session<float>&, std::span<const double>, Oracle<float>&,
                             const PlanScript<float>*, const VerifyOptions&);
template Verification verify(Session<double>&, std::span<const double>, Oracle<double>&,
                             const PlanScript<double>*, const VerifyOptions&);

}  // namespace kbvh
