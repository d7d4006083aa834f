#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/contract/reports_work.hpp"
#include "core/contract/strategy.hpp"
#include "core/families/drift/drift_body.hpp"
#include "core/families/drift/drift_model.hpp"
#include "core/families/drift/drift_probes.hpp"
#include "core/families/drift/near_pairs.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/families/wide/kernels/bounds.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/geometry/predicates.hpp"

namespace kbvh {

/// Boxes and lists that last several frames, for bodies whose positions come frame by frame
/// (strategies/drift_boxes.cpp). `Motion`: SampledMotion, displacements are read at each vertex, or
/// SteppedMotion, they are bounded per body.
template <class S, class Motion>
class DriftStrategy : public CountedStrategy<S>,
                      public AnswersSelfPairs,
                      public AnswersProbes<S>,
                      public TakesPlanChanges<S>,
                      public ReportsWork {
  using Body = DriftBody<S>;
  using Watch = typename Body::Watch;
  static constexpr bool bounded = std::is_same_v<Motion, SteppedMotion<S>>;

 public:
  DriftStrategy(const SceneView<S>& scene, const Motion& motion, Topologies topologies, const Params& params)
      : CountedStrategy<S>(scene, motion),
        motion_(motion),
        kernels_(active_kernel_set()),
        lists_(params.word("lists") == "never" ? Lists::never : Lists::tuned),
        checks_(params.word("candidates") == "boxes"),
        hierarchies_(scene.body_count()),
        bodies_(scene.body_count()),
        rows_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()),
        pair_is_near_(scene.pairs().size(), 0) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      hierarchies_[body].assign(std::move(topologies[body]), scene.primitives(body), kernels_);
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchies_[body]; });
  }

  void reset_to(double /*t*/) override {
    model_ = {};
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      body.changed = body.widened = false;
      body.bounded = bounded;
      body.near = true;
      std::fill_n(body.rate_low, 3, 0.0);
      std::fill_n(body.rate_high, 3, 0.0);
      body.watch = may_move(index) ? Watch::drift : Watch::nothing;
      make_boxes(index);
      body.leaf_size = usual_leaf_side(hierarchies_[index], sides_);
      remember(index);
    }
    // A body that rests again may have been moved by its own plans before.
    for (auto& rows : rows_) rows.positions_changed();
    near_bodies_.start_over();
    // Lists the pairs that meet at this frame, or all pairs if there are few; the next frame searches again.
    if (near_bodies_.searches()) {
      take_near([&](std::uint32_t body) { return bodies_[body].box; });
    } else {
      near_pairs_.resize(pair_is_near_.size());
      std::iota(near_pairs_.begin(), near_pairs_.end(), 0U);
      std::fill(pair_is_near_.begin(), pair_is_near_.end(), 1);
    }
    frames_ = 0;
    period_ = 0;
    plain_left_ = 1;
    search_due_ = plans_changed_ = false;
    probes_.moved();
  }

  void advance_to(double t) override {
    const double last = this->previous_time();
    ++frames_;
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) observe(index, last, t);
    listed() ? advance_listed() : advance_plain();
    count_skipped();
    probes_.moved();
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    std::uint64_t tests = 0;
    const std::size_t before = out.size();
    if (search_due_) search(tests);
    for (std::size_t k = 0; k < near_pairs_.size(); ++k) {
      const BodyPair pair = this->scene_.pairs()[near_pairs_[k]];
      if (listed())
        tests += read(lists_of_[k], pair, out);
      else
        query_.run({&hierarchies_[pair.first], pair.first}, {&hierarchies_[pair.second], pair.second}, out,
                   tests);
    }
    if (!listed()) model_.queried(double(tests), double(out.size() - before));
    last_box_tests_ = tests;
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  void answer_probes(double /*t*/, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    probes_.answer(hierarchies_, bodies_, listed(), probes, this->triangle_stats_, tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    probes_.moved();
    for (const PlanChange<S>& change : changes) {
      Body& body = bodies_[change.body];
      body.changed = true;
      if (body.watch != Watch::nothing || hierarchies_[change.body].empty()) continue;
      body.watch = bounded ? Watch::drift : Watch::box;  // at rest so far
      body.widened = false;
      plans_changed_ = true;
    }
    if constexpr (bounded)
      for (Body& body : bodies_)
        if (body.changed) body.plans_changed();
  }

  std::optional<AuditView> audit_view(std::uint32_t index) const override {
    const Body& body = bodies_[index];
    const auto& hierarchy = hierarchies_[index];
    AuditView view{hierarchy.topology(), {}, {}};
    const StoredBoxes stored = stored_boxes(body, listed());
    for (std::uint32_t node = 0; node < view.topology.size(); ++node) {
      const Box<double> box = to_double(hierarchy.box(node));
      view.boxes.push_back(stored == StoredBoxes::old ? body.moved_on(box) : box);
    }
    if (stored != StoredBoxes::unknown || view.boxes.empty()) return view;
    view.stale.assign(view.boxes.size(), 1);
    view.boxes[0] = body.box;
    view.stale[0] = 0;
    return view;
  }

  std::uint64_t last_box_tests() const override { return last_box_tests_; }

  std::size_t bytes() const override {
    std::size_t total = query_.bytes();
    for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
    for (const auto& body : bodies_) total += body.before.capacity() * sizeof(S);
    for (const auto& lists : lists_of_) total += lists.bytes();
    for (const auto& rows : rows_) total += rows.bytes();
    return total + work_.bytes() + probes_.bytes() + near_bodies_.bytes() + pair_is_near_.size() +
           near_pairs_.capacity() * sizeof(std::uint32_t) + sides_.capacity() * sizeof(double);
  }

 protected:
  double believed_ = 1;  ///< share of the bound on steps that is assumed

 private:
  enum class Lists : std::uint8_t { tuned, never };

  bool may_move(std::uint32_t index) const {
    return (this->scene_.moving(index) || bodies_[index].changed) && !hierarchies_[index].empty();
  }

  // ---- Reads per frame

  void observe(std::uint32_t index, double last, double t) {
    Body& body = bodies_[index];
    body.read = body.remade = false;
    if (body.watch == Watch::nothing) return;
    if constexpr (bounded) {
      const double way = believed_ * motion_.displacement_bound(index, last, t);
      if (way > 0) body.moved_by_at_most(way);
    } else if (listed() || plain_left_ <= 1 || !body.near) {
      if (body.watch == Watch::box) {
        const Box<double> before = body.box;
        take_box(index);
        body.box_moved_from(before);
      } else {
        read_drift(index);
      }
    }
  }
  void count_skipped() {
    std::uint64_t nodes = 0, skipped = 0;
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      const Body& body = bodies_[index];
      if (body.remade) continue;
      nodes += hierarchies_[index].topology().size();
      if (body.watch == Watch::nothing || (!body.near && !body.read)) ++skipped;
    }
    this->count_.add(Counter::nodes_skipped, nodes);
    this->count_.add(Counter::bodies_skipped, skipped);
  }

  /// Computes the box of all current vertices.
  void take_box(std::uint32_t index) {
    this->sampled_.fetch_all(index);
    const VertexRun all{0, this->scene_.vertex_count(index)};
    S box[8];
    bounds_kernels<S>(kernels_).of_runs(&all, 1, this->sampled_.positions(index), box);
    for (int axis = 0; axis < 3; ++axis) {
      bodies_[index].box.lower[axis] = double(box[axis]);
      bodies_[index].box.upper[axis] = double(box[axis + 4]);
    }
    this->count_.add(Counter::vertex_reads, all.count);
  }

  void read_drift(std::uint32_t index) {
    Body& body = bodies_[index];
    const std::uint32_t count = this->scene_.vertex_count(index);
    S interval[8];
    near_kernels<S>(kernels_).drift(this->sampled_.positions(index), body.before.data(), count, interval);
    body.drifted_by(interval, frames_);
    body.read = true;
    this->count_.add(Counter::vertex_reads, 2 * std::uint64_t(count));
  }

  // ---- Two states: listed frames read the lists of one search, plain frames refit and query. The transition
  // chooses the next state from the last observations (DriftModel).

  bool listed() const { return period_ > 0; }

  /// Keeps boxes and lists as long as they are valid.
  void advance_listed() {
    const bool valid = !search_due_ && !plans_changed_ && covered();
    plans_changed_ = false;
    if (!valid) change_state();
  }
  /// Makes new boxes at every frame until lists are to be tried again.
  void advance_plain() {
    plans_changed_ = false;
    if (--plain_left_ > 0) {
      // Remembers the frame before lists are tried again, so that there is a motion to measure.
      for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
        if (!bodies_[index].near || bodies_[index].watch == Watch::nothing) continue;
        make_boxes(index);
        if (plain_left_ == 1) remember(index);
      }
      if (!meets_newly()) return;
    }
    change_state();
  }

  void change_state() {
    choose_state();
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) set_margin(index);
    find_near();
    if (bounded && take_late_boxes()) find_near();
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) enter_state(index);
    frames_ = 0;
    search_due_ = listed();
  }
  void choose_state() {
    if (lists_ == Lists::tuned && (listed() || plain_left_ <= 0)) {
      period_ = model_.period(step());
      plain_left_ = listed() ? 0 : model_.rest();
    }
    if (lists_ == Lists::never) plain_left_ = std::numeric_limits<int>::max();
    for (const Body& body : bodies_)
      for (int axis = 0; axis < 3; ++axis)
        if (!(std::abs(body.rate_low[axis]) + std::abs(body.rate_high[axis]) <
              double(admissible_magnitude<S>) / 1024))
          period_ = 0;
    if (!listed()) plain_left_ = std::max(plain_left_, 1);
  }
  void enter_state(std::uint32_t index) {
    Body& body = bodies_[index];
    if (!may_move(index)) {
      if (listed() && body.near && !body.widened) widen(index);
      return;
    }
    if (!body.near) {
      body.watch = bounded ? Watch::drift : Watch::box;
      return;
    }
    body.watch = Watch::drift;
    make_boxes(index);
    if (!listed() && plain_left_ > 1) return;
    remember(index);
    if (listed()) widen(index);
  }

  bool covered() {
    for (const std::uint32_t i : near_pairs_)
      if (!keeps_to_reach(bodies_[this->scene_.pairs()[i].first], bodies_[this->scene_.pairs()[i].second]))
        return false;
    return !meets_newly();
  }
  bool meets_newly() {
    const auto box_of = [&](std::uint32_t body) {
      return hierarchies_[body].empty() ? Box<double>{} : bodies_[body].box;
    };
    std::uint64_t tests = 0;
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair pair = this->scene_.pairs()[i];
      if (pair_is_near_[i] == 0 && overlap(bodies_[pair.first].box, bodies_[pair.second].box)) return true;
    }
    return false;
  }
  /// Finds the near pairs of bodies: those with overlapping boxes, given by box_of(body).
  template <class BoxOf>
  void take_near(const BoxOf& box_of) {
    for (const std::uint32_t i : near_pairs_) pair_is_near_[i] = 0;
    near_pairs_.clear();
    const auto box_or_none = [&](std::uint32_t body) {
      return hierarchies_[body].empty() ? Box<double>{} : box_of(body);
    };
    std::uint64_t tests = 0;
    for (const std::uint32_t i : near_bodies_.find(box_or_none, tests)) {
      const BodyPair pair = this->scene_.pairs()[i];
      if (hierarchies_[pair.first].empty() || hierarchies_[pair.second].empty() ||
          !overlap(box_of(pair.first), box_of(pair.second)))
        continue;
      pair_is_near_[i] = 1;
      near_pairs_.push_back(i);
    }
  }

  /// Computes the actual boxes of bodies that would only be near if they moved as far as possible. Returns
  /// whether there were any.
  bool take_late_boxes() {
    bool any = false;
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      Body& body = bodies_[index];
      if (!body.near || !(body.moved > 0)) continue;
      take_box(index);
      body.box_then = body.box;
      body.stand();
      any = true;
    }
    return any;
  }

  /// Returns the largest `step_of` over all pairs of bodies, or, as a bound, over each body paired with its
  /// equal.
  double step() const {
    double largest = 0;
    if (near_bodies_.searches())
      for (const Body& body : bodies_) largest = std::max(largest, step_of(body, body));
    else
      for (const BodyPair& pair : this->scene_.pairs())
        largest = std::max(largest, step_of(bodies_[pair.first], bodies_[pair.second]));
    return largest;
  }

  void set_margin(std::uint32_t index) {
    Body& body = bodies_[index];
    if (body.widened) return;  // a body at rest
    body.set_margin(may_move(index) ? 1.0625 * period_ : 0);
  }

  /// Finds bodies that may meet while they stay within their margins.
  void find_near() {
    take_near([&](std::uint32_t body) { return bodies_[body].swept(); });
    for (Body& body : bodies_) body.near = false;
    for (const std::uint32_t i : near_pairs_)
      bodies_[this->scene_.pairs()[i].first].near = bodies_[this->scene_.pairs()[i].second].near = true;
  }

  void make_boxes(std::uint32_t index) {
    Body& body = bodies_[index];
    auto& hierarchy = hierarchies_[index];
    if (hierarchy.empty()) return;
    this->sampled_.fetch_all(index);
    hierarchy.positions_changed();
    hierarchy.refit(this->sampled_.positions(index));
    body.remade = true;
    body.box = body.box_then = to_double(hierarchy.box(0));
    body.stand();
    count_boxes(this->count_, hierarchy.topology().size(), hierarchy.leaf_vertex_count());
  }
  void remember(std::uint32_t index) {
    if (bounded || !may_move(index)) return;
    const S* positions = this->sampled_.positions(index);
    bodies_[index].before.assign(positions, positions + std::size_t(3) * this->scene_.vertex_count(index));
    frames_ = 0;
  }
  void widen(std::uint32_t index) {
    auto& hierarchy = hierarchies_[index];
    near_kernels<S>(kernels_).widen(hierarchy.topology().width)(
        hierarchy.arrays(), hierarchy.node_count(), bodies_[index].margin, bodies_[index].rounding());
    bodies_[index].widened = !may_move(index);
  }

  /// Appends the candidates of two bodies from their list; returns the box tests made.
  std::uint64_t read(const NearPairs<S>& lists, const BodyPair& pair, PairBuffer& out) {
    // At the frame of the search the list starts with exactly the overlapping pairs.
    const double fraction = frames_ == 0 ? 0 : used_reach(bodies_[pair.first], bodies_[pair.second]);
    if (!checks_ || frames_ == 0) {
      lists.read(fraction, out);
      return 0;
    }
    return lists.read_meeting(fraction, now(pair.first), now(pair.second), work_, out);
  }
  PrimitivesNow<S> now(std::uint32_t index) const {
    const Primitives& primitives = this->scene_.primitives(index);
    return {primitives.offsets.data(), primitives.vertices.data(), this->sampled_.positions(index)};
  }

  void search(std::uint64_t& tests) {
    std::uint64_t made = 0;
    DriftCounts counts;
    if (lists_of_.size() < near_pairs_.size()) lists_of_.resize(near_pairs_.size());
    for (std::uint32_t index = 0; index < bodies_.size(); ++index)
      if (may_move(index)) rows_[index].positions_changed();
    for (std::size_t k = 0; k < near_pairs_.size(); ++k) {
      const BodyPair pair = this->scene_.pairs()[near_pairs_[k]];
      const Body &a = bodies_[pair.first], &b = bodies_[pair.second];
      S within[6];
      double mean = 0;
      for (std::size_t face = 0; face < 6; ++face) {
        within[face] = reach(a, b, face);
        mean += double(within[face]) / 6;
      }
      NearPairs<S>& lists = lists_of_[k];
      lists.build(side(pair.first), side(pair.second), pair.first, pair.second, within, work_, made);
      counts.overlapping += double(lists.overlapping());
      counts.listed += double(lists.count());
      const double size = a.leaf_size + b.leaf_size;
      if (size > 0) counts.reach = std::max(counts.reach, mean / size);
    }
    for (std::uint32_t index = 0; index < bodies_.size(); ++index) {
      if (!bodies_[index].near || !may_move(index)) continue;
      counts.reads += double(hierarchies_[index].leaf_vertex_count());
      counts.vertices += double(this->scene_.vertex_count(index));
    }
    counts.tests = double(made);
    model_.searched(counts, period_, bounded ? DriftModel::Watching::free : DriftModel::Watching::reads);
    tests += made;
    search_due_ = false;
  }
  NearSide<S> side(std::uint32_t index) {
    return {&hierarchies_[index], this->sampled_.positions(index), bodies_[index].margin,
            &rows_[index],        bodies_[index].rounding(),       &this->scene_.primitives(index)};
  }

  Motion motion_;
  KernelSet kernels_;
  Lists lists_;
  bool checks_;
  std::vector<WideHierarchy<S>> hierarchies_;
  std::vector<Body> bodies_;
  std::vector<NearLeafRows<S>> rows_;  ///< by body
  NearBodies near_bodies_;
  std::vector<std::uint32_t> near_pairs_;  ///< of bodies: indices into the scene's, ascending
  std::vector<std::uint8_t> pair_is_near_;
  std::vector<NearPairs<S>> lists_of_;  ///< [near pair]; never shrinks
  NearWork<S> work_;
  std::vector<double> sides_;  ///< of the leaves of a body, at a reset
  WideQuery<S> query_{this->scene_, this->sampled_};
  DriftProbes<S> probes_{this->scene_, this->sampled_};
  DriftModel model_;
  int frames_ = 0;      ///< since positions were remembered
  int period_ = 0;      ///< frames that one search lasts; 0: refit and query at every frame
  int plain_left_ = 0;  ///< number of such frames until lists are tried again
  bool search_due_ = false, plans_changed_ = false;
  std::uint64_t last_box_tests_ = 0;
};

}  // namespace kbvh
