// T13, T14: kinetic incremental collision detection.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "experiments/common/text.hpp"
#include "experiments/theory/fit.hpp"
#include "experiments/theory/judge.hpp"

namespace kbvh::theory {

using experiments::counted;
using experiments::joined;

Claim judge_separation_list(const std::vector<SeparationRun>& separations) {
  Claim claim{
      .id = "T13",
      .title = "the separation list is valid at every time; storage and costs as stated",
      .statement =
          "Kinetic incremental collision detection is compact, local, responsive and efficient, and the list "
          "is valid at every time: exactly the pairs at which a traversal stops.",
      .citation = "Theorem 6, Definition 2",
      .counter =
          "entries that differ from a traversal between events; pairs and comparisons per event of "
          "each kind; pairs of a box",
      .bound =
          "0 differences; four pairs per overlap and event of parents apart; 1.4405 log2(events + 2) + 1 "
          "comparisons "
          "per operation; a box in no more pairs than there are nodes",
      .condition =
          "costs are counted per added or removed pair: new pairs may overlap at once, and removing a parent "
          "removes all pairs below it",
      .data = separations};
  if (separations.empty()) return undecided(claim, "No separation list was played.");
  std::uint64_t audits = 0, entries = 0, differences = 0, most = 0, of_box = 0;
  std::uint64_t events[4] = {0, 0, 0, 0}, pairs[4] = {0, 0, 0, 0};
  double share = 0, list_share = 0;
  for (const SeparationRun& run : separations) {
    const std::string where = run.scene + ", " + number(run.polygons) + " polygons";
    claim.expect_none("entries that differ from a traversal, " + where, run.differences);
    claim.expect_at_least("audits between events, " + where, run.audits, 1);
    const double bound = 1.4405 * std::log2(double(run.queue_peak + 12 * run.polygons) + 2) + 1;
    const SeparationRun::Kind* kinds[4] = {&run.overlap, &run.parents, &run.leaves, &run.changes};
    const char* names[4] = {"overlap", "parents apart", "leaves apart", "BV change"};
    for (int i = 0; i < 4; ++i) {
      claim.expect_at_most(std::string("comparisons per operation, ") + names[i] + ", " + where,
                           kinds[i]->most_steps_per_operation, bound);
      share = std::max(share, kinds[i]->most_steps_per_operation / bound);
      events[i] += kinds[i]->events, pairs[i] += kinds[i]->pairs;
      if (i >= 2) continue;
      claim.expect_at_most(std::string("most pairs touched, ") + names[i] + ", " + where,
                           kinds[i]->most_pairs, 4, as_stated);
      most = std::max(most, kinds[i]->most_pairs);
    }
    claim.expect_none("pairs made or removed by leaves events, " + where, run.leaves.pairs);
    claim.expect_at_most("most pairs of a box, " + where, run.most_of_box, 2 * double(run.polygons));
    audits += run.audits, entries += run.entries, differences += run.differences;
    of_box = std::max(of_box, run.most_of_box);
    list_share = std::max(list_share, double(run.list_peak) / double(run.polygons));
  }
  const auto mean = [&](int i) { return double(pairs[i]) / double(std::max<std::uint64_t>(events[i], 1)); };
  claim.measured = fmt::format(
      "{} differences in {} entries; an overlap makes {:.2f} pairs, a parent removes {:.2f}, {} at most",
      number(differences), number(entries), mean(0), mean(1), number(most));
  claim.why = fmt::format(
      "{} traversals between events, in rational arithmetic, found {} entries and {} that differ; {} overlap "
      "and {} events of parents apart make or remove {:.2f} and {:.2f} pairs on average, where the paper has "
      "four, "
      "and {} at most; {} leaves events touch their own pair only, {} tree events {:.2f} nodes and pairs. "
      "The queues took up to {:.0f}% of the comparisons allowed, a box was in {} pairs at most, and the list "
      "had up to {:.2g} entries per polygon.",
      number(audits), number(entries), differences == 0 ? "none" : number(differences), number(events[0]),
      number(events[1]), mean(0), mean(1), number(most), number(events[2]), number(events[3]), mean(3),
      100 * share, number(of_box), list_share);
  return claim;
}

Claim judge_list_size(const std::vector<ListSizeRun>& sizes) {
  constexpr double tolerance = 0.05;
  Claim claim{.id = "T14",
              .title = "the number of overlapping pairs is nearly linear in practice",
              .statement =
                  "The number of overlapping pairs, quadratic in the worst case, is nearly linear in "
                  "practical cases.",
              .citation = "section 7",
              .counter = "pairs in the list, and overlapping leaves among them, at keyframes",
              .bound = "exponent of m not above 1 + 5%",
              .condition = "of the scene: in some the number of pairs grows faster",
              .data = sizes};
  std::map<std::string, std::vector<const ListSizeRun*>> families;
  for (const ListSizeRun& run : sizes) families[run.scene].push_back(&run);
  std::vector<std::string> exponents, faster;
  double most = 0;
  for (auto& [scene, runs] : families) {
    std::sort(runs.begin(), runs.end(), [](auto a, auto b) { return a->polygons < b->polygons; });
    std::vector<double> m, list;
    for (const ListSizeRun* run : runs) {
      most = std::max(most, double(run->list) / double(run->polygons));
      // Requests below a shape's smallest size make the same scene, which is one point; zero has no
      // logarithm.
      if (run->list == 0 || (!m.empty() && m.back() == double(run->polygons))) continue;
      m.push_back(double(run->polygons));
      list.push_back(double(run->list));
    }
    if (m.size() < 4) continue;
    const PowerFit fit = fit_power(m, list);
    // "Practical cases" are scenes: a single one that grows faster makes a condition, all together a
    // refutation.
    claim.expect_at_most("lower end of the exponent's 95% interval, " + scene, fit.low, 1, as_stated,
                         tolerance);
    exponents.push_back(fmt::format("{} {:.2f} ({:.2f} to {:.2f})", scene, fit.exponent, fit.low, fit.high));
    if (fit.low > 1 + tolerance) faster.push_back(scene);
  }
  if (exponents.empty()) return undecided(claim, "No list was made at four different sizes or more.");
  claim.expect_at_most("scenes that grow faster", faster.size(), double(exponents.size()) - 1);
  claim.measured = "exponents: " + joined(exponents, "; ");
  claim.why = fmt::format("With m polygons in all, the list has at most {:.3g} m entries, and {}.", most,
                          faster.empty() ? "in none of " + counted(exponents.size(), "family") +
                                               " does it grow significantly faster than m"
                                         : "it grows significantly faster than m in " + joined(faster));
  return claim;
}

}  // namespace kbvh::theory
