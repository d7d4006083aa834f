#pragma once
#include <string>
#include <vector>

#include "experiments/theory/claim.hpp"
#include "experiments/theory/measurements.hpp"

/// Verdicts: pure functions of the measurements. Each returns "not decided here" for empty input.
namespace kbvh::theory {

Claim judge_valid_at_all_times(const std::vector<ExactRun>& exact);                              // T1
Claim judge_compact(const std::vector<CountRun>& counts);                                        // T2
Claim judge_responsive(const std::vector<CountRun>& counts);                                     // T3
Claim judge_local(const std::vector<CountRun>& counts, const std::vector<CountRun>& fans);       // T4
Claim judge_efficient(const std::vector<CountRun>& counts, const std::vector<ExactRun>& exact);  // T5
Claim judge_number_of_events(const std::vector<CountRun>& counts, const std::vector<ExactRun>& exact,
                             const std::vector<GrowthFit>& fits,
                             const std::vector<CurveRun>& curves = {});                       // T6
Claim judge_independent_of_frames(const std::vector<FrameRun>& frames);                       // T7
Claim judge_optimal(const std::vector<ExactRun>& exact, const std::vector<LooseRun>& loose);  // T8
/// `constructed` are the frames of scenes that were constructed to refute the claim, `frames` those of the
/// others.
Claim judge_never_more_updates(const std::vector<FrameRun>& frames,
                               const std::vector<FrameRun>& constructed);  // T9
Claim judge_translation(const std::vector<TranslationRun>& translations);  // T10
Claim judge_boxtree_size(const std::vector<BoxTreeRun>& boxtrees);         // T11
Claim judge_boxtree_qualities(const std::vector<BoxTreeRun>& boxtrees,
                              const std::vector<SearchRun>& searches);       // T12
Claim judge_separation_list(const std::vector<SeparationRun>& separations);  // T13
Claim judge_list_size(const std::vector<ListSizeRun>& sizes);                // T14
Claim judge_plan_changes(const std::vector<PlanRun>& plans);                 // T15
Claim judge_lower_bound(const std::vector<LooseRun>& loose);                 // T16

// What the paper proposes in its last section.
Claim judge_order(const std::vector<OrderRun>& orders);        // C1
Claim judge_rebuild(const std::vector<RebuildRun>& rebuilds);  // C2
Claim judge_sweeps(const std::vector<SweepRun>& sweeps);       // C3
Claim judge_motion(const std::vector<MotionRun>& motions);     // C4

/// Short names for criteria.
inline constexpr Role always = Role::always, as_stated = Role::as_stated;

/// Names the scene of a run and its size.
template <class Run>
std::string place(const Run& run) {
  return run.scene + ", " + number(run.triangles) + " polygons";
}

/// Makes a claim that cannot be decided here, with the reason.
Claim undecided(Claim claim, const std::string& why);

/// Fits the growth of each scene with at least `fewest` sizes, all with events.
std::vector<GrowthFit> fit_growth(const std::vector<CountRun>& counts, std::size_t fewest);

/// Returns the comparisons that one event may cost the AVL queue: on each node of its path one insertion,
/// which compares once per level and once more, in a tree of at most 1.4405 log2(entries + 2) levels (Knuth,
/// 6.2.3).
double queue_steps_bound(const CountRun& run);

}  // namespace kbvh::theory
