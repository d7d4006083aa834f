// Refit until the tree has drifted, then rebuild (Lauterbach, Yoon & Manocha 2006).

#include "core/contract/registry.hpp"
#include "core/families/restructure/leaf_contents.hpp"
#include "core/families/restructure/surface_sums.hpp"
#include "core/families/restructure/tree_age.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

/// What says that a tree has drifted.
enum class Measure : std::uint8_t {
  work,     ///< box tests of the queries beyond those of the new tree
  surface,  ///< surfaces of its boxes over that of the root
};

template <class S, class Count>
class DriftRebuild final : public StoredHierarchyStrategy<S, Count>,
                           public AnswersSelfPairs,
                           public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  DriftRebuild(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
               const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        measure_(params.word("measure") == "work" ? Measure::work : Measure::surface),
        drift_(params.number("drift")),
        price_(params.number("price")),
        frames_(std::uint32_t(params.number("spread"))),
        bodies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) topology_changed(body);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      bodies_[body].contents.stop();
      bodies_[body].age = {};
      bodies_[body].fresh = measure_ == Measure::surface ? surface_ratio(this->hierarchies_[body]) : 0;
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      if (tests >= budget.box_tests) {
        ++status.pending;
        return;
      }
      const std::uint64_t tests_before = tests, found_before = out.size();
      status.pending +=
          this->query_
              .run(this->side(pair.first), this->side(pair.second), out, tests, rest_of(budget, tests))
              .pending;
      bodies_[pair.first].age.add(tests - tests_before, out.size() - found_before);
      if (pair.second != pair.first)
        bodies_[pair.second].age.add(tests - tests_before, out.size() - found_before);
    });
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + bodies_.capacity() * sizeof(Body);
    for (const Body& body : bodies_) total += body.contents.bytes();
    return total;
  }

 private:
  struct Body {
    LeafContents<S> contents;
    TreeAge age;
    double fresh = -1;       ///< surface ratio after the last rebuild; below 0: to be measured
    std::uint64_t work = 0;  ///< of a frame, while a rebuild runs
  };

  void topology_changed(std::uint32_t index) override {
    bodies_[index].contents.prepare(this->hierarchies_[index]);
    bodies_[index].age = {};
    bodies_[index].fresh = -1;
  }

  void update(std::uint32_t index) override {
    Body& body = bodies_[index];
    auto& hierarchy = this->hierarchies_[index];
    refit_counted(index);
    const double surplus = body.age.end_frame();
    if (!body.contents.in_parts()) {
      if (!is_due(body, hierarchy, surplus)) return;
      body.work = frames_ == 1 ? MedianSort::unlimited : work_of(hierarchy.topology()) / frames_ + 1;
    }
    if (!body.contents.sort_in_parts(hierarchy, this->scene_.primitives(index),
                                     this->sampled_.positions(index), body.work))
      return;
    ++rebuilds_;
    refit_counted(index);
    body.age.renew();
    if (measure_ == Measure::surface) body.fresh = surface_ratio(hierarchy);
  }

  bool is_due(Body& body, WideHierarchy<S>& hierarchy, double surplus) const {
    if (measure_ == Measure::work) return surplus > price_ * double(hierarchy.topology().primitives.size());
    const double ratio = surface_ratio(hierarchy);
    if (body.fresh < 0 || ratio < body.fresh) body.fresh = ratio;
    return ratio > drift_ * body.fresh;
  }

  /// Returns the work of a rebuild: its items times its binary levels.
  static std::uint64_t work_of(const Topology& topology) {
    std::uint64_t levels = 0;
    for (std::size_t leaves = topology.primitives.size() / topology.leaf_size; leaves > 1; leaves /= 2)
      ++levels;
    return levels * topology.primitives.size();
  }

  void refit_counted(std::uint32_t index) {
    auto& hierarchy = this->hierarchies_[index];
    this->refit(index);
    this->count_.add(Counter::nodes_visited, hierarchy.topology().size());
    this->count_.add(Counter::values_written, std::uint64_t(6) * hierarchy.topology().size());
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertex_count());
  }
  void counts_cleared() override { rebuilds_ = 0; }
  void add_counts(Counters& table) const override { table.add("rebuilds", rebuilds_); }

  Measure measure_;
  double drift_, price_;
  std::uint32_t frames_;
  std::vector<Body> bodies_;
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
            "what says that a tree has drifted: the box tests of queries beyond those when it was "
            "new, summed over frames; or the surfaces of all boxes over that of the root"},
           {"price",
            "100",
            {},
            "for measure=work: surplus box tests per primitive from which a rebuild pays",
            0,
            1e6},
           {"drift",
            "1.4",
            {},
            "for measure=surface: factor over the value of the new tree from which on it is rebuilt",
            1,
            1e6},
           {"spread",
            "1",
            {},
            "frames over which the sorting of a rebuild is spread, on the positions of the first",
            1,
            1000,
            Numbers::whole}},
  })};
}
