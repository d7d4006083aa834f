// Bottom-up refit, the standard way to keep a hierarchy valid (van den Bergen 1997), in the fastest form
// known to us: wide nodes in a structure of arrays, each fitted to its unique vertices in padded lists
// (core/families/wide/kernels/wide_refit.cpp). It is the usual denominator of the printed ratios.

#include "core/contract/registry.hpp"
#include "core/families/wide/shared_query.hpp"
#include "core/families/wide/shared_refit.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

KernelSet chosen_kernels(const Params& params) {
  const std::string& word = params.word("kernels");
  return word == "auto" ? active_kernel_set() : kernel_set(word);
}

std::vector<std::string> kernel_words() {
  std::vector<std::string> words{"auto"};
  for (const KernelSet set : supported_kernel_sets()) words.push_back(name(set));
  return words;
}

template <class S>
class BottomUp final : public EditedHierarchyStrategy<S>, public AnswersSweeps<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  BottomUp(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
           const Params& params)
      : Base(scene, motion, std::move(topologies), params, chosen_kernels(params)) {
    if (!motion.workers().several()) return;
    shared_refit_.start();
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body)
      shared_refit_.add(this->hierarchies_[body], nullptr);
    shared_refit_.place(motion.workers(), this->hierarchies_);
  }

  void advance_to(double t) override {
    Workers& workers = this->sampled_.workers();
    if (!workers.several()) return Base::advance_to(t);
    shared_refit_.start();
    for (std::uint32_t body = 0; body < this->hierarchies_.size(); ++body) {
      if (!this->scene_.moving(body) && !this->plans_changed_) continue;
      this->hierarchies_[body].positions_changed();
      shared_refit_.add(this->hierarchies_[body], this->sampled_.positions(body));
      this->count_refit(body);
    }
    shared_refit_.run(workers);
  }

  /// A budget is spent in single-threaded order.
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) override {
    Workers& workers = this->sampled_.workers();
    if (!workers.several() || budget.box_tests != Budget{}.box_tests)
      return Base::find_candidates(t, out, budget);
    std::uint64_t tests = 0;
    shared_query_.start();
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      shared_query_.add(this->side(pair.first), this->side(pair.second));
    });
    shared_query_.run(workers, out, tests);
    this->count_.add(Counter::box_tests, tests);
    this->last_box_tests_ = tests;
    return {};
  }

  void confirm_candidates(double /*t*/, PairBuffer& pairs) override {
    shared_confirmation_.confirm(this->scene_, this->sampled_, pairs, this->triangle_stats_);
  }

  std::size_t bytes() const override {
    return Base::bytes() + shared_refit_.bytes() + shared_query_.bytes() + shared_confirmation_.bytes();
  }

  void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                        PairBuffer& out) override {
    this->sweep(before, out);
  }

 private:
  void update(std::uint32_t body) override { this->refit_counted(body); }

  SharedRefit<S> shared_refit_;
  SharedQuery<S> shared_query_{this->scene_, this->sampled_};
  SharedConfirmation<S> shared_confirmation_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up) {
  using namespace kbvh;
  return {make_entry<BottomUp>({
      .id = "bottom_up",
      .title = "bottom-up refit",
      .family = "refit",
      .citation = "van den Bergen 1997; Z&W 2006, s.2; wide nodes after Wald et al. 2008",
      .baseline = true,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"kernels", "auto", kernel_words(),
                      "instruction set of refit and query; auto: the widest that this machine supports"},
                     threads_parameter("positions, refit, query, rays and triangle tests")},
  })};
}
