// Bottom-up refit, the standard way to keep a hierarchy valid (van den Bergen 1997), in the fastest form
// known to us: wide nodes as structure of arrays, over unique vertices in padded lists
// (core/families/wide/kernels/wide_refit.cpp). It is the usual denominator of the printed ratios.

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

#if defined(KBVH_WITH_TBB)
#include <tbb/global_control.h>
#include <tbb/parallel_for_each.h>
#include <tbb/task_arena.h>
#endif

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

/// A larger number would be cut to this one silently, and a result would name unused threads.
double most_threads() {
#if defined(KBVH_WITH_TBB)
  return double(std::min<std::size_t>(
      1024, tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)));
#else
  return 1;
#endif
}

template <class S, class Count>
class BottomUp final : public StoredHierarchyStrategy<S, Count>,
                       public AnswersSelfPairs,
                       public AnswersSweeps<S>,
                       public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  BottomUp(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
           const Params& params)
      : Base(scene, motion, std::move(topologies), params, chosen_kernels(params)),
        threads_(int(params.number("threads"))) {
#if defined(KBVH_WITH_TBB)
    if (threads_ > 1) arena_.initialize(threads_);
#endif
  }

  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }

  void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                        PairBuffer& out) override {
    this->sweep(before, out);
  }

 private:
  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    if (threads_ == 1)
      hierarchy.refit(this->sampled_.positions(body));
    else
      refit_in_parallel(hierarchy, this->sampled_.positions(body));
    this->count_refit(body);
  }

  void refit_in_parallel(WideHierarchy<S>& hierarchy, const S* positions) {
#if defined(KBVH_WITH_TBB)
    if (!hierarchy.subtrees().empty()) {
      arena_.execute([&] {
        tbb::parallel_for_each(hierarchy.subtrees(), [&](const auto& subtree) {
          hierarchy.refit_nodes(positions, subtree.begin, subtree.end);
        });
      });
      for (const std::uint32_t node : hierarchy.above_subtrees())
        hierarchy.refit_nodes(positions, node, node + 1);
      return;
    }
#endif
    hierarchy.refit(positions);
  }

  int threads_;
#if defined(KBVH_WITH_TBB)
  tbb::task_arena arena_;
#endif
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
                     {"threads",
                      "1",
                      {},
                      "threads of the refit (TBB), at most those of this machine; times with more than one "
                      "thread are reported separately",
                      1,
                      most_threads(),
                      Numbers::whole}},
  })};
}
