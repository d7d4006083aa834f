// T11, T12: the kinetic BoxTree.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "experiments/common/text.hpp"
#include "experiments/theory/judge.hpp"

namespace kbvh::theory {

using experiments::counted;

Claim judge_boxtree_size(const std::vector<BoxTreeRun>& boxtrees) {
  Claim claim{
      .id = "T11",
      .title = "BoxTree: at most two events per node, less memory, fewer events",
      .statement =
          "The kinetic BoxTree has at most two events per node, needs less memory than the kinetic AABB tree "
          "and has fewer events.",
      .citation = "section 6, Theorem 5",
      .counter =
          "events alive per inner node; bytes and events compared with the AABB tree's on one topology",
      .bound = "two events per inner node; bytes and events of the AABB tree",
      .condition = "the root additionally stores its own six sides, which the paper omits",
      .data = boxtrees};
  if (boxtrees.empty()) return undecided(claim, "No BoxTree was played.");
  double most_memory = 0, most_events = 0;
  std::uint64_t of_planes = 0, of_roots = 0, compared = 0, fewer = 0;
  for (const BoxTreeRun& run : boxtrees) {
    claim.expect_at_most("most events of an inner node's planes, " + place(run), run.most_of_planes, 2);
    claim.expect_at_most("most events alive, " + place(run), run.queue_peak,
                         2 * double(run.inner_nodes) + 6 * double(run.trees));
    const std::uint64_t roots = run.certificates - 2 * run.inner_nodes;
    claim.expect_at_most("events compared with those of inner nodes, " + place(run), roots, 0, as_stated);
    claim.expect_at_most("bytes, " + place(run), run.bytes, run.aabb_bytes);
    of_planes = std::max(of_planes, run.most_of_planes);
    of_roots = std::max(of_roots, roots / std::max<std::uint64_t>(run.trees, 1));
    most_memory = std::max(most_memory, double(run.bytes) / double(run.aabb_bytes));
    if (run.aabb_events == 0) continue;
    claim.expect_at_most("events, " + place(run), run.events, run.aabb_events);
    const double share = double(run.events) / double(run.aabb_events);
    most_events = std::max(most_events, share);
    fewer += share <= 1;
    ++compared;
  }
  claim.measured =
      fmt::format("at most {} events per inner node, {} at a root; {:.3g} of the bytes; {:.3g} of the events",
                  of_planes, of_roots, most_memory, most_events);
  claim.why = fmt::format(
      "In {} the planes of an inner node never had more than {} events at once, and each root had up to {} "
      "further events; trees and queue took at most {:.3g} of the AABB tree's bytes; in {} of {} clips with "
      "events the BoxTree had fewer events, at most {:.3g} of the AABB tree's.",
      counted(boxtrees.size(), "clip"), of_planes, of_roots, most_memory, fewer, compared, most_events);
  return claim;
}

Claim judge_boxtree_qualities(const std::vector<BoxTreeRun>& boxtrees,
                              const std::vector<SearchRun>& searches) {
  Claim claim{.id = "T12",
              .title = "BoxTree: valid, compact, local, efficient; responsive in 1D only",
              .statement =
                  "The kinetic BoxTree is compact, local and efficient and valid at every time; it is "
                  "responsive only in the one-dimensional case.",
              .citation = "Theorem 5",
              .counter =
                  "nodes visited by a certificate search; certificates of a vertex; events that change "
                  "nothing; stored bounds against exact envelopes",
              .bound = "one axis: 2 log2 m + 1 nodes; root x, all else y: half of all nodes",
              .data = {{"boxtrees", boxtrees}, {"searches", searches}}};
  if (boxtrees.empty() || searches.empty()) return undecided(claim, "No BoxTree was played.");
  std::uint64_t silent = 0, events = 0, proved = 0, wrong = 0;
  double local = 0;
  for (const BoxTreeRun& run : boxtrees) {
    claim.expect_none("bounds that differ from their envelopes, " + place(run), !run.violation.empty());
    claim.expect_none("events that change no realiser, " + place(run), run.silent_events);
    const double bound = double(run.max_leaves_of_vertex) * (6 + 2 * (double(run.depth) + 6));
    claim.expect_at_most("most certificates of a vertex, " + place(run), run.max_vertex_certificates, bound);
    local = std::max(local, double(run.max_vertex_certificates) / bound);
    silent += run.silent_events, events += run.events, proved += run.proved, wrong += !run.violation.empty();
  }
  const SearchRun *one = nullptr, *adversarial = nullptr, *mixed = nullptr;
  for (const SearchRun& run : searches) {
    const std::string where = run.tree + ", " + number(run.leaves) + " leaves";
    if (run.tree == "one axis") {
      claim.expect_at_most("most nodes of a search, " + where, run.most_searched,
                           2 * std::ceil(std::log2(double(run.leaves))) + 1);
      one = &run;
    } else if (run.tree == "mixed") {
      mixed = &run;
    } else {
      // The claim says that this case is not responsive: a search through half of the tree proves it.
      claim.expect_at_least("most nodes of a search, " + where, run.most_searched, double(run.leaves) - 1);
      claim.expect_at_least("events at the root's planes, " + where, run.events_of_root, 1);
      adversarial = &run;
    }
  }
  claim.why = fmt::format(
      "{} stored bounds were proved against exact envelopes ({} clips differ), {} of {} events change "
      "nothing, and no vertex takes part in more than {:.0f}% of the certificates that its leaves and the "
      "depth allow.",
      number(proved), wrong, silent == 0 ? "none" : number(silent), number(events), 100 * local);
  const auto mean = [](const SearchRun& run) {
    return double(run.searched) / double(std::max<std::uint64_t>(run.searches, 1));
  };
  if (one != nullptr) {
    claim.measured =
        fmt::format("one axis: at most {} nodes of {} leaves", one->most_searched, number(one->leaves));
    claim.why += fmt::format(" On one axis a search visits at most {} of {} nodes;", one->most_searched,
                             number(2 * one->leaves - 1));
  }
  if (adversarial != nullptr) {
    claim.measured += fmt::format("; root x, else y: {}", number(adversarial->most_searched));
    claim.why += fmt::format(
        " with the root split on x and all other nodes on y a search visits up to {} of {} nodes, and an "
        "event at the root's planes costs {} on average;",
        number(adversarial->most_searched), number(2 * adversarial->leaves - 1),
        number(std::round(double(adversarial->searched_by_root) /
                          double(std::max<std::uint64_t>(adversarial->events_of_root, 1)))));
  }
  if (mixed != nullptr) {
    claim.measured +=
        fmt::format("; mixed: {} ({:.3g} on average)", number(mixed->most_searched), mean(*mixed));
    claim.why += fmt::format(" with axes chosen by area {} on average, {} at most.", number(mean(*mixed)),
                             number(mixed->most_searched));
  }
  if (claim.why.back() == ';') claim.why.back() = '.';
  return claim;
}

}  // namespace kbvh::theory
