// C1 to C4: what the paper proposes in its last section, as far as counts decide it.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "experiments/common/text.hpp"
#include "experiments/theory/judge.hpp"

namespace kbvh::theory {

using experiments::counted;

namespace {

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? (part == 0 ? 1.0 : 1e300) : double(part) / double(whole);
}

/// Returns "0.3 to 0.5".
std::string range(const std::vector<double>& values) {
  if (values.empty()) return "none";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return *low == *high ? fmt::format("{:.3g}", *low) : fmt::format("{:.3g} to {:.3g}", *low, *high);
}

}  // namespace

Claim judge_order(const std::vector<OrderRun>& orders) {
  Claim claim{
      .id = "C1",
      .title = "trees of higher order improve on binary trees",
      .statement = "Trees of higher order than binary trees improve the performance of kinetic hierarchies.",
      .citation = "section 10",
      .counter =
          "events, changes of bounds, certificates, comparisons in the queue and box tests of a clip with "
          "queries, four and eight children per node over two",
      .bound = "the numbers of the binary tree",
      .condition =
          "counting events and changes of bounds: certificates of a node with more children compare more "
          "vertices, and a query tests more boxes",
      .data = orders};
  std::map<std::string, const OrderRun*> binary;
  for (const OrderRun& run : orders)
    if (run.width == 2) binary[place(run)] = &run;
  std::vector<double> events, values, certificates, steps, tests;
  std::set<std::string> clips;
  for (const OrderRun& run : orders) {
    const auto two = binary.find(place(run));
    if (run.width == 2 || two == binary.end() || two->second->events == 0) continue;
    const OrderRun& other = *two->second;
    clips.insert(place(run));
    const std::string where = fmt::format(", {} children, {}", run.width, place(run));
    const auto compare = [&](const char* what, std::uint64_t mine, std::uint64_t bound, Role role,
                             std::vector<double>& shares) {
      claim.expect_at_most(what + where, mine, bound, role);
      shares.push_back(share(mine, bound));
    };
    compare("events", run.events, other.events, always, events);
    compare("changes of bounds", run.values, other.values, always, values);
    compare("certificates", run.certificates, other.certificates, as_stated, certificates);
    compare("comparisons in the queue", run.steps, other.steps, as_stated, steps);
    compare("box tests", run.box_tests, other.box_tests, as_stated, tests);
  }
  if (claim.criteria.empty()) return undecided(claim, "No clip was played through trees of several orders.");
  claim.measured =
      fmt::format("events {}, changes {}, certificates {}, comparisons {}, box tests {} of the binary tree's",
                  range(events), range(values), range(certificates), range(steps), range(tests));
  claim.why = fmt::format(
      "With four and eight children per node, {} {} {} of the binary tree's events and {} of its changes of "
      "bounds, with {} of its certificates, {} of its comparisons in the queue and {} of its box tests.",
      counted(clips.size(), "clip"), clips.size() == 1 ? "has" : "have", range(events), range(values),
      range(certificates), range(steps), range(tests));
  return claim;
}

Claim judge_rebuild(const std::vector<RebuildRun>& rebuilds) {
  Claim claim{
      .id = "C2",
      .title = "rebuilding degenerated parts of a BoxTree pays",
      .statement =
          "It is a good strategy to rebuild parts of a BoxTree if the deformation is too strong; this also "
          "speeds up the algorithm.",
      .citation = "section 10",
      .counter =
          "box tests of a clip with queries, and nodes that its updates visit, with rebuilt parts over "
          "without",
      .bound = "the numbers of the tree that is never rebuilt",
      .condition = "on scenes whose deformation is strong, and counting box tests of queries",
      .data = rebuilds};
  std::map<std::string, const RebuildRun*> never;
  for (const RebuildRun& run : rebuilds)
    if (run.rebuild == "never") never[place(run)] = &run;
  std::vector<double> tests, work;
  std::set<std::string> clips;
  double best = 1e300;
  for (const RebuildRun& run : rebuilds) {
    const auto without = never.find(place(run));
    if (run.rebuild == "never" || without == never.end()) continue;
    const RebuildRun& other = *without->second;
    // No query has work that rebuilding could save, or no part was rebuilt.
    if (other.box_tests == 0 || (run.box_tests == other.box_tests && run.events == other.events)) continue;
    clips.insert(place(run));
    const std::string where = fmt::format(", rebuilt by {}, {}", run.rebuild, place(run));
    claim.expect_at_most("box tests" + where, run.box_tests, other.box_tests, as_stated);
    claim.expect_at_most("box tests and visited nodes" + where, run.box_tests + run.visited,
                         other.box_tests + other.visited, as_stated);
    tests.push_back(share(run.box_tests, other.box_tests));
    work.push_back(share(run.box_tests + run.visited, other.box_tests + other.visited));
    best = std::min(best, tests.back());
  }
  if (claim.criteria.empty()) return undecided(claim, "No part of a BoxTree was rebuilt.");
  claim.expect_at_most("box tests over those without rebuilding, where rebuilding saves most", best, 1);
  claim.measured = fmt::format("box tests {}, with visited nodes {} of those without rebuilding",
                               range(tests), range(work));
  claim.why = fmt::format(
      "In {} with rebuilt parts, rebuilding left {} of the box tests of all queries, and {} of box tests and "
      "visited nodes together.",
      counted(clips.size(), "clip"), range(tests), range(work));
  return claim;
}

