// The join on several threads: traversal and leaf tests by SharedJoin, then the order of the pairs.

#include <algorithm>
#include <utility>

#include "core/families/linear/interval_join.hpp"

namespace kbvh {

namespace {
/// Number of pairs that one thread sorts at once.
constexpr std::size_t pairs_at_once = 8192;
}  // namespace

template <class S>
void IntervalJoin<S>::join(const LinearSegment<S>& segment, const SceneView<S>& scene,
                           std::span<const BodyPair> bodies, Workers& workers) {
  if (!workers.several()) return join(segment, scene, bodies);
  start(segment, scene, {}, leaf_pairs_at_once);
  bodies_.assign(bodies.begin(), bodies.end());
  shared_.start();
  std::vector<Found>& ends = found_;
  added_.clear();
  std::uint64_t tests = 0;
  for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
    const BodySegmentBounds<S>&a = segment.sides[bodies_[i].first], &b = segment.sides[bodies_[i].second];
    if (a.hierarchy().empty() || b.hierarchy().empty() || a.apart || b.apart) continue;
    const std::uint32_t padded =
        std::max({4u, a.hierarchy().padded_leaf_size(), b.hierarchy().padded_leaf_size()});
    const bool self = bodies_[i].first == bodies_[i].second;
    WideLeafJoin<S> join{};
    join.width = a.hierarchy().topology().width;
    join.a = a.hierarchy().arrays();
    join.b = b.hierarchy().arrays();
    join.ends_a = a.ends();
    join.ends_b = b.ends();
    join.leaves_a = a.leaves();
    join.leaves_b = b.leaves();
    shared_.add(join, a.hierarchy().kernels(), padded, self,
                self && !with_neighbours_ ? &scene.primitives(bodies_[i].first) : nullptr);
    if (with_slabs_) shared_.use_slabs(slabs_of(a, b));
    added_.push_back(i);
    ++tests;  // of the roots, which a traversal counts, too
  }
  shared_.run(workers, found_throughout_, found_partly_, ends, tests);
  // One entry for every pair of bodies, even for those that were not joined.
  const std::size_t joined = ends.size();
  const Found all = joined == 0 ? Found{0, 0} : ends.back();
  ends.resize(bodies_.size());
  for (std::size_t i = bodies_.size(), k = joined; i-- > 0;) {
    if (k > 0 && added_[k - 1] == i) --k;
    // The ends of the joined pairs are in the first places, and move to later ones or stay.
    ends[i] = k < joined && added_[k] == i ? ends[k] : k == 0 ? Found{0, 0} : ends[k - 1];
  }
  node_tests_ = tests;
  leaf_join_.throughout.found = all.throughout;
  leaf_join_.partly.found = all.partly;
  sort_by_begin(workers);
}

/// A counting sort like that of one thread: each part of the pairs counts its buckets, and then knows where
/// its pairs go.
template <class S>
void IntervalJoin<S>::sort_by_begin(Workers& workers) {
  constexpr std::uint32_t buckets = FractionBuckets::count;
  throughout_ = leaf_join_.throughout.found;
  const std::size_t partly = leaf_join_.partly.found;
  count_ = throughout_ + partly;
  if (sorted_.size() < count_) sorted_.resize(count_);
  const bool several = bodies_.size() > 1;
  if (several && bodies_of_.size() < count_) bodies_of_.resize(sorted_.size());
  const auto first_bodies = [this](std::size_t i, auto member) {
    return std::uint32_t(std::partition_point(found_.begin(), found_.end(),
                                              [&](const Found& found) { return found.*member <= i; }) -
                         found_.begin());
  };
  found_at_.resize(partly);
  const Parts fixed{throughout_, pairs_at_once}, cut{partly, pairs_at_once};
  bucket_places_.assign(cut.parts() * buckets, 0);
  workers.for_each(fixed.parts() + cut.parts(), [&](std::size_t part, std::uint32_t) {
    if (part >= fixed.parts()) {
      part -= fixed.parts();
      std::uint32_t* const counts = bucket_places_.data() + part * buckets;
      for (std::size_t i = cut.begin(part); i < cut.end(part); ++i)
        ++counts[FractionBuckets::of(found_partly_.begin[i])];
      return;
    }
    std::uint32_t bodies = several ? first_bodies(fixed.begin(part), &Found::throughout) : 0;
    for (std::size_t i = fixed.begin(part); i < fixed.end(part); ++i) {
      sorted_[i] = {found_throughout_.primitive_a[i], found_throughout_.primitive_b[i], 0, 1};
      if (!several) continue;
      while (i >= found_[bodies].throughout) ++bodies;
      bodies_of_[i] = bodies;
    }
  });
  auto sum = std::uint32_t(throughout_);
  for (std::uint32_t bucket = 0; bucket < buckets; ++bucket) {
    for (std::size_t part = 0; part < cut.parts(); ++part)
      sum += std::exchange(bucket_places_[part * buckets + bucket], sum);
    bucket_end_[bucket] = sum;
  }
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    std::uint32_t* const place = bucket_places_.data() + part * buckets;
    std::uint32_t bodies = several ? first_bodies(cut.begin(part), &Found::partly) : 0;
    for (std::size_t i = cut.begin(part); i < cut.end(part); ++i) {
      const std::uint32_t to = place[FractionBuckets::of(found_partly_.begin[i])]++;
      found_at_[i] = to;
      sorted_[to] = {found_partly_.primitive_a[i], found_partly_.primitive_b[i], found_partly_.begin[i],
                     found_partly_.end[i]};
      if (!several) continue;
      while (i >= found_[bodies].partly) ++bodies;
      bodies_of_[to] = bodies;
    }
  });
}

template void IntervalJoin<float>::sort_by_begin(Workers&);
template void IntervalJoin<double>::sort_by_begin(Workers&);
template void IntervalJoin<float>::join(const LinearSegment<float>&, const SceneView<float>&,
                                        std::span<const BodyPair>, Workers&);
template void IntervalJoin<double>::join(const LinearSegment<double>&, const SceneView<double>&,
                                         std::span<const BodyPair>, Workers&);

}  // namespace kbvh
