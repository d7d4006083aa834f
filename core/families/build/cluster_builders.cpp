#include "core/families/build/cluster_builders.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/assert.hpp"

namespace kbvh {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
/// If a round merges fewer than one pair in this many clusters, the next one merges others, too.
constexpr std::uint32_t least_share = 16;

/// Lets a binary tree of clusters be laid out. Leaves are listed, and their primitives written afterwards.
template <class Cluster, class Leaf>
struct ClusterSource {
  using Part = std::uint32_t;
  static constexpr std::size_t nodes_at_once = 32;
  const std::vector<Cluster>& clusters;
  std::vector<Leaf>& leaves;

  static bool large(Part /*part*/) { return false; }
  std::uint32_t count(Part part) const { return clusters[part].primitives; }
  std::uint32_t size(Part part) const { return clusters[part].primitives; }
  double weight(Part part) const { return clusters[part].surface; }
  std::pair<Part, Part> split(Part part) const { return {clusters[part].first, clusters[part].second}; }
  void expect(std::uint32_t count_of_leaves) const {
    if (leaves.size() < count_of_leaves) leaves.resize(count_of_leaves);
  }
  std::pair<std::uint32_t, std::uint32_t> leaf(std::uint32_t number, Part part, std::uint32_t placed) const {
    leaves[number] = {part, placed};
    return {placed, placed + size(part)};
  }
};

}  // namespace

template <class S>
void LocalClusterBuilder<S>::build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order,
                                   const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(workers, list, Curve::hilbert);
  order.refine_runs(workers, tree.leaf_size());
  grains_.take(workers, order, std::min(grain_, tree.leaf_size()));
  start(workers, grains_.count());
  merge_all(workers, tree.kernels());
  ClusterSource<Cluster, Leaf> source{clusters_, leaves_};
  lay_out(workers, tree, source, ids_[0], room_);
  const Parts leaves{tree.leaf_count(), 256};
  workers.for_each(leaves.parts(), [&](std::size_t part, std::uint32_t) {
    for (std::size_t leaf = leaves.begin(part); leaf < leaves.end(part); ++leaf)
      write(order, leaves_[leaf], tree.entries());
  });
  tree.fit(workers, order.boxes());
}

/// Writes the primitives of a leaf to the tree's entries.
template <class S>
void LocalClusterBuilder<S>::write(const CurveOrder<S>& order, const Leaf& leaf,
                                   std::uint32_t* entries) const {
  std::uint32_t* to = entries + leaf.to;
  std::array<std::uint32_t, 16> open;  // disjoint clusters, each of some of the leaf's primitives
  std::size_t size = 0;
  open[size++] = leaf.cluster;
  while (size > 0) {
    const std::uint32_t next = open[--size];
    if (next < grains_.count()) {
      to = grains_.write(order, next, to);
    } else {
      KBVH_ASSERT(size + 2 <= open.size());
      open[size++] = clusters_[next].second;
      open[size++] = clusters_[next].first;
    }
  }
}

template <class S>
void LocalClusterBuilder<S>::start(Workers& workers, std::uint32_t count) {
  active_ = made_ = count;
  const auto grow = [](auto& some, std::size_t size) {
    if (some.size() < size) some.resize(size);
  };
  grow(clusters_, 2 * std::size_t(count));
  grow(ids_, count);
  grow(nearest_, count);
  grow(part_places_, cut().parts());
  stride_ = (std::size_t(count) + 2 * most_radius + 15) / 16 * 16;
  grow(rows_, 6 * stride_);
  if (shared_by(workers)) {
    grow(next_rows_, 6 * stride_);
    grow(next_ids_, count);
    for (std::size_t side = 0; side < 6; ++side)
      std::fill_n(next_rows_.data() + side * stride_, most_radius, -infinity);
  }
  for (std::size_t side = 0; side < 6; ++side) {
    std::fill_n(row(side) - most_radius, most_radius, -infinity);
    std::fill_n(row(side) + count, most_radius, -infinity);
  }
  const Parts parts = cut();
  workers.for_each(parts.parts(), [&](std::size_t part, std::uint32_t) {
    const auto begin = std::uint32_t(parts.begin(part)), end = std::uint32_t(parts.end(part));
    for (std::size_t side = 0; side < 6; ++side) {
      float* const values = row(side);
      const float* const boxes = grains_.boxes() + (side < 3 ? side : side + 1);
      for (std::uint32_t i = begin; i < end; ++i)
        values[i] = side < 3 ? boxes[std::size_t(8) * i] : -boxes[std::size_t(8) * i];
    }
    for (std::uint32_t i = begin; i < end; ++i) {
      ids_[i] = i;
      clusters_[i] = {i, 0, grains_.primitives(i), 0};
    }
  });
}