Claim judge_sweeps(const std::vector<SweepRun>& sweeps) {
  Claim claim{
      .id = "C3",
      .title = "the separation list extends to continuous collision detection",
      .statement =
          "Kinetic incremental collision detection is easily extended to continuous collision detection: the "
          "list is valid at every time, and only an algorithm for the triangles has to be added.",
      .citation = "section 10",
      .counter =
          "contacts of vertices and faces, and of edges, over all keyframe intervals of a clip; pairs of "
          "triangles that reach their test",
      .bound =
          "0 contacts other than those of swept boxes, and in every eighth interval those of all pairs; the "
          "pairs of swept boxes of a refitted tree",
      .condition = "the list keeps all contacts, but passes on more pairs of triangles than swept boxes",
      .data = sweeps};
  std::uint64_t contacts = 0, different = 0, intervals = 0;
  std::vector<double> pairs;
  for (const SweepRun& run : sweeps) {
    claim.expect_none("contacts that only one answer has, " + place(run), run.different);
    contacts += run.contacts, different += run.different, intervals += run.sweeps;
    if (run.refit_pairs == 0) continue;
    claim.expect_at_most("pairs of triangles, " + place(run), run.list_pairs, run.refit_pairs, as_stated);
    pairs.push_back(share(run.list_pairs, run.refit_pairs));
  }
  if (contacts == 0) {
    claim.criteria.clear();
    return undecided(claim, "No clip has a contact.");
  }
  claim.measured = fmt::format("{} of {} contacts differ; pairs of triangles {} of those of swept boxes",
                               number(different), number(contacts), range(pairs));
  claim.why = fmt::format(
      "Over {} of {}, the list's leaves that overlap at some time lead to {} of the {} contacts that swept "
      "boxes and, where they were tested, all pairs of triangles have; {} of the pairs of triangles of swept "
      "boxes reach their test.",
      counted(intervals, "keyframe interval"), counted(sweeps.size(), "clip"),
      different == 0 ? "all" : "not all", number(contacts), range(pairs));
  return claim;
}

Claim judge_motion(const std::vector<MotionRun>& motions) {
  Claim claim{
      .id = "C4",
      .title = "the structures work in other kinds of motion",
      .statement =
          "The algorithms can be used in other kinds of motion: physically based simulations and other "
          "animation schemes.",
      .citation = "section 10, and section 3 on algebraic flight plans",
      .counter =
          "events of thrown bodies on curves of degree 2 and 3, at two frame rates and with lines between "
          "the same keyframes; pairs that differ from the oracle's",
      .bound =
          "0 pairs; the same events at both rates; twice the events of lines (lambda_2(n) - 1 over n - 1)",
      .condition =
          "a keyframe interval on curves has more events than on lines: curves cross up to as often as their "
          "degree",
      .data = motions};
  std::vector<double> events;
  std::uint64_t clips = 0, frames = 0, different = 0, pairs = 0;
  std::set<std::uint64_t> degrees;
  for (const MotionRun& run : motions) {
    if (run.events == 0 || run.pairs + run.different == 0) continue;  // there is nothing to compare
    ++clips;
    const std::string where =
        fmt::format(", degree {}, {}, {} segments", run.degree, place(run), run.segments);
    claim.expect_none("pairs that differ from the oracle's" + where, run.different);
    claim.expect_equal("events at 10 frames per keyframe" + where, run.events, run.events_at_keyframes);
    frames += run.frames, different += run.different, pairs += run.pairs;
    degrees.insert(run.degree);
    if (run.events_on_lines == 0) continue;
    claim.expect_at_most("events on curves" + where, run.events, 2 * double(run.events_on_lines), as_stated);
    events.push_back(share(run.events, run.events_on_lines));
  }
  if (clips == 0) return undecided(claim, "No clip on curves has events and pairs.");
  std::string of_degree;
  for (const std::uint64_t degree : degrees)
    of_degree += (of_degree.empty() ? "" : " and ") + std::to_string(degree);
  claim.measured = fmt::format("{} of {} pairs differ in {} frames; events {} of those of lines",
                               number(different), number(pairs), number(frames), range(events));
  claim.why = fmt::format(
      "On polynomials of degree {} the tree answers {} of {} frames' pairs as the oracle does, with as many "
      "events at ten frames per keyframe as at one, and {} times the events of lines through the same "
      "keyframes. Simulations that decide their motion at run time are not in these counts.",
      of_degree, different == 0 ? "all" : "not all", number(frames), range(events));
  return claim;
}

}  // namespace kbvh::theory
