// T1 to T5: the quality criteria of a kinetic data structure.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "experiments/common/text.hpp"
#include "experiments/theory/judge.hpp"

namespace kbvh::theory {

using experiments::counted;

namespace {
template <class Run>
std::size_t scene_count(const std::vector<Run>& runs) {
  std::set<std::string> names;
  for (const Run& run : runs) names.insert(run.scene);
  return names.size();
}
}  // namespace

Claim undecided(Claim claim, const std::string& why) {
  claim.criteria.clear();
  claim.measured.clear();
  claim.why = why;
  return claim;
}

Claim judge_valid_at_all_times(const std::vector<ExactRun>& exact) {
  Claim claim{
      .id = "T1",
      .title = "the kinetic AABB tree is valid at every time, not only at frames",
      .statement = "If events are handled as described, every node bounds its polygons at every time.",
      .citation = "Theorem 1, Definition 1",
      .counter = "changes of realisers; realisers exceeded by a vertex",
      .bound = "the exact envelopes of the vertices below every node, on each of six sides",
      .data = exact};
  if (exact.empty()) return undecided(claim, "No clip was proved.");
  std::uint64_t logged = 0, bounds = 0, instants = 0, audited = 0, paths = 0, events = 0, faults = 0;
  std::string violation;
  for (const ExactRun& run : exact) {
    const std::uint64_t wrong = run.violation.empty() ? 0 : 1;
    claim.expect_none("logs that differ from the envelopes, " + place(run), wrong);
    claim.expect_none("realisers exceeded at audits, " + place(run), run.faults);
    claim.expect_none("realisers exceeded on paths of events, " + place(run), run.path_faults);
    if (wrong != 0 && violation.empty()) violation = place(run) + ": " + run.violation;
    logged += run.logged, bounds += run.bounds, instants += run.audited_instants, audited += run.audited;
    paths += run.path_bounds, events += run.events, faults += run.faults + run.path_faults;
  }
  claim.measured = number(logged) + " changes, " + number(faults) + " bounds exceeded";
  claim.why = fmt::format(
      "In {}, the log of {} changes of {} bounds {} the breakpoints of exact envelopes, instant by instant "
      "in rational arithmetic, which decides all times at once; audits at {} instants ({} bounds) and on the "
      "paths of {} events ({} bounds) found {} exceeded.",
      counted(exact.size(), "clip"), number(logged), number(bounds),
      violation.empty() ? "is equal to" : "differs from", number(instants), number(audited), number(events),
      number(paths), faults == 0 ? "none" : number(faults));
  if (!violation.empty()) claim.why += " First difference: " + violation + ".";
  return claim;
}

Claim judge_compact(const std::vector<CountRun>& counts) {
  Claim claim{.id = "T2",
              .title = "compact: at most six events per BV, O(m) space",
              .statement = "Every BV stores at most six events, so that space is O(m) for m polygons.",
              .citation = "Theorem 1",
              .counter = "events in the queue per node; bytes of trees and queue per polygon",
              .data = counts};
  if (counts.empty()) return undecided(claim, "Nothing was counted.");
  double most = 0, fewest_bytes = 1e300, most_bytes = 0, spread = 1;
  std::uint64_t of_node = 0;
  std::map<std::string, std::pair<double, double>> bytes;
  for (const CountRun& run : counts) {
    const double alive = double(run.queue_peak) / double(run.nodes);
    const double per_polygon = double(run.bytes) / double(run.triangles);
    claim.expect_at_most("most events alive per node, " + place(run), alive, 6);
    claim.expect_at_most("most events of one node, " + place(run), run.most_of_node, 6);
    most = std::max(most, alive);
    of_node = std::max(of_node, run.most_of_node);
    auto [at, fresh] = bytes.try_emplace(run.scene, per_polygon, per_polygon);
    at->second = {std::min(at->second.first, per_polygon), std::max(at->second.second, per_polygon)};
    fewest_bytes = std::min(fewest_bytes, per_polygon), most_bytes = std::max(most_bytes, per_polygon);
  }
  for (const auto& [scene, range] : bytes) {
    spread = std::max(spread, range.second / range.first);
    claim.expect_at_most("bytes per polygon, most over least of all sizes, " + scene,
                         range.second / range.first, 1, always, 0.1);
  }
  claim.bound = "6 events per node; bytes per polygon equal over sizes to 10%";
  claim.measured =
      fmt::format("at most {:.3g} events per node on average, {} at one; {} to {} bytes per polygon", most,
                  of_node, number(std::round(fewest_bytes)), number(std::round(most_bytes)));
  claim.why = fmt::format(
      "Over {} in {} the queue never held more than {:.3g} events per node and no node had more "
      "than {}; between the sizes of a family bytes per polygon vary by a factor of at most {:.3f}, {} "
      "linear space.",
      counted(counts.size(), "clip"), counted(scene_count(counts), "family"), most, of_node, spread,
      spread <= 1.1 ? "which is" : "which is not");
  return claim;
}

double queue_steps_bound(const CountRun& run) {
  const double levels = 1.4405 * std::log2(6 * double(run.nodes) + 2);
  return double(run.depth + 1) * (levels + 1);
}

Claim judge_responsive(const std::vector<CountRun>& counts) {
  Claim claim{.id = "T3",
              .title = "responsive: one event costs O(log^2 m)",
              .statement =
                  "An event is handled in O(log^2 m): a path of O(log m) nodes with one insertion and one "
                  "deletion in the queue each, if the height of the tree is logarithmic.",
              .citation = "Theorem 1",
              .counter = "per event: nodes visited, certificates computed, comparisons in the queue",
              .data = counts};
  std::vector<const CountRun*> runs;
  for (const CountRun& run : counts)
    if (run.events > 0) runs.push_back(&run);
  if (runs.empty()) return undecided(claim, "No clip had an event.");
  double share = 0, path_share = 0;
  const CountRun *largest = runs[0], *smallest = runs[0];
  for (const CountRun* run : runs) {
    const double bound = queue_steps_bound(*run);
    claim.expect_at_most("depth of the tree, " + place(*run), run->depth,
                         std::ceil(std::log2(double(run->triangles))) + 1);
    claim.expect_at_most("most nodes visited by an event, " + place(*run), run->max_visited, run->depth);
    claim.expect_at_most("most comparisons of an event, " + place(*run), run->max_steps, bound);
    claim.expect_at_most("most queue operations of an event, " + place(*run), run->max_operations,
                         2 * double(run->depth + 1) + 1);
    share = std::max(share, double(run->max_steps) / bound);
    if (run->depth > 0) path_share = std::max(path_share, double(run->max_visited) / double(run->depth));
    if (run->nodes > largest->nodes) largest = run;
    if (run->nodes < smallest->nodes) smallest = run;
  }
  const auto mean = [](const CountRun* run) { return double(run->sum_steps) / double(run->events); };
  claim.bound =
      fmt::format("nodes: the depth; comparisons: (depth + 1)(1.4405 log2(6 nodes + 2) + 1), {} at {}",
                  number(std::round(queue_steps_bound(*largest))), place(*largest));
  claim.measured =
      fmt::format("at most {:.0f}% of the depth and {:.0f}% of the comparisons; {:.1f} on average",
                  100 * path_share, 100 * share, mean(largest));
  claim.why = fmt::format(
      "No event took more than {} nodes (depth {}) and {} comparisons at {}, {:.0f}% of the bound at most "
      "anywhere; the mean goes from {:.1f} comparisons at {} to {:.1f}. Finding a failure walks the rest of "
      "a flight plan, segment by segment, which the paper and this count as one step.",
      largest->max_visited, largest->depth, number(largest->max_steps), place(*largest), 100 * share,
      mean(smallest), place(*smallest), mean(largest));
  return claim;
}

Claim judge_local(const std::vector<CountRun>& counts, const std::vector<CountRun>& fans) {
  Claim claim{.id = "T4",
              .title = "local: a vertex takes part in O(log m) certificates",
              .statement =
                  "If the degree of every vertex is bounded, a vertex takes part in O(log m) events, and a "
                  "change of its flight plan costs O(log^2 m).",
              .citation = "Theorem 1",
              .counter =
                  "certificates (of a node and side) with the vertex as winner or possible loser; candidates "
                  "examined by a change of one plan",
              .condition = "the number of polygons at a vertex is bounded, as the paper assumes",
              .data = {{"counts", counts}, {"fans", fans}}};
  if (counts.empty()) return undecided(claim, "Nothing was counted.");
  double share = 0, update_share = 0;
  std::uint64_t updates = 0;
  const CountRun* largest = &counts[0];
  for (const CountRun& run : counts) {
    const double bound = 6 * double(run.max_leaves_of_vertex) * double(run.depth + 1);
    claim.expect_at_most("most certificates of a vertex, " + place(run), run.max_vertex_certificates, bound);
    claim.expect_at_most(
        "share of the candidates above a vertex that a change of its plan examined, " + place(run),
        run.update_share, 1);
    share = std::max(share, double(run.max_vertex_certificates) / bound);
    update_share = std::max(update_share, run.update_share);
    updates += run.updates;
    if (run.nodes > largest->nodes) largest = &run;
  }
  for (const CountRun& fan : fans)
    claim.expect_at_most("certificates of the hub of a fan of " + number(fan.triangles) + " triangles",
                         fan.max_vertex_certificates, 6 * 6 * double(fan.depth + 1), as_stated);
  claim.bound = "6 x leaves of the vertex x (depth + 1); changes: all candidates of the nodes above it";
  claim.measured = fmt::format(
      "at {}: {} at most, {:.3g} on average; a change examines {:.3g} candidates, {} at most",
      place(*largest), number(largest->max_vertex_certificates), largest->mean_vertex_certificates,
      double(largest->sum_update_certificates) / double(std::max<std::uint64_t>(largest->updates, 1)),
      number(largest->max_update_certificates));
  claim.why = fmt::format(
      "In {} no vertex took part in more than {:.0f}% of the certificates that its leaves and the depth "
      "allow, and {} changes of single plans examined no more than {:.0f}% of the candidates above the "
      "vertex",
      counted(counts.size(), "clip"), 100 * share, number(updates), 100 * update_share);
  for (const CountRun& fan : fans)
    claim.why += fmt::format("{} the hub of a fan of {} triangles takes part in {} certificates",
                             &fan == &fans[0] ? "; without a bound on the degree it is linear:" : ",",
                             number(fan.triangles), number(fan.max_vertex_certificates));
  claim.why += ".";
  return claim;
}

Claim judge_efficient(const std::vector<CountRun>& counts, const std::vector<ExactRun>& exact) {
  Claim claim{.id = "T5",
              .title = "efficient: no internal events",
              .statement = "Every event changes the bounding volumes; there are no internal events.",
              .citation = "Theorem 1, section 5",
              .counter = "events that change no realiser; events whose changes have no duration",
              .bound = "0",
              .condition = "no three vertices below a node meet at one point at one instant",
              .data = {{"counts", counts}, {"exact", exact}}};
  if (counts.empty() && exact.empty()) return undecided(claim, "Nothing was counted.");
  std::uint64_t events = 0, silent = 0, exact_events = 0, momentary = 0, tied = 0;
  for (const CountRun& run : counts) {
    claim.expect_none("events that change no realiser, " + place(run), run.silent_events);
    events += run.events, silent += run.silent_events;
  }
  for (const ExactRun& run : exact) {
    claim.expect_at_most("events without duration, at most those of ties, " + place(run),
                         run.momentary_events, run.several_steps);
    claim.expect_none("events without duration, " + place(run), run.momentary_events, as_stated);
    exact_events += run.events, momentary += run.momentary_events, tied += run.momentary_events > 0;
  }
  claim.measured = fmt::format("{} of {} events change no realiser; {} of {} have no duration",
                               number(silent), number(events), number(momentary), number(exact_events));
  claim.why = fmt::format("{} of {} events changed no realiser.", silent == 0 ? "None" : number(silent),
                          number(events));
  if (momentary > 0)
    claim.why += fmt::format(
        " Where several vertices meet at one point, a bound may pass through some of them at a single "
        "instant: {} of {} events ({:.2g}%), in {} of {} exact clips, change a realiser but no bound for any "
        "length of time.",
        number(momentary), number(exact_events), 100 * double(momentary) / double(exact_events), tied,
        exact.size());
  else if (!exact.empty())
    claim.why += fmt::format(" In {} every one of {} events changed a bound for a positive time.",
                             counted(exact.size(), "exact clip"), number(exact_events));
  return claim;
}

}  // namespace kbvh::theory