template <class S>
void LocalClusterBuilder<S>::merge_all(Workers& workers, KernelSet kernels) {
  bool few_merged = false;
  while (active_ > 1) {
    find_nearest(workers, kernels);
    searched_ += active_;
    if (few_merged) match_others();
    const std::uint32_t before = active_;
    merge_round(workers);
    KBVH_ASSERT(active_ < before || !few_merged);
    few_merged = std::uint64_t(before - active_) * least_share < before;
    for (std::size_t side = 0; side < 6; ++side) std::fill_n(row(side) + active_, most_radius, -infinity);
  }
}

template <class S>
void LocalClusterBuilder<S>::find_nearest(Workers& workers, KernelSet kernels) {
  const ClusterKernels& table = cluster_kernels(kernels);
  const auto nearest = radius_ == 8 ? table.nearest8 : table.nearest16;
  if (!shared_by(workers)) return nearest({row(0), stride_, active_, nearest_.data()});
  const Parts parts = cut();
  workers.for_each(parts.parts(), [&](std::size_t part, std::uint32_t) {
    const auto begin = std::uint32_t(parts.begin(part)), end = std::uint32_t(parts.end(part));
    nearest({row(0) + begin, stride_, end - begin, nearest_.data() + begin});
    for (std::uint32_t i = begin; i < end; ++i) nearest_[i] += begin;  // the kernel counts from 0
  });
}

/// Clusters merge that chose each other. Where sizes grow along the curve, each chooses a smaller one, and
/// hardly any two choose each other, and where surfaces are equal, sometimes none; then a cluster also merges
/// with its choice if that is still free: from here on they count as having chosen each other. At most 2 *
/// radius clusters choose the same one, so this merges a fixed share of all clusters, and at least every
/// other round does.
template <class S>
void LocalClusterBuilder<S>::match_others() {
  for (std::uint32_t i = 0; i < active_; ++i) {
    const std::uint32_t other = nearest_[i];
    if (nearest_[other] == i || nearest_[nearest_[other]] == other) continue;
    nearest_[other] = i;
  }
}

/// Merges all clusters that chose each other.
template <class S>
void LocalClusterBuilder<S>::merge_round(Workers& workers) {
  float* to[6];
  Places next{0, made_};
  if (!shared_by(workers)) {
    for (std::size_t side = 0; side < 6; ++side) to[side] = row(side);
    next = merge(0, active_, to, ids_.data(), next);
  } else {
    const Parts parts = cut();
    workers.for_each(parts.parts(), [&](std::size_t part, std::uint32_t) {
      Places in_part;
      for (auto i = std::uint32_t(parts.begin(part)); i < parts.end(part); ++i) {
        const std::uint32_t other = nearest_[i];
        const bool mutual = nearest_[other] == i;
        in_part.left += mutual && other < i ? 0U : 1U;
        in_part.made += mutual && other > i ? 1U : 0U;
      }
      part_places_[part].of = in_part;
    });
    for (std::size_t part = 0; part < parts.parts(); ++part) {
      const Places in_part = std::exchange(part_places_[part].of, next);
      next.left += in_part.left;
      next.made += in_part.made;
    }
    for (std::size_t side = 0; side < 6; ++side) to[side] = next_rows_.data() + side * stride_ + most_radius;
    workers.for_each(parts.parts(), [&](std::size_t part, std::uint32_t) {
      merge(std::uint32_t(parts.begin(part)), std::uint32_t(parts.end(part)), to, next_ids_.data(),
            part_places_[part].of);
    });
    rows_.swap(next_rows_);
    ids_.swap(next_ids_);
  }
  active_ = next.left;
  made_ = next.made;
}

/// Merges those of the clusters [begin, end) that chose each other: writes the rows and ids of those that
/// remain, and the new clusters, from the given places on; returns the places after them. The rows and ids
/// may be the current ones if all clusters are merged at once.
template <class S>
auto LocalClusterBuilder<S>::merge(std::uint32_t begin, std::uint32_t end, float* const* to_rows,
                                   std::uint32_t* to_ids, Places to) -> Places {
  float *rows[6], *targets[6];
  for (std::size_t side = 0; side < 6; ++side) {
    rows[side] = row(side);
    targets[side] = to_rows[side];
  }
  const std::uint32_t *const ids = ids_.data(), *const nearest = nearest_.data();
  for (std::uint32_t i = begin; i < end; ++i) {
    const bool mutual = nearest[nearest[i]] == i;
    const std::uint32_t other = mutual ? nearest[i] : i;
    if (other < i) continue;
    float box[6];
    for (std::size_t side = 0; side < 6; ++side) {
      box[side] = std::min(rows[side][i], rows[side][other]);
      targets[side][to.left] = box[side];
    }
    std::uint32_t id = ids[i];
    if (other != i) {
      const std::uint32_t second = ids[other];
      const float x = box[0] + box[3], y = box[1] + box[4], z = box[2] + box[5];
      clusters_[to.made] = {id, second, clusters_[id].primitives + clusters_[second].primitives,
                            x * y + y * z + z * x};
      id = to.made++;
    }
    to_ids[to.left++] = id;
  }
  return to;
}

