// Kinetic sweep and prune: the ends of the leaves' boxes stay sorted on all three axes, by events that
// exchange neighbours. Each exchange of a lower with an upper end begins or ends an overlap. A frame performs
// the events that are due, and tests the triangles of the leaves that overlap; it reads no tree. The boxes
// are linear over a segment, so two ends exchange their places at most once, and no event changes a realiser.
//
// When it wins: not observed yet. The tablecloth of 65k triangles has 188,000 exchanges a frame at l = 10, of
// which 24 change the set of pairs. An exchange takes 22 ns by events, 4 ns by sorting at each frame; the
// result is a thirtieth of the speed of `bottom_up` (a seventh by sorting; at l = 100 a sixth and a third).
// Exchanges grow with the square of the number of boxes, so large leaves are best, and a list of all overlaps
// on one axis, or of single triangles, is out of the question. At l = 100 it is 1.6 times as fast as `sweep`;
// at l = 10 it takes four times as long.
//
// A body that shrinks to a point makes quadratically many exchanges: every box then overlaps every other one,
// so each lower end passes each upper end.
#include <algorithm>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/sweep/kinetic_overlaps.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

template <class S>
class KineticSweep final : public CountedStrategy<S>, public AnswersSelfPairs, public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  KineticSweep(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
               const Params& params)
      : CountedStrategy<S>(scene, motion),
        kept_(params.word("order") == "events" ? KeptBy::events : KeptBy::sorting),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), LinearSettings{}),
        stale_(scene.body_count()),
        takes_part_(scene.body_count(), 0),
        updates_(scene.body_count()) {
    std::vector<std::uint32_t> body_of;
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      const WideHierarchy<S>& hierarchy = bounds_.hierarchy(body);
      stale_[body].resize(hierarchy.node_count());
      first_box_.push_back(std::uint32_t(body_of.size()));
      const std::size_t scalars = lane_scalars(hierarchy.topology().width);
      for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
        if (!hierarchy.topology().nodes[node].is_leaf()) continue;
        const std::size_t place = hierarchy.row_place(node, 0);
        nodes_.push_back(node);
        slots_.push_back({LeafSlot::of(std::uint32_t(place / scalars), std::uint32_t(place % scalars))});
        body_of.push_back(body);
      }
    }
    first_box_.push_back(std::uint32_t(body_of.size()));
    overlaps_.assign(std::move(body_of), scene.body_count(), scene.pairs());
    starts_.resize(scene.pairs().size() + 1);
  }

  void reset_to(double t) override {
    bounds_.start();
    started_ = false;
    begin_segment(t);
  }
  void advance_to(double t) override {
    if (bounds_.advance()) {
      begin_segment(t);
    } else {
      bring_to(t);
    }
  }
  void follow_plans(double t, std::span<const PlanChange<S>> /*changes*/) override {
    bounds_.plans_changed();
    begin_segment(t);
  }

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    sort_by_bodies();
    for (std::uint32_t i = 0; i < this->scene_.pairs().size(); ++i) {
      const BodyPair pair = this->scene_.pairs()[i];
      const bool within = pair.first == pair.second;
      if (starts_[i] == starts_[i + 1] && !within) continue;
      leaves_.clear();
      for (std::uint32_t k = starts_[i]; k < starts_[i + 1]; ++k) {
        leaves_.push_back(slots_[sorted_[k].a]);
        leaves_.push_back(slots_[sorted_[k].b]);
      }
      for (std::uint32_t box = first_box_[pair.first]; within && box < first_box_[pair.first + 1]; ++box)
        leaves_.insert(leaves_.end(), 2, slots_[box]);
      make_rows(pair.second, t);
      query_.run_leaves({.hierarchy = &bounds_.hierarchy(pair.first), .body = pair.first},
                        {.hierarchy = &bounds_.hierarchy(pair.second), .body = pair.second}, leaves_, out,
                        tests);
    }
    this->count_.add(Counter::box_tests, tests);
    leaf_pairs_ += overlaps_.set().pairs().size();
    return {};
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return bounds_.audit_view(body, this->time());
  }

  std::size_t bytes() const override {
    std::size_t total =
        bounds_.bytes() + overlaps_.bytes() + query_.bytes() + sorted_.capacity() * sizeof(BoxPairSet::Pair) +
        (leaves_.capacity() + slots_.capacity()) * sizeof(LeafSlot) +
        (first_box_.capacity() + nodes_.capacity() + members_.capacity() + starts_.capacity()) *
            sizeof(std::uint32_t) +
        takes_part_.capacity();
    for (const auto& marks : stale_) total += marks.size();
    return total;
  }

 protected:
  void counts_cleared() override {
    updates_.skip(bounds_);
    leaf_pairs_ = starts_over_ = start_tests_ = 0;
    before_ = counts_now();
  }
  void add_counts(Counters& table) const override {
    updates_.add_to(table, bounds_);
    const Counts now = counts_now();
    table[Counter::certificates_made] += now.certificates - before_.certificates;
    table[Counter::certificates_failed] += now.swaps - before_.swaps;
    table[Counter::overlap_events] += now.meetings - before_.meetings;
    table[Counter::leaves_apart_events] += now.separations - before_.separations;
    table[Counter::box_tests] += start_tests_;
    table.add("sweep_swaps", now.swaps - before_.swaps);
    table.add("sweep_lower_with_upper", now.exchanges - before_.exchanges);
    table.add("sweep_exact_decisions", now.exact - before_.exact);
    table.add("sweep_leaf_pairs", leaf_pairs_);
    table.add("sweep_starts", starts_over_);
  }

 private:
  struct Counts {
    std::uint64_t swaps = 0, certificates = 0, exact = 0, exchanges = 0, meetings = 0, separations = 0;
  };
  Counts counts_now() const {
    Counts counts;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      counts.swaps += overlaps_.order(axis).swaps();
      counts.certificates += overlaps_.order(axis).certificates();
      counts.exact += overlaps_.order(axis).exact_decisions();
    }
    counts.exchanges = overlaps_.exchanges();
    counts.meetings = overlaps_.meetings();
    counts.separations = overlaps_.separations();
    return counts;
  }

  /// Takes the ends of the segment that contains t. Bodies that meet no other body in the segment take no
  /// part: they have no boxes of leaves, and no pairs.
  void begin_segment(double t) {
    for (std::uint32_t body = 0; body < takes_part_.size(); ++body) {
      const bool takes_part = !bounds_.side(body).apart && !bounds_.hierarchy(body).empty();
      started_ = started_ && takes_part == (takes_part_[body] != 0);
      takes_part_[body] = takes_part;
      if (takes_part) take_ends(body);
    }
    if (!started_ || !overlaps_.renew()) {
      members_.clear();
      for (std::uint32_t body = 0; body < takes_part_.size(); ++body)
        for (std::uint32_t box = first_box_[body]; takes_part_[body] && box < first_box_[body + 1]; ++box)
          members_.push_back(box);
      start_tests_ += overlaps_.start(members_);
      ++starts_over_;
      started_ = true;
    }
    overlaps_.start_segment(bounds_.begin(), bounds_.end(), kept_);
    bring_to(t);
  }
  void take_ends(std::uint32_t body) {
    const BodySegmentBounds<S>& side = bounds_.side(body);
    for (std::uint32_t box = first_box_[body]; box < first_box_[body + 1]; ++box) {
      const Box<S> first = side.box_at(0, nodes_[box]), last = side.box_at(1, nodes_[box]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        overlaps_.order(axis).line(2 * box) = {side.widened_down(first.lower[axis]),
                                               side.widened_down(last.lower[axis])};
        overlaps_.order(axis).line(2 * box + 1) = {side.widened_up(first.upper[axis]),
                                                   side.widened_up(last.upper[axis])};
      }
    }
  }
  void bring_to(double t) {
    overlaps_.advance(t);
    for (std::uint32_t body = 0; body < takes_part_.size(); ++body) {
      bounds_.hierarchy(body).positions_changed();
      std::fill(stale_[body].begin(), stale_[body].end(), 1);
    }
  }

  /// Sorts the pairs of leaves by pairs of bodies. O(pairs of leaves + pairs of bodies).
  void sort_by_bodies() {
    const auto pairs = overlaps_.set().pairs();
    std::fill(starts_.begin(), starts_.end(), 0);
    sorted_.resize(pairs.size());
    if (starts_.size() == 2) {
      std::copy(pairs.begin(), pairs.end(), sorted_.begin());
      starts_[1] = std::uint32_t(pairs.size());
      return;
    }
    for (const BoxPairSet::Pair& pair : pairs) ++starts_[overlaps_.body_pair(pair)];
    std::uint32_t total = 0;
    for (std::uint32_t& start : starts_) start = total += start;
    for (const BoxPairSet::Pair& pair : pairs) sorted_[--starts_[overlaps_.body_pair(pair)]] = pair;
  }
  /// Computes the boxes of those leaves of the second body that occur in the current pairs.
  void make_rows(std::uint32_t body, double t) {
    WideHierarchy<S>& hierarchy = bounds_.hierarchy(body);
    if (hierarchy.padded_leaf_size() == 1) return;
    const WideMoment<S> moment{hierarchy.arrays(), bounds_.side(body).ends(), stale_[body].data(),
                               bounds_.fraction(t)};
    const auto make = wide_linear_kernels<S>(hierarchy.kernels()).make(hierarchy.width());
    for (std::size_t k = 1; k < leaves_.size(); k += 2) {
      const std::uint32_t node = leaves_[k].node();
      if (stale_[body][node] == 0) continue;
      make(moment, node);
      stale_[body][node] = 0;
    }
  }

  KeptBy kept_;
  LinearBounds<S> bounds_;
  KineticOverlaps<S> overlaps_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  std::vector<std::vector<std::uint8_t>> stale_;  ///< [body][wide node]
  std::vector<std::uint8_t> takes_part_;          ///< [body]
  std::vector<std::uint32_t> first_box_;          ///< [body, and one more]
  std::vector<std::uint32_t> nodes_;              ///< [box]: leaf of its body's topology
  std::vector<LeafSlot> slots_;                   ///< [box]
  std::vector<std::uint32_t> members_;            ///< boxes in the lists
  std::vector<std::uint32_t> starts_;             ///< [pair of bodies, and one more]: its first in `sorted_`
  std::vector<BoxPairSet::Pair> sorted_;
  std::vector<LeafSlot> leaves_;
  LinearCounts<S> updates_;
  bool started_ = false;
  std::uint64_t leaf_pairs_ = 0, starts_over_ = 0, start_tests_ = 0;
  Counts before_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_sweep) {
  using namespace kbvh;
  return {make_entry<KineticSweep>({
      .id = "kinetic_sweep",
      .title = "kinetic sweep and prune",
      .family = "kinetic",
      .citation = "Coming & Staadt 2006; Basch, Guibas & Hershberger 1999; Baraff 1992",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .declares = {.event_driven = true, .continuous = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"order",
                      "events",
                      {"events", "sort"},
                      "how the lists are kept: by events, or sorted again at each frame by exchanges of "
                      "neighbours, the same list and the same swaps"}},
  })};
}
