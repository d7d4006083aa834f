// Refit until the tree has drifted, then rebuild (Lauterbach, Yoon & Manocha 2006). A rebuild here sorts the
// primitives by medians into the existing leaves, so that nothing is allocated and nodes stay in place. By
// default a tree is rebuilt when its queries have made as many box tests beyond those of a new tree as a
// rebuild is worth: where bodies are apart, an old tree costs nothing, and stays.
//
// When it wins: against a refit, wherever a tree ages within a clip and queries notice it (plan `ageing`).
// Where nothing ages it costs as much as a refit. A frame that rebuilds takes longest: `spread` divides its
// sort among several frames, but queries meet the old tree meanwhile, and in scenes that age within a few
// frames that costs more than it saves. Where a tree lasts longer, this is faster than `lbvh_drift`, whose
// builds take an eighth of the time, but whose refits and searches take longer (plan `auto`, l = 10).

#include "core/contract/registry.hpp"
#include "core/families/restructure/leaf_strategy.hpp"
#include "core/families/wide/surface_sums.hpp"

namespace kbvh {
namespace {

/// The measure of how far a tree has drifted.
enum class Measure : std::uint8_t {
  work,     ///< box tests of the queries beyond those of the new tree
  surface,  ///< surfaces of its boxes over that of the root
};

template <class S>
class DriftRebuild final : public LeafStrategy<S> {
  using Base = LeafStrategy<S>;
  using Body = typename Base::Body;

 public:
  static constexpr Foresight foresight = Foresight::none;
  DriftRebuild(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        measure_(params.word("measure") == "work" ? Measure::work : Measure::surface),
        drift_(params.number("drift")),
        price_(params.number("price")),
        frames_(std::uint64_t(params.number("spread"))),
        sorted_at_start_(params.word("start") == "sorted"),
        fresh_(scene.body_count(), unknown) {}

  void reset_to(double t) override {
    Base::reset_to(t);
    std::fill(fresh_.begin(), fresh_.end(), unknown);
    if (sorted_at_start_)
      for (std::uint32_t body = 0; body < fresh_.size(); ++body)
        if (this->hierarchies_[body].topology().size() > 1) sort(body, MedianSort::unlimited);
    if (measure_ == Measure::surface)
      for (std::uint32_t body = 0; body < fresh_.size(); ++body)
        fresh_[body] = surface_ratio(this->hierarchies_[body]);
  }

  std::size_t bytes() const override { return Base::bytes() + fresh_.capacity() * sizeof(double); }

 private:
  static constexpr double unknown = -1;

  void topology_changed(std::uint32_t index) override {
    Base::topology_changed(index);
    fresh_[index] = unknown;
  }

  void update(std::uint32_t index) override {
    Body& body = this->bodies_[index];
    auto& hierarchy = this->hierarchies_[index];
    this->refit_counted(index);
    const double surplus = body.age.end_frame();
    if (!body.contents.in_parts() && !is_due(index, surplus)) return;
    const std::uint64_t work =
        frames_ == 1 ? MedianSort::unlimited : 1 + work_of(hierarchy.topology()) / frames_;
    if (!sort(index, work)) return;
    body.age.renew();
    if (measure_ == Measure::surface) fresh_[index] = surface_ratio(hierarchy);
  }

  /// Sorts for as long as `work` lasts. Returns whether the new tree is complete.
  bool sort(std::uint32_t index, std::uint64_t work) {
    if (!this->bodies_[index].contents.sort_in_parts(
            this->hierarchies_[index], this->scene_.primitives(index), this->sampled_.positions(index), work))
      return false;
    ++rebuilds_;
    this->refit_counted(index);
    return true;
  }

  bool is_due(std::uint32_t index, double surplus) {
    auto& hierarchy = this->hierarchies_[index];
    if (hierarchy.topology().size() < 2) return false;
    if (measure_ == Measure::work) return surplus > price_ * double(hierarchy.topology().primitives.size());
    const double ratio = surface_ratio(hierarchy);
    double& fresh = fresh_[index];
    if (fresh == unknown || ratio < fresh) fresh = ratio;
    return ratio > drift_ * fresh;
  }

  /// Returns the work of a sort: the number of items times the number of binary levels.
  static std::uint64_t work_of(const Topology& topology) {
    std::uint64_t levels = 1;
    for (std::size_t leaves = topology.primitives.size() / topology.leaf_size; leaves > 1; leaves /= 2)
      ++levels;
    return levels * topology.primitives.size();
  }

  void counts_cleared() override { rebuilds_ = 0; }
  void add_counts(Counters& table) const override { table.add("rebuilds", rebuilds_); }

  Measure measure_;
  double drift_, price_;
  std::uint64_t frames_;
  bool sorted_at_start_;
  std::vector<double> fresh_;  // [body]: the new tree's surface ratio, with Measure::surface
  std::uint64_t rebuilds_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(drift_rebuild) {
  using namespace kbvh;
  return {make_entry<DriftRebuild>({
      .id = "drift_rebuild",
      .title = "refit, rebuild at drift",
      .family = "restructuring",
      .citation = "Lauterbach, Yoon & Manocha 2006",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters =
          {{"measure",
            "work",
            {"work", "surface"},
            "the measure of a tree's drift: the box tests of queries beyond those when it was new, "
            "summed over frames; or the surfaces of all boxes over that of the root"},
           {"price",
            "100",
            {},
            "for measure=work: surplus box tests per primitive from which on a rebuild pays",
            0,
            1e6},
           {"drift",
            "1.4",
            {},
            "for measure=surface: factor over the value of the new tree from which on it is rebuilt",
            1,
            1e6},
           {"start",
            "given",
            {"given", "sorted"},
            "the trees of the first frame: as they were built, or sorted by its positions"},
           {"spread",
            "1",
            {},
            "frames over which the sort of a rebuild is spread, on the positions of the first",
            1,
            1000,
            Numbers::whole}},
  })};
}