template <class S>
std::size_t LocalClusterBuilder<S>::bytes() const {
  return grains_.bytes() + clusters_.capacity() * sizeof(Cluster) +
         (rows_.capacity() + next_rows_.capacity()) * sizeof(float) +
         (ids_.capacity() + next_ids_.capacity() + nearest_.capacity()) * sizeof(std::uint32_t) +
         room_.bytes() + leaves_.capacity() * sizeof(Leaf) + part_places_.capacity() * sizeof(PartPlaces);
}

namespace {

using PartBox = std::array<float, 8>;
constexpr PartBox empty_box{infinity, infinity, infinity, 0, -infinity, -infinity, -infinity, 0};

void extend(float* box, const float* other) {
  for (std::size_t side = 0; side < 3; ++side) {
    box[side] = std::min(box[side], other[side]);
    box[side + 4] = std::max(box[side + 4], other[side + 4]);
  }
}
void extend(PartBox& box, const float* other) {
  extend(box.data(), other);
}
/// Returns half the surface.
float surface(const PartBox& box) {
  const float x = box[4] - box[0], y = box[5] - box[1], z = box[6] - box[2];
  return x * y + y * z + z * x;
}

/// Larger ranges are sorted into bins by all threads, this many items at once.
constexpr std::uint32_t most_alone = 1U << 14, items_at_once = 1U << 13;

/// Splits ranges of items at planes. Leaves are listed, and their primitives written afterwards.
template <class S>
struct BinnedSource {
  using Part = typename BinnedBuilder<S>::Part;
  using Leaf = typename BinnedBuilder<S>::Leaf;
  using Bins = typename BinnedBuilder<S>::Bins;
  static constexpr std::size_t nodes_at_once = 1;
  const Grains<S>& grains;
  std::uint32_t* items;
  const ClusterKernels& kernels;
  Workers& workers;
  std::vector<Leaf>& leaves;
  std::vector<Bins>& part_bins;
  Bins bins{};

  bool large(const Part& part) const { return workers.several() && part.end - part.begin > most_alone; }
  std::uint32_t count(const Part& part) const { return (part.end - part.begin) * grains.size(); }
  /// Only the last grain may have fewer primitives.
  std::uint32_t size(const Part& part) const {
    std::uint32_t sum = 0;
    for (std::uint32_t k = part.begin; k < part.end; ++k) sum += grains.primitives(items[k]);
    return sum;
  }
  static double weight(const Part& part) { return surface(part.box); }
  void expect(std::uint32_t count_of_leaves) const {
    if (leaves.size() < count_of_leaves) leaves.resize(count_of_leaves);
  }
  std::pair<std::uint32_t, std::uint32_t> leaf(std::uint32_t number, const Part& part,
                                               std::uint32_t placed) const {
    leaves[number] = {part.begin, part.end, placed};
    return {placed, placed + size(part)};
  }
  std::pair<Part, Part> split(const Part& part) {
    BinsJob job{grains.boxes(),       items + part.begin, part.end - part.begin, {}, {},
                &bins.boxes[0][0][0], &bins.counts[0][0]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      job.lower[axis] = 2 * part.box[axis];
      const float scale = float(sah_bins) / (2 * (part.box[axis + 4] - part.box[axis]));
      job.scale[axis] = std::isfinite(scale) ? scale : 0.0F;
    }
    if (large(part))
      share_bins(job);
    else
      kernels.bins(job);
    std::uint32_t axis = 0, last_bin = 0;
    if (!best_plane(job.count, axis, last_bin)) return halves(part);
    const std::uint32_t middle = part.begin + kernels.partition(job, items + part.begin, axis, last_bin);
    std::pair<Part, Part> parts{{part.begin, middle, empty_box}, {middle, part.end, empty_box}};
    for (std::uint32_t b = 0; b < sah_bins; ++b)
      extend(b <= last_bin ? parts.first.box : parts.second.box, bins.boxes[axis][b]);
    return parts;
  }

