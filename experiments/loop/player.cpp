#include "experiments/loop/player.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <memory>
#include <tuple>
#include <utility>

#include "core/broad_phase/element_distance.hpp"
#include "experiments/common/stopwatch.hpp"

namespace kbvh::experiments::loop {
namespace {

constexpr CandidateKind contact_kinds[] = {CandidateKind::face_vertex, CandidateKind::edge_edge};
using PairLists = std::vector<Candidate>[2];  // ascending, of contact_kinds

/// One way to answer one question, and its last answer.
class Contestant {
 public:
  Contestant(const RecordingHeader& header, PlayedWay way, const ContactStrategy& strategy,
             std::uint32_t lose_every)
      : played(std::move(way)),
        header_(header),
        detector_(header.mesh,
                  {played.detection, played.keep * header.radius, header.radius, lose_every, strategy}) {}

  void answer(const RecordedIterate& iterate) {
    const auto begin = std::chrono::steady_clock::now();
    if (played.question == IterateQuestion::near)
      detector_.update(iterate.begin);
    else
      detector_.update(iterate.begin, iterate.end);
    for (int k = 0; k < 2; ++k) {
      if (played.question == IterateQuestion::near)
        detector_.broad().within(contact_kinds[k], header_.radius, near_[k]);
      else
        candidates_[k] = detector_.candidates(contact_kinds[k]);
    }
    if (played.question == IterateQuestion::impact) impact_ = detector_.earliest_impact(header_.separation);
    played.seconds += seconds_since(begin);
    played.searches = detector_.searches();
    for (int k = 0; k < 2; ++k) {
      const std::span<const Candidate> found =
          played.question == IterateQuestion::near ? span_of(near_[k]) : candidates_[k];
      played.listed += found.size();
      pairs[k].assign(found.begin(), found.end());
      std::sort(pairs[k].begin(), pairs[k].end());
    }
  }

  /// Counts a difference from the answer of the way `refit`.
  void compare(const Contestant& refit) {
    bool equal = true;
    if (played.question == IterateQuestion::impact) {
      const EarliestImpact &a = impact_, &b = refit.impact_;
      equal = a.touches == b.touches &&
              (!a.touches || std::tuple(a.kind, a.pair.first, a.pair.second, a.begin, a.end) ==
                                 std::tuple(b.kind, b.pair.first, b.pair.second, b.begin, b.end));
    } else {
      for (int k = 0; k < 2; ++k) {
        const bool superset =
            played.question == IterateQuestion::swept && played.detection == Detection::kept;
        equal = equal && (superset ? std::includes(pairs[k].begin(), pairs[k].end(), refit.pairs[k].begin(),
                                                   refit.pairs[k].end())
                                   : pairs[k] == refit.pairs[k]);
      }
    }
    played.differences += equal ? 0 : 1;
  }

  /// Counts true pairs that the last answer lacks.
  void compare_with_truth(const PairLists& truth) {
    for (int k = 0; k < 2; ++k) {
      std::vector<Candidate> lacking;
      std::set_difference(truth[k].begin(), truth[k].end(), pairs[k].begin(), pairs[k].end(),
                          std::back_inserter(lacking));
      played.lacking += lacking.size();
    }
  }

  PlayedWay played;
  PairLists pairs;

 private:
  const RecordingHeader& header_;
  IterateDetector detector_;
  CandidateBuffer near_[2];
  std::span<const Candidate> candidates_[2];
  EarliestImpact impact_;
};

/// Lists all pairs within the radius that may touch, by comparing every element with every other one.
class Truth {
 public:
  explicit Truth(const RecordingHeader& header)
      : header_(header),
        elements_(
            make_elements(header.mesh.vertices, view_of(header.mesh.edges), view_of(header.mesh.faces))) {}

  void list(const Positions& x, PairLists& out) {
    for (int k = 0; k < 2; ++k) {
      out[k].clear();
      const CandidateKind kind = contact_kinds[k];
      const std::uint32_t firsts = elements_.count(first_element(kind)),
                          seconds = elements_.count(second_element(kind));
      for (std::uint32_t a = 0; a < firsts; ++a)
        for (std::uint32_t b = kind == CandidateKind::edge_edge ? a + 1 : 0; b < seconds; ++b) {
          const Candidate pair{a, b};
          if (may_touch(kind, pair) && is_near(kind, pair, x)) out[k].push_back(pair);
        }
    }
  }

