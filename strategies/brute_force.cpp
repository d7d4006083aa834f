// No hierarchy: compares the box of every primitive with the box of every other. Any structure must be
// faster.

#include "core/contract/registry.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/probes.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

template <class S>
class BruteForce final : public CountedStrategy<S>,
                         public AnswersSelfPairs,
                         public AnswersSweeps<S>,
                         public AnswersProbes<S>,
                         public TakesPlanChanges<S>,
                         public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  BruteForce(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies /*topologies*/,
             const Params& /*params*/)
      : CountedStrategy<S>(scene, motion), boxes_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      boxes_[body].resize(scene.primitives(body).count());
  }

  void reset_to(double /*t*/) override { update(); }

  void advance_to(double /*t*/) override { update(); }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    for (const BodyPair& pair : this->scene_.pairs()) {
      const auto &a = boxes_[pair.first], &b = boxes_[pair.second];
      for (std::uint32_t i = 0; i < a.size(); ++i) {
        if (tests >= budget.box_tests) {
          status.pending += a.size() - i;
          break;
        }
        const std::uint32_t first = pair.first == pair.second ? i + 1 : 0;
        for (std::uint32_t j = first; j < b.size(); ++j)
          if (overlap(a[i], b[j]) && !(first != 0 && neighbours(pair.first, i, j)))
            out.push_back({pair.first, i, pair.second, j});
        tests += b.size() - first;
      }
    }
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                        PairBuffer& out) override {
    std::vector<std::vector<Box<S>>> swept(boxes_.size());
    for (std::uint32_t body = 0; body < boxes_.size(); ++body) {
      const Primitives& primitives = this->scene_.primitives(body);
      this->count_.add(Counter::values_written, std::uint64_t(6) * primitives.count());
      this->count_.add(Counter::vertex_reads, 2 * primitives.vertices.size());
      for (std::uint32_t p = 0; p < primitives.count(); ++p) {
        Box<S> box = primitive_box(primitives[p], before[body]);
        box.extend(primitive_box(primitives[p], this->sampled_.positions(body)));
        swept[body].push_back(primitives.alive(p) ? box : Box<S>{});
      }
    }
    std::uint64_t tests = 0;
    for (const BodyPair& pair : this->scene_.pairs())
      for (std::uint32_t i = 0; i < swept[pair.first].size(); ++i)
        for (std::uint32_t j = pair.first == pair.second ? i + 1 : 0; j < swept[pair.second].size();
             ++j, ++tests)
          if (overlap(swept[pair.first][i], swept[pair.second][j]))
            out.push_back({pair.first, i, pair.second, j});
    this->count_.add(Counter::box_tests, tests);
  }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::visit(
        [&](const auto& asked) {
          for (std::size_t i = 0; i < asked.size(); ++i) {
            auto search = asked.search(i);
            bool over = false;
            for (std::uint32_t body = 0; body < boxes_.size() && !over; ++body)
              if (asked.meets(this->scene_.primitives(body).kind)) over = follow(body, search);
            asked.take(i, search);
          }
        },
        probes);
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> /*changes*/) override {}

  void follow_geometry(double /*t*/, const GeometryChange<S>& /*change*/) override { update(); }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const auto& boxes : boxes_) total += boxes.size() * sizeof(Box<S>);
    return total;
  }

 private:
  template <class Search>
  bool follow(std::uint32_t body, Search& search) {
    const Primitives& primitives = this->scene_.primitives(body);
    const auto boxes = search.box_test();
    this->count_.add(Counter::box_tests, boxes_[body].size());
    double near = 0;
    for (std::uint32_t p = 0; p < boxes_[body].size(); ++p)
      if (primitives.alive(p) && boxes.meet(boxes_[body][p], search.limit(), near) &&
          search.offer(body, p, primitives.triangles(p), this->sampled_.positions(body),
                       this->triangle_stats_))
        return true;
    return false;
  }
  bool neighbours(std::uint32_t body, std::uint32_t i, std::uint32_t j) const {
    const Primitives& primitives = this->scene_.primitives(body);
    return share_vertex(primitives[i], primitives[j]);
  }

  void update() {
    for (std::uint32_t body = 0; body < boxes_.size(); ++body) {
      const Primitives& primitives = this->scene_.primitives(body);
      boxes_[body].resize(primitives.count());
      // Removed primitives have the empty box, which overlaps nothing.
      for (std::uint32_t p = 0; p < primitives.count(); ++p)
        boxes_[body][p] =
            primitives.alive(p) ? primitive_box(primitives[p], this->sampled_.positions(body)) : Box<S>{};
      this->count_.add(Counter::values_written, std::uint64_t(6) * primitives.count());
      this->count_.add(Counter::vertex_reads, primitives.vertices.size());
    }
  }

  std::vector<std::vector<Box<S>>> boxes_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(brute_force) {
  using namespace kbvh;
  return {make_entry<BruteForce>({
      .id = "brute_force",
      .title = "brute force",
      .family = "oracle",
      .citation = "all pairs",
      .tightness = Tightness::none,
      .declares = {.time_budget = true},
      .topology = {.own = true},
      .max_primitive_pairs = 100'000'000,
  })};
}
