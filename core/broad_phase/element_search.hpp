#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/kernels/element_pairs.hpp"
#include "core/broad_phase/kernels/group_traversal.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// What a search looks for, and where: pairs of elements of one kind whose boxes overlap.
template <class S>
struct ElementSearchJob {
  CandidateKind kind;
  ElementLeaves<S> a, b;
  std::uint32_t padded;       ///< lanes of a leaf: 8 or 16
  KernelSet kernels;          ///< the instruction set
  bool grouped;               ///< groups admit pairs of subtrees
  GroupArrays groups_a, groups_b;
  std::size_t usual;          ///< the number of candidates for which memory is reserved first
  std::span<const WidePair> starts;      ///< the pairs of nodes, or of a node and a leaf, to begin with
  std::span<const LeafSlot> leaf_pairs;  ///< pairs of leaves that come before: first, second, ...
};

/// Searches two trees of elements, or one and itself, from given pairs of nodes on. Keeps its memory.
template <class S>
class ElementSearch {
 public:
  /// Appends the pairs, without incident ones, to `out`: those of each start after those of the starts before.
  /// `sift(pairs, count)` gets up to some thousands of them at a time, moves those that stay to the front and
  /// returns their number; its exceptions pass. Returns the number of box tests.
  template <class Sift>
  std::uint64_t run(const ElementSearchJob<S>& job, CandidateBuffer& out, const Sift& sift) {
    const auto traverse = stepping(job);
    std::uint64_t tests = 0;
    for (std::size_t begin = 0; begin < job.leaf_pairs.size(); begin += 2 * leaf_pair_room)
      take(job, job.leaf_pairs.subspan(begin, std::min(job.leaf_pairs.size() - begin, 2 * leaf_pair_room)),
           out, tests, sift);
    stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
    found_.resize(2 * leaf_pair_room);
    WideTraversal state{stack_.data(),  0, stack_.size(),    found_.data(), 0,
                        leaf_pair_room, 0, ~std::uint64_t(0)};
    for (const WidePair& start : job.starts) {
      state.stack[state.depth++] = start;
      while (state.depth > 0) {
        traverse(state);
        // Pairs of few leaves wait for those of the next start.
        if (state.depth > 0 || state.found > leaf_pair_room / 2) {
          take(job, {state.out, 2 * state.found}, out, tests, sift);
          state.found = 0;
        }
        if (state.depth + max_pairs_per_step < state.stack_room) continue;
        stack_.resize(2 * stack_.size());
        state.stack = stack_.data();
        state.stack_room = stack_.size();
      }
    }
    take(job, {state.out, 2 * state.found}, out, tests, sift);
    return tests + state.tests;
  }

  std::size_t bytes() const {
    return stack_.capacity() * sizeof(WidePair) + found_.capacity() * sizeof(LeafSlot);
  }

 private:
  /// Returns what continues the traversal of a state.
  static auto stepping(const ElementSearchJob<S>& job) {
    const bool one = first_element(job.kind) == second_element(job.kind);
    const auto& kernels = wide_overlap_kernels<S>(job.kernels);
    const auto& by_groups = group_traversal_kernels<S>(job.kernels);
    const auto plain = one ? kernels.self(8) : kernels.traverse(8);
    const auto grouped = one ? by_groups.self : by_groups.two;
    return [&job, plain, grouped](WideTraversal& state) {
      if (job.grouped)
        grouped(job.a.tree, job.b.tree, job.groups_a, job.groups_b, state);
      else
        plain(job.a.tree, job.b.tree, state);
    };
  }

  template <class Sift>
  void take(const ElementSearchJob<S>& job, std::span<const LeafSlot> leaf_pairs, CandidateBuffer& out,
            std::uint64_t& tests, const Sift& sift) {
    const auto kernel =
        element_pair_kernels<S>(job.kernels).of[job.padded == 8 ? 0 : 1][std::size_t(job.kind)];
    ElementPairsJob<S> pairs{job.a, job.b, leaf_pairs.data(), 0, leaf_pairs.size() / 2, nullptr, 0, 0, 0};
    while (pairs.next < pairs.count) {
      // The kernel writes into the list itself, as far as its memory reaches. Memory that is reserved and not
      // written costs next to nothing; copies of long lists are expensive.
      const std::size_t before = out.size();
      if (out.capacity() - before < element_pairs_step)
        out.reserve(std::max<std::size_t>(4 * out.capacity(), before + element_pairs_step + job.usual));
      out.resize(out.capacity());
      pairs.out = &out[before].first;
      pairs.found = 0;
      pairs.out_room = out.size() - before;
      kernel(pairs);
      out.resize(before + pairs.found);
      out.resize(before + sift(out.data() + before, pairs.found));
    }
    tests += pairs.tests;
  }

  std::vector<WidePair> stack_;
  std::vector<LeafSlot> found_;
};

}  // namespace kbvh
