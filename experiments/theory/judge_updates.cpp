// T6 to T10, T15, T16: the number of updates, and its lower bounds.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "experiments/common/text.hpp"
#include "experiments/theory/fit.hpp"
#include "experiments/theory/judge.hpp"

namespace kbvh::theory {

using experiments::counted;
using experiments::joined;

namespace {
std::string place(const FrameRun& run) {
  return run.scene + ", " + counted(run.triangles, "polygon") + ", l = " + std::to_string(run.l);
}
std::string percent(double share) {
  return fmt::format("{:.3g}%", 100 * share);
}
/// Says how many changes the curves have that were built to have many: the largest run of each scene.
std::string reached_bounds(const std::vector<CurveRun>& curves) {
  std::map<std::string, const CurveRun*> largest;
  for (const CurveRun& run : curves) {
    if (run.built == 0) continue;
    const CurveRun*& kept = largest[run.scene];
    if (kept == nullptr || run.vertices > kept->vertices) kept = &run;
  }
  std::string all;
  for (const auto& [scene, run] : largest) {
    all += fmt::format("; a bound of {} {} has {} changes", number(run->vertices), scene,
                       number(run->most_changes));
    // lambda_2(n) is known, lambda_3(n) is not.
    if (run->order == 2)
      all += fmt::format(", {} of lambda_2(n) - 1", percent(run->fullest));
    else
      all += fmt::format(" ({} are the most for parabolas)", number(2 * run->vertices - 2));
  }
  return all;
}
}  // namespace

std::vector<GrowthFit> fit_growth(const std::vector<CountRun>& counts, std::size_t fewest) {
  std::map<std::string, std::vector<const CountRun*>> families;
  for (const CountRun& run : counts) families[run.scene].push_back(&run);
  std::vector<GrowthFit> fits;
  for (auto& [scene, runs] : families) {
    std::sort(runs.begin(), runs.end(), [](auto a, auto b) { return a->vertices < b->vertices; });
    GrowthFit fit;
    fit.scene = scene;
    std::vector<double> x, y;
    bool all_with_events = true;
    for (const CountRun* run : runs) {
      // Shapes have a smallest size: requests below it make the same scene, which is one point.
      if (!fit.vertices.empty() && fit.vertices.back() == run->vertices) continue;
      all_with_events = all_with_events && run->events > 0;
      if (!all_with_events) break;
      fit.triangles.push_back(run->triangles);
      fit.vertices.push_back(run->vertices);
      fit.events.push_back(run->events);
      x.push_back(n_log_n(double(run->vertices)));
      y.push_back(double(run->events));
    }
    if (x.size() < std::max<std::size_t>(fewest, 3) || !all_with_events) continue;
    const PowerFit power = fit_power(x, y);
    const ProportionalFit line = fit_proportional(x, y);
    fit.exponent = power.exponent, fit.low = power.low, fit.high = power.high;
    fit.constant = line.constant, fit.worst = line.worst, fit.residuals = line.residuals;
    fits.push_back(std::move(fit));
  }
  return fits;
}

Claim judge_number_of_events(const std::vector<CountRun>& counts, const std::vector<ExactRun>& exact,
                             const std::vector<GrowthFit>& fits, const std::vector<CurveRun>& curves) {
  constexpr double tolerance = 0.05;
  Claim claim{.id = "T6",
              .title = "a clip has O(lambda_s(n) log n) events, nearly O(n log n)",
              .statement =
                  "If two flight plans cross at most s times, all events of a clip are O(lambda_s(n) log n), "
                  "which is nearly O(n log n).",
              .citation = "Theorems 2 to 4",
              .counter = "events and changes of a clip; breakpoints of exact envelopes",
              .bound =
                  "segments x sum over nodes and sides of (vertices below - 1); lambda_1(n) - 1 = n - 1 "
                  "breakpoints per bound and segment; curves of degree 2 and 3: lambda_2(n) - 1 = 2 n - 2, "
                  "lambda_3(n) <= n (1 + 2 H(n - 1)); parabolas built for it reach lambda_2(n) - 1, cubics "
                  "3 n - 3; exponent of n log n not above 1 + 5%",
              .condition =
                  "the bound includes the number of segments as a factor; the closeness to n log n depends "
                  "on the motion",
              .data = {{"counts", counts}, {"exact", exact}, {"fits", fits}, {"curves", curves}}};
  if (counts.empty()) return undecided(claim, "Nothing was counted.");
  double share = 0, fullest = 0;
  std::uint64_t pieces = 0, over = 0, most = 0;
  for (const CountRun& run : counts) {
    claim.expect_at_most("changes of a clip, " + place(run), run.values, run.breakpoint_bound);
    claim.expect_at_most("events of a clip, " + place(run), run.events, run.breakpoint_bound);
    share = std::max(share, double(run.values) / run.breakpoint_bound);
  }
  for (const ExactRun& run : exact) {
    claim.expect_none("envelopes with more than n - 1 breakpoints in a segment, " + place(run),
                      run.over_lambda);
    pieces += run.pieces, over += run.over_lambda;
    fullest = std::max(fullest, run.fullest), most = std::max(most, run.most_breakpoints);
  }
  for (const CurveRun& run : curves) {
    claim.expect_none(
        fmt::format("bounds with more than lambda_{}(n) - 1 changes in a segment, {}, {} segments", run.order,
                    place(run), run.segments),
        run.over_lambda);
    if (run.built > 0)
      claim.expect_equal(fmt::format("changes of a bound of {} {} that are built for this number",
                                     number(run.vertices), run.scene),
                         run.most_changes, run.built);
  }
  std::vector<std::string> exponents, faster;
  double worst = 0;
  std::size_t sizes = 0;
  for (const GrowthFit& fit : fits) {
    claim.expect_at_most("lower end of the exponent's 95% interval, " + fit.scene, fit.low, 1, as_stated,
                         tolerance);
    exponents.push_back(fmt::format("{} {:.2f} ({:.2f} to {:.2f}), {:.3g} n log n", fit.scene, fit.exponent,
                                    fit.low, fit.high, fit.constant));
    if (fit.low > 1 + tolerance) faster.push_back(fit.scene);
    worst = std::max(worst, fit.worst);
    sizes = std::max(sizes, fit.events.size());
  }
  claim.measured =
      fmt::format("at most {} of the bound; {} of {} envelopes over lambda_1; exponents: {}", percent(share),
                  number(over), number(pieces), exponents.empty() ? "none fitted" : joined(exponents, "; "));
  claim.why = fmt::format("{} used at most {} of the bound", counted(counts.size(), "clip"), percent(share));
  if (!exact.empty())
    claim.why += fmt::format(
        ", and no exact envelope of {} (bounds x segments) {} n - 1 breakpoints (the fullest has {} of them, "
        "the longest {})",
        number(pieces), over == 0 ? "has more than" : "should have more than", percent(fullest), most);
  for (const CurveRun& run : curves) {
    if (run.built > 0) continue;
    claim.why +=
        fmt::format("; on curves of degree {} ({}, {}) the fullest bound has {} of lambda_{}(n) - 1 changes",
                    run.order, run.scene, counted(run.segments, "segment"), percent(run.fullest), run.order);
  }
  claim.why += reached_bounds(curves);
  if (fits.empty())
    claim.why += "; no family has enough sizes with events for a fit.";
  else
    claim.why += fmt::format(
        "; a fit is no proof: over up to {} sizes c n log n leaves residuals of up to {}, and {}.", sizes,
        percent(worst),
        faster.empty() ? "no family's exponent lies significantly above 1"
                       : "the exponent lies significantly above 1 for " + joined(faster));
  return claim;
}

Claim judge_independent_of_frames(const std::vector<FrameRun>& frames) {
  Claim claim{.id = "T7",
              .title = "the number of events does not depend on the number of frames",
              .statement = "Updates are independent of the frame rate; bottom-up needs O(k n) for k frames.",
              .citation = "section 5",
              .counter = "events and changes of one clip at several l; values written by bottom_up",
              .bound = "spread 0; bottom-up proportional to frames",
              .data = frames};
  std::map<std::string, std::vector<const FrameRun*>> scenes;
  for (const FrameRun& run : frames) scenes[run.scene + std::to_string(run.triangles)].push_back(&run);
  double spread = 0, grows = 0, most_l = 0;
  std::uint64_t clips = 0, events = 0, differ = 0;
  for (const auto& [key, runs] : scenes) {
    if (runs.size() < 2) continue;
    ++clips;
    const FrameRun& first = *runs[0];
    for (const FrameRun* run : runs) {
      const double off = std::abs(double(run->events) - double(first.events)) +
                         std::abs(double(run->values) - double(first.values));
      claim.expect_none(
          "events and changes compared with those of l = " + std::to_string(first.l) + ", " + place(*run),
          off);
      claim.expect_equal("the log of changes is the same (1), " + place(*run), run->same_log, 1);
      const double expected = double(run->frames) / double(first.frames);
      const double measured = double(run->bottom_up_values) / double(first.bottom_up_values);
      claim.expect_equal(
          "bottom-up's values compared with those of l = " + std::to_string(first.l) + ", " + place(*run),
          measured, expected);
      spread = std::max(spread, off);
      differ += run->same_log != 1;
      grows = std::max(grows, measured);
      most_l = std::max(most_l, double(run->l));
    }
    events += first.events;
  }
  if (claim.criteria.empty()) return undecided(claim, "No clip was played at two frame rates.");
  claim.measured = fmt::format("spread {}; bottom-up's values times {:.4g}", number(spread), grows);
  claim.why = fmt::format(
      "{} with {} events in all, played at up to {} frames per keyframe interval: {}, while bottom-up writes "
      "{:.4g} times as many values as at the lowest rate.",
      counted(clips, "clip"), number(events), number(most_l),
      spread == 0 && differ == 0 ? "events, changes and their order are the same at every rate"
                                 : "events or changes differ by up to " + number(spread) + ", and " +
                                       number(differ) + " logs differ",
      grows);
  return claim;
}

Claim judge_optimal(const std::vector<ExactRun>& exact, const std::vector<LooseRun>& loose) {
  Claim claim{.id = "T8",
              .title = "optimal: no valid AABB hierarchy makes fewer updates",
              .statement = "Every AABB hierarchy that performs fewer updates is invalid at some time.",
              .citation = "section 1, Theorem 1, section 5",
              .counter =
                  "changes per node, side and instant; breakpoints of exact envelopes; updates of a "
                  "hierarchy of constant boxes",
              .bound = "changes equal breakpoints; no valid hierarchy with fewer updates",
              .condition = "among tight hierarchies, and counting net changes of a bound at one instant",
              .data = {{"exact", exact}, {"loose", loose}}};
  if (exact.empty()) return undecided(claim, "No clip was proved.");
  std::uint64_t logged = 0, net = 0, envelope = 0, ties = 0, general = 0;
  for (const ExactRun& run : exact) {
    claim.expect_none("logs that differ from the envelopes, " + place(run), !run.violation.empty());
    claim.expect_equal("net changes, " + place(run), run.net, run.envelope);
    claim.expect_equal("changes beyond net ones, compared with those of ties, " + place(run),
                       double(run.logged) - double(run.net), run.several_steps);
    claim.expect_none("changes beyond net ones, " + place(run), double(run.logged) - double(run.net),
                      as_stated);
    logged += run.logged, net += run.net, envelope += run.envelope, ties += run.several_steps;
    general += run.several_steps == 0 && run.choices == 0;
  }
  std::uint64_t kinetic = 0, outside = 0;
  double least_loose = 1e300, most_loose = 0;
  for (const LooseRun& run : loose) {
    claim.expect_none("constant boxes that do not contain a vertex at a frame, " + place(run),
                      run.swept_outside);
    claim.expect_at_most(
        "changes of the kinetic tree compared with the updates of constant boxes, " + place(run),
        run.kinetic_values, run.swept_updates, as_stated);
    kinetic += run.kinetic_values, outside += run.swept_outside;
    least_loose = std::min(least_loose, run.swept_looseness);
    most_loose = std::max(most_loose, run.swept_looseness);
  }
  claim.measured =
      fmt::format("{} net changes, {} breakpoints, {} more changes at ties; constant boxes: 0 updates",
                  number(net), number(envelope), number(ties));
  claim.why = fmt::format(
      "Among tight hierarchies {}: {} net changes against {} breakpoints in {} ({} of them in general "
      "position, where every logged change is one); {} further changes pass through ties at one instant.",
      net == envelope ? "none makes fewer" : "some make fewer", number(net), number(envelope),
      counted(exact.size(), "clip"), general, number(logged - net));
  if (!loose.empty())
    claim.why += fmt::format(
        " Definition 1 requires containment only, and one constant box per node, swept over the clip, {} at "
        "every frame with no update at all, against {} changes; the price is a looseness of {:.3g} to "
        "{:.3g}.",
        outside == 0 ? "contains everything" : "does not contain everything", number(kinetic), least_loose,
        most_loose);
  return claim;
}

Claim judge_never_more_updates(const std::vector<FrameRun>& frames,
                               const std::vector<FrameRun>& constructed) {
  Claim claim{
      .id = "T9",
      .title = "the kinetic tree never performs more updates than bottom-up",
      .statement = "The kinetic algorithm never performs more updates than the brute-force update.",
      .citation = "section 5",
      .counter = "values written per frame by the kinetic tree and by bottom-up on the same topology",
      .bound = "in every frame at most bottom-up's six per node",
      .condition = "no realiser changes more than once between two frames (sufficient, not necessary)",
      .data = {{"frames", frames}, {"constructed", constructed}}};
  if (frames.empty() && constructed.empty()) return undecided(claim, "No frames were compared.");
  std::uint64_t all = 0, repeated = 0, worse = 0, made_worse = 0;
  double worst = 0;
  const auto judge = [&](const FrameRun& run) {
    claim.expect_none("frames with more values than bottom-up although no bound changes twice, " + place(run),
                      run.worse_without_repeat);
    claim.expect_none("frames with more values than bottom-up, " + place(run), run.worse_frames, as_stated);
  };
  for (const FrameRun& run : frames) {
    judge(run);
    all += run.frames, repeated += run.repeated_frames, worse += run.worse_frames;
    worst = std::max(worst, run.worst_share);
  }
  for (const FrameRun& run : constructed) judge(run), made_worse += run.worse_frames;
  claim.measured = fmt::format("more values in {} of {} frames, and in {} of the constructed ones",
                               number(worse), number(all), number(made_worse));
  for (const FrameRun& run : constructed)
    claim.why += fmt::format(
        "{}: in one frame the realiser of one bound changes {} times, and the kinetic tree writes {} values "
        "where bottom-up writes {}. ",
        place(run), run.most_of_bound, number(run.values), number(run.bottom_up_values));
  if (!frames.empty())
    claim.why += fmt::format(
        "In the other clips some bound changes more than once in {} of {} frames, but {} frames cost more "
        "than bottom-up (the worst writes {} of its values).",
        number(repeated), number(all), worse == 0 ? "no" : number(worse), percent(worst));
  return claim;
}

Claim judge_translation(const std::vector<TranslationRun>& translations) {
  Claim claim{
      .id = "T10",
      .title = "a translation of all vertices causes no event",
      .statement = "If all vertices are translated, nothing needs to be done: no events occur.",
      .citation = "section 5",
      .counter = "events of translations, and those between vertices that coincided before",
      .bound = "0 events",
      .condition = "the translated coordinates are exact in the scalar; else ties of rounded ones separate",
      .data = translations};
  if (translations.empty()) return undecided(claim, "No translation was played.");
  for (const TranslationRun& run : translations) {
    claim.expect_none("events, " + run.scene, run.events, run.exact ? always : as_stated);
    if (!run.exact)
      claim.expect_none("events other than separating ties, " + run.scene,
                        double(run.events) - double(run.separated_ties));
    const std::string keyframes = counted(run.keyframes, "keyframe");
    claim.measured +=
        fmt::format("{}{}: {} events", claim.measured.empty() ? "" : "; ", run.scene, number(run.events));
    if (run.exact)
      claim.why += fmt::format("{} ({} vertices, {}, every coordinate exact): {} events. ", run.scene,
                               number(run.vertices), keyframes, number(run.events));
    else
      claim.why += fmt::format(
          "{} ({} vertices, {}, {} coordinates rounded): {} events, {} of them between vertices with equal "
          "coordinates before: rounding made ties, which then separate. ",
          run.scene, number(run.vertices), keyframes, number(run.rounded), number(run.events),
          number(run.separated_ties));
  }
  claim.why.pop_back();
  return claim;
}

Claim judge_plan_changes(const std::vector<PlanRun>& plans) {
  Claim claim{
      .id = "T15",
      .title = "flight-plan updates do not change the combinatorial structure",
      .statement =
          "A flight-plan update does not change the combinatorial structure of the hierarchy, which stays "
          "valid.",
      .citation = "section 4, proof of Theorem 1",
      .counter = "nodes that differ; realisers exceeded before and after; realisers changed by the update",
      .bound = "0",
      .condition =
          "the new plan starts where the old one is; a position rounded to the scalar may pass another",
      .data = plans};
  if (plans.empty()) return undecided(claim, "No plan was changed.");
  std::uint64_t updates = 0, at_keyframes = 0, changed = 0, moved = 0, moved_at_keyframes = 0, invalid = 0,
                topology = 0, wrong = 0;
  for (const PlanRun& run : plans) {
    claim.expect_none("stops at which the topology differs, " + place(run), run.topology_changes);
    claim.expect_none("bounds exceeded before and after updates, " + place(run),
                      run.invalid_before + run.invalid_after);
    claim.expect_none("clips that differ from their envelopes, " + place(run), !run.violation.empty());
    claim.expect_none("realisers changed by updates that start where the plan is, " + place(run),
                      run.moved_at_keyframes);
    claim.expect_none("realisers changed by updates, " + place(run),
                      run.moved_at_keyframes + run.moved_between, as_stated);
    updates += run.updates, at_keyframes += run.updates_at_keyframes, changed += run.changed_plans;
    moved += run.moved_between, moved_at_keyframes += run.moved_at_keyframes;
    invalid += run.invalid_before + run.invalid_after, topology += run.topology_changes;
    wrong += !run.violation.empty();
  }
  claim.measured = fmt::format("{} realisers changed at keyframes, {} between; {} bounds exceeded",
                               number(moved_at_keyframes), number(moved), number(invalid));
  claim.why = fmt::format(
      "{} updates of {} plans: the topology differed {} times, {} bounds were exceeded before or after in "
      "exact arithmetic, and {} clips differ from their envelopes; {} updates at keyframes changed {} "
      "realisers, {} between keyframes, where a vertex starts from its rounded position, changed {}.",
      number(updates), number(changed), number(topology), number(invalid), number(wrong),
      number(at_keyframes), number(moved_at_keyframes), number(updates - at_keyframes), number(moved));
  return claim;
}

Claim judge_lower_bound(const std::vector<LooseRun>& loose) {
  Claim claim{.id = "T16",
              .title = "a lower bound on updates for every BVH update strategy",
              .statement =
                  "There is a lower bound for the total number of BV updates, independent of the number of "
                  "frames, which holds for every BVH updating strategy.",
              .citation = "abstract, sections 1 and 5",
              .counter =
                  "updates between keyframes of boxes that move linearly, and of the kinetic tree; values "
                  "computed in all",
              .bound = "no valid hierarchy needs fewer updates than the kinetic tree has events",
              .data = loose};
  std::uint64_t events = 0, values = 0, computed = 0, bottom_up = 0, bounds = 0, frames = 0;
  double most_loose = 0;
  std::size_t clips = 0;
  std::set<std::uint64_t> ls;
  for (const LooseRun& run : loose) {
    // Only valid hierarchies can refute the claim, and only where there are events.
    if (run.linear_outside != 0 || run.swept_outside != 0 || run.kinetic_events == 0) continue;
    claim.expect_at_least("updates between keyframes of a valid hierarchy, " + place(run), run.linear_updates,
                          run.kinetic_events);
    events += run.kinetic_events, values += run.kinetic_values, computed += run.linear_values;
    bottom_up += run.bottom_up_values, bounds += run.bounds, frames += run.frames;
    most_loose = std::max(most_loose, run.linear_looseness);
    ls.insert(run.l);
    ++clips;
  }
  if (clips == 0) return undecided(claim, "No valid loose hierarchy was compared on a clip with events.");
  claim.measured =
      fmt::format("linear boxes: 0 updates between keyframes, {} values at keyframes; kinetic: {} changes",
                  number(computed), number(values));
  claim.why = fmt::format(
      "In {} boxes computed at keyframes ({} values) and linear in between contain every vertex at all {} "
      "frames with no update in between, at most {:.2g} looser than tight, where the kinetic tree has {} "
      "events ({} changes, bottom-up {} values); constant boxes need {} values for a whole clip. What does "
      "hold is T8: for tight hierarchies the changes are forced; and the paper's argument bounds events from "
      "above, not from below.",
      counted(clips, "clip"), number(computed), number(frames), most_loose, number(events), number(values),
      number(bottom_up), number(bounds));
  return claim;
}

}  // namespace kbvh::theory