 private:
  /// Sorts items into `bins` on all threads: by part of the items, then all parts together.
  void share_bins(const BinsJob& job) {
    const Parts cut{job.count, items_at_once};
    if (part_bins.size() < cut.parts()) part_bins.resize(cut.parts());
    workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
      BinsJob own = job;
      own.items += cut.begin(part);
      own.count = std::uint32_t(cut.end(part) - cut.begin(part));
      own.bin_boxes = &part_bins[part].boxes[0][0][0];
      own.bin_counts = &part_bins[part].counts[0][0];
      kernels.bins(own);
    });
    bins = part_bins[0];
    for (std::size_t part = 1; part < cut.parts(); ++part)
      for (std::uint32_t axis = 0; axis < 3; ++axis)
        for (std::uint32_t b = 0; b < sah_bins; ++b) {
          extend(bins.boxes[axis][b], part_bins[part].boxes[axis][b]);
          bins.counts[axis][b] += part_bins[part].counts[axis][b];
        }
  }
  /// Finds the plane of least cost; returns false if all items lie in one bin of each axis.
  bool best_plane(std::uint32_t count, std::uint32_t& best_axis, std::uint32_t& last_bin) const {
    float least = infinity;
    std::uint32_t least_larger = 0;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      float right_cost[sah_bins];
      PartBox box = empty_box;
      std::uint32_t in_box = 0;
      for (std::uint32_t b = sah_bins - 1; b > 0; --b) {
        extend(box, bins.boxes[axis][b]);
        in_box += bins.counts[axis][b];
        right_cost[b] = in_box == 0 ? infinity : surface(box) * float(in_box);
      }
      box = empty_box;
      in_box = 0;
      for (std::uint32_t b = 0; b + 1 < sah_bins; ++b) {
        extend(box, bins.boxes[axis][b]);
        in_box += bins.counts[axis][b];
        if (in_box == 0) continue;
        if (in_box == count) break;
        const float cost = surface(box) * float(in_box) + right_cost[b + 1];
        // Among equal costs, as on a line, takes the most even split.
        const std::uint32_t larger = std::max(in_box, count - in_box);
        if (cost < least || (cost == least && larger < least_larger))
          least = cost, best_axis = axis, last_bin = b, least_larger = larger;
      }
    }
    return least < infinity;
  }
  std::pair<Part, Part> halves(const Part& part) const {
    const std::uint32_t middle = part.begin + (part.end - part.begin) / 2;
    std::pair<Part, Part> parts{{part.begin, middle, empty_box}, {middle, part.end, empty_box}};
    for (std::uint32_t k = part.begin; k < part.end; ++k)
      extend(k < middle ? parts.first.box : parts.second.box, grains.boxes() + std::size_t(8) * items[k]);
    return parts;
  }
};

}  // namespace

/// Lists all grains as items; returns the whole range with its box.
template <class S>
auto BinnedBuilder<S>::take_items(Workers& workers) -> Part {
  const std::uint32_t count = grains_.count();
  if (items_.size() < count) items_.resize(count);
  const Parts cut{count, items_at_once};
  if (part_bins_.size() < cut.parts()) part_bins_.resize(cut.parts());
  const auto box_of = [this](std::size_t part) -> float* { return part_bins_[part].boxes[0][0]; };
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    PartBox box = empty_box;
    for (auto i = std::uint32_t(cut.begin(part)); i < cut.end(part); ++i) {
      items_[i] = i;
      extend(box, grains_.boxes() + std::size_t(8) * i);
    }
    std::copy_n(box.data(), box.size(), box_of(part));
  });
  Part root{0, count, empty_box};
  for (std::size_t part = 0; part < cut.parts(); ++part) extend(root.box, box_of(part));
  return root;
}

template <class S>
void BinnedBuilder<S>::build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order,
                             const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(workers, list, Curve::hilbert);
  order.refine_runs(workers, tree.leaf_size());
  grains_.take(workers, order, std::min(grain_, tree.leaf_size()));
  const Part root = take_items(workers);
  BinnedSource<S> source{grains_, items_.data(), cluster_kernels(tree.kernels()),
                         workers, leaves_,       part_bins_};
  lay_out(workers, tree, source, root, room_);
  const Parts leaves{tree.leaf_count(), 256};
  workers.for_each(leaves.parts(), [&](std::size_t part, std::uint32_t) {
    for (std::size_t i = leaves.begin(part); i < leaves.end(part); ++i) {
      const Leaf& leaf = leaves_[i];
      std::uint32_t* to = tree.entries() + leaf.to;
      for (std::uint32_t k = leaf.begin; k < leaf.end; ++k) to = grains_.write(order, items_[k], to);
    }
  });
  tree.fit(workers, order.boxes());
}

template <class S>
std::size_t BinnedBuilder<S>::bytes() const {
  return grains_.bytes() + items_.capacity() * sizeof(std::uint32_t) + room_.bytes() +
         leaves_.capacity() * sizeof(Leaf) + part_bins_.capacity() * sizeof(Bins);
}

template class LocalClusterBuilder<float>;
template class LocalClusterBuilder<double>;
template class BinnedBuilder<float>;
template class BinnedBuilder<double>;

}  // namespace kbvh
