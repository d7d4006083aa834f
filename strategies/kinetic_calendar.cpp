// The exact tight AABB tree for motion that changes at run time: each side of each box has a certificate, in
// a calendar of buckets by time. At each frame, the buckets give the sides that may have changed, level by
// level (core/families/envelope/calendar_tree.hpp).

#include "core/contract/registry.hpp"
#include "core/families/envelope/calendar_tree.hpp"
#include "core/families/envelope/realiser_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class KineticCalendar final : public RealiserStrategy<S>, public TakesPlanChanges<S> {
  using Base = RealiserStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  KineticCalendar(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                  const Params& /*params*/)
      : Base(scene, motion, std::move(topologies)) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      trees_.emplace_back(this->hierarchy(body), motion, body);
  }

  void reset_to(double /*t*/) override {
    this->near_bodies_.start_over();
    for (std::uint32_t body = 0; body < trees_.size(); ++body) {
      trees_[body].reset(this->hierarchy(body), this->bodies_[body].realisers);
      this->bodies_[body].rows.start_over();
      this->new_frame(body);
      trees_[body].clear_counts();
    }
  }

  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < trees_.size(); ++body)
      if (trees_[body].advance(this->hierarchy(body), this->bodies_[body].realisers)) this->new_frame(body);
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    body_changed_.assign(trees_.size(), 0);
    for (const PlanChange<S>& change : changes) body_changed_[change.body] = 1;
    for (std::uint32_t body = 0; body < trees_.size(); ++body) {
      if (body_changed_[body] != 0) {
        trees_[body].plans_changed(this->hierarchy(body), this->bodies_[body].realisers, changes);
        this->bodies_[body].rows.plans_changed();
      }
      this->new_frame(body);  // realisers may differ now
    }
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const auto& tree : trees_) total += tree.bytes();
    return total;
  }

 protected:
  void add_counts(Counters& table) const override {
    for (const auto& tree : trees_) {
      const CalendarCounts& counts = tree.counts();
      table[Counter::nodes_visited] += counts.sides;
      table[Counter::values_written] += counts.changes;
      table[Counter::vertex_reads] += counts.reads;
      table[Counter::certificates_made] += counts.certificates;
      table[Counter::certificates_failed] += counts.failed;
      table[Counter::internal_events] += counts.idle;
    }
  }

 private:
  std::vector<CalendarTree<S>> trees_;
  std::vector<std::uint8_t> body_changed_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_calendar) {
  using namespace kbvh;
  return {make_entry<KineticCalendar>({
      .id = "kinetic_calendar",
      .title = "kinetic AABB tree, calendar",
      .family = "kinetic",
      .citation =
          "kbvh; a calendar of certificates instead of the event queue of Zachmann & Weller 2006, s.4",
      .declares = {.event_driven = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
  })};
}