 private:
  bool may_touch(CandidateKind kind, const Candidate& pair) const {
    if (elements_.incident(kind, pair)) return false;
    const auto& obstacle = header_.mesh.obstacle;
    const auto is_obstacle = [&](Element element, std::uint32_t id) {
      const auto vertices = elements_.vertices(element, id);
      return std::all_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) { return obstacle[v] != 0; });
    };
    if (is_obstacle(first_element(kind), pair.first) && is_obstacle(second_element(kind), pair.second))
      return false;
    const auto& inner = header_.mesh.inner;
    return kind != CandidateKind::face_vertex || !std::binary_search(inner.begin(), inner.end(), pair.second);
  }
  bool is_near(CandidateKind kind, const Candidate& pair, const Positions& x) const {
    const double *first[3], *second[3];
    const auto fill = [&](const double** out, Element element, std::uint32_t id) {
      for (const std::uint32_t v : elements_.vertices(element, id)) *out++ = x.data() + std::size_t(3) * v;
    };
    fill(first, first_element(kind), pair.first);
    fill(second, second_element(kind), pair.second);
    return is_within(kind, first, second, header_.radius);
  }

  const RecordingHeader& header_;
  Elements elements_;
};

/// Adds the ways that answer each question that is asked; the way `refit` comes first.
void add_ways(const RecordingHeader& header, IterateQuestion question, const PlaySettings& settings,
              std::vector<std::unique_ptr<Contestant>>& ways) {
  const auto add = [&](PlayedWay way, const ContactStrategy& strategy, std::uint32_t lose_every) {
    ways.push_back(std::make_unique<Contestant>(header, std::move(way), strategy, lose_every));
  };
  if (!settings.strategies.empty()) {
    if (question == IterateQuestion::near) return;
    add({question, Detection::refit}, {}, 0);
    for (const PlayedStrategy& one : settings.strategies) {
      PlayedWay way{question, Detection::refit};
      way.strategy = one.label;
      way.exact = one.exact;
      add(std::move(way), one.strategy, settings.lose_every);
    }
    return;
  }
  for (const Detection detection : {Detection::refit, Detection::rebuild}) add({question, detection}, {}, 0);
  for (const double keep : settings.keep) add({question, Detection::kept, keep}, {}, settings.lose_every);
}

}  // namespace

const char* name(IterateQuestion question) {
  switch (question) {
    case IterateQuestion::near:
      return "near";
    case IterateQuestion::swept:
      return "swept";
    case IterateQuestion::impact:
      break;
  }
  return "impact";
}

bool PlayResult::agree() const {
  return std::all_of(ways.begin(), ways.end(), [](const PlayedWay& way) {
    return !way.exact || (way.differences == 0 && way.lacking == 0);
  });
}

PlayResult play(const std::filesystem::path& file, const PlaySettings& settings,
                const std::function<void(std::uint64_t)>& done) {
  RecordingReader reader(file);
  const RecordingHeader& header = reader.header();
  std::vector<std::unique_ptr<Contestant>> contestants;
  for (const IterateQuestion question :
       {IterateQuestion::near, IterateQuestion::swept, IterateQuestion::impact})
    add_ways(header, question, settings, contestants);
  const std::size_t questions = settings.strategies.empty() ? 3 : 2, ways = contestants.size() / questions;
  Truth truth(header);
  PairLists truth_begin, truth_end;
  PlayResult result;
  std::uint32_t step = 0;
  for (RecordedIterate iterate; reader.next(iterate);) {
    if (settings.most_iterates > 0 && result.iterates == settings.most_iterates) break;
    for (std::size_t i = 0; i < contestants.size(); ++i)
      contestants[(i + result.iterates) % contestants.size()]->answer(iterate);
    for (std::size_t i = 0; i < contestants.size(); ++i) contestants[i]->compare(*contestants[i - i % ways]);
    if (settings.truth_every > 0 && result.iterates % settings.truth_every == 0) {
      truth.list(iterate.begin, truth_begin);
      truth.list(iterate.end, truth_end);
      ++result.truths;
      for (int k = 0; k < 2; ++k) result.true_pairs += truth_begin[k].size();
      for (auto& contestant : contestants) {
        contestant->compare_with_truth(truth_begin);
        if (contestant->played.question != IterateQuestion::near) contestant->compare_with_truth(truth_end);
      }
    }
    if (result.iterates == 0 || iterate.step != step) ++result.steps;
    step = iterate.step;
    ++result.iterates;
    if (done) done(result.iterates);
  }
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    PlayedWay way = contestants[i]->played;
    const double refit = contestants[i - i % ways]->played.seconds;
    way.over_refit = way.seconds > 0 ? refit / way.seconds : 0;
    result.ways.push_back(way);
  }
  return result;
}

}  // namespace kbvh::experiments::loop
