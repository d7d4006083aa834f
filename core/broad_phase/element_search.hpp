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
#include "core/families/wide/shared_front.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/parallel/workers.hpp"

namespace kbvh {

/// What a search looks for, and where: pairs of elements of one kind whose boxes overlap.
template <class S>
struct ElementSearchJob {
  CandidateKind kind;
  ElementLeaves<S> a, b;
  std::uint32_t padded;  ///< lanes of a leaf: 8 or 16
  KernelSet kernels;     ///< the instruction set
  bool grouped;          ///< groups admit pairs of subtrees
  GroupArrays groups_a, groups_b;
  std::size_t usual;                     ///< the number of candidates for which memory is reserved first
  std::span<const WidePair> starts;      ///< the pairs of nodes, or of a node and a leaf, to begin with
  std::span<const LeafSlot> leaf_pairs;  ///< pairs of leaves to be tested first: first, second, ...
};

/// Searches two trees of elements, or one and itself, from given pairs of nodes on, on one thread or several:
/// the same pairs in the same order, and the same number of tests, for any number of threads. Keeps its
/// memory.
template <class S>
class ElementSearch {
 public:
  /// Appends the pairs, without incident ones, to `out`, in the order of the starts. `sift(pairs, count,
  /// runner)` gets up to some thousands of them at a time, moves those that stay to the front and returns
  /// their number; its exceptions pass. Several threads call it at a time, each with a `runner` of its own
  /// below `workers.threads()`. Returns the number of box tests.
  template <class Sift>
  std::uint64_t run(Workers& workers, const ElementSearchJob<S>& job, CandidateBuffer& out,
                    const Sift& sift) {
    runners_.resize(workers.threads());
    return workers.several() ? share(workers, job, out, sift) : run_alone(job, out, sift);
  }
  /// Does the same on the caller's thread.
  template <class Sift>
  std::uint64_t run_alone(const ElementSearchJob<S>& job, CandidateBuffer& out, const Sift& sift) {
    const auto traverse = stepping(job);
    std::uint64_t tests = 0;
    const auto take_in = [&](std::span<const LeafSlot> leaf_pairs) {
      take(job, leaf_pairs, out, tests, sift, 0);
    };
    for_each_batch(job.leaf_pairs, leaf_pair_room, take_in);
    stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
    found_.resize(2 * leaf_pair_room);
    WideTraversal state{stack_.data(),  0, stack_.size(),    found_.data(), 0,
                        leaf_pair_room, 0, ~std::uint64_t(0)};
    for (const WidePair& start : job.starts) {
      state.stack[state.depth++] = start;
      while (state.depth > 0) {
        traverse(state);
        // A few pairs of leaves wait for those of the next start.
        if (state.depth > 0 || state.found > leaf_pair_room / 2) {
          take_in({state.out, 2 * state.found});
          state.found = 0;
        }
        if (state.depth + max_pairs_per_step < state.stack_room) continue;
        stack_.resize(2 * stack_.size());
        state.stack = stack_.data();
        state.stack_room = stack_.size();
      }
    }
    take_in({state.out, 2 * state.found});
    return tests + state.tests;
  }

  std::size_t bytes() const {
    std::size_t total = stack_.capacity() * sizeof(WidePair) + found_.capacity() * sizeof(LeafSlot) +
                        front_.bytes() + batches_.capacity() * sizeof(Batch);
    for (const Runner& runner : runners_)
      total += sizeof runner + runner.found.capacity() * sizeof(Candidate);
    return total;
  }

 private:
  struct alignas(cache_line) Runner {
    CandidateBuffer found;
    std::uint64_t tests = 0;
  };
  /// Pairs of leaves, and what a runner found for them: [begin, end) of its list, to be copied to `to`.
  struct Batch {
    std::span<const LeafSlot> leaf_pairs;
    std::uint32_t runner;
    std::size_t begin, end, to;
  };

  template <class Take>
  static void for_each_batch(std::span<const LeafSlot> leaf_pairs, std::size_t size, const Take& take_in) {
    for (std::size_t begin = 0; begin < leaf_pairs.size(); begin += 2 * size)
      take_in(leaf_pairs.subspan(begin, std::min(leaf_pairs.size() - begin, 2 * size)));
  }

  template <class Sift>
  std::uint64_t share(Workers& workers, const ElementSearchJob<S>& job, CandidateBuffer& out,
                      const Sift& sift) {
    for (Runner& runner : runners_) {
      runner.found.clear();
      runner.tests = 0;
    }
    const auto traverse = stepping(job);
    front_.start();
    for (std::size_t i = 0; i < job.starts.size(); ++i) front_.add(std::uint32_t(i));
    std::uint64_t tests = front_.traverse(
        workers,
        [&](std::uint32_t i, WideTraversal& state) {
          // The front starts with a pair of roots, which occurs nowhere else: the job's start replaces it.
          WidePair& bottom = state.stack[0];
          if (bottom.first == 0 && bottom.second == 0) bottom = job.starts[i];
          traverse(state);
        },
        [](const SharedFront::Batch&, std::uint32_t) {});
    batches_.clear();
    for_each_batch(job.leaf_pairs, SharedFront::batch_pairs, [&](std::span<const LeafSlot> leaf_pairs) {
      batches_.push_back({leaf_pairs, 0, 0, 0, 0});
    });
    for (const SharedFront::Batch& batch : front_.batches()) batches_.push_back({batch.pairs, 0, 0, 0, 0});
    workers.for_each(batches_.size(), [&](std::size_t i, std::uint32_t r) {
      Runner& room = runners_[r];
      Batch& batch = batches_[i];
      batch.runner = r;
      batch.begin = room.found.size();
      take(job, batch.leaf_pairs, room.found, room.tests, sift, r);
      batch.end = room.found.size();
    });
    std::size_t to = out.size(), all = 0;
    for (Batch& batch : batches_) {
      batch.to = to;
      to += batch.end - batch.begin;
    }
    for (const Runner& room : runners_) {
      tests += room.tests;
      all += room.found.size();
    }
    // The next search may give all work to one thread: room for that, so that it allocates nothing.
    for (Runner& room : runners_) room.found.reserve(all + element_pairs_step);
    out.resize(to);
    const Parts cut{batches_.size(), 8};
    workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
      for (std::size_t i = cut.begin(part); i < cut.end(part); ++i) {
        const Batch& batch = batches_[i];
        const Candidate* const from = runners_[batch.runner].found.data();
        std::copy(from + batch.begin, from + batch.end, out.data() + batch.to);
      }
    });
    return tests;
  }

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
  static void take(const ElementSearchJob<S>& job, std::span<const LeafSlot> leaf_pairs, CandidateBuffer& out,
                   std::uint64_t& tests, const Sift& sift, std::uint32_t runner) {
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
      out.resize(before + sift(out.data() + before, pairs.found, runner));
    }
    tests += pairs.tests;
  }

  std::vector<WidePair> stack_;
  std::vector<LeafSlot> found_;
  // On several threads.
  SharedFront front_;
  std::vector<Runner> runners_;
  std::vector<Batch> batches_;
};

}  // namespace kbvh
