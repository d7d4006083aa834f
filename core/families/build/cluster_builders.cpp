#include "core/families/build/cluster_builders.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/assert.hpp"

namespace kbvh {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
/// If fewer than one in this many clusters is the first of a mutual choice, the round merges others, too.
constexpr std::uint32_t least_share = 16;

/// Lets a binary tree of clusters be laid out: each leaf appends its primitives to those of the last one.
template <class S, class Cluster>
struct ClusterSource {
  using Part = std::uint32_t;
  const std::vector<Cluster>& clusters;
  const Grains<S>& grains;
  const CurveOrder<S>& order;
  std::vector<std::uint32_t>& open;
  std::uint32_t *entries, *end;

  std::uint32_t count(Part part) const { return clusters[part].primitives; }
  double weight(Part part) const { return clusters[part].surface; }
  std::pair<Part, Part> split(Part part) const { return {clusters[part].first, clusters[part].second}; }
  std::pair<std::uint32_t, std::uint32_t> leaf(Part part) {
    const auto begin = std::uint32_t(end - entries);
    open.clear();
    open.push_back(part);
    while (!open.empty()) {
      const std::uint32_t next = open.back();
      open.pop_back();
      if (next < grains.count()) {
        end = grains.write(order, next, end);
      } else {
        open.push_back(clusters[next].second);
        open.push_back(clusters[next].first);
      }
    }
    return {begin, std::uint32_t(end - entries)};
  }
};

}  // namespace

template <class S>
void LocalClusterBuilder<S>::build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(list, Curve::hilbert);
  order.refine_runs(tree.leaf_size());
  grains_.take(order, std::min(grain_, tree.leaf_size()));
  start(grains_.count());
  merge_all(tree.kernels());
  ClusterSource<S, Cluster> source{clusters_, grains_, order, open_, tree.entries(), tree.entries()};
  lay_out(tree, source, ids_[0], parts_);
  tree.fit(order.boxes());
}

template <class S>
void LocalClusterBuilder<S>::start(std::uint32_t count) {
  active_ = made_ = count;
  const auto grow = [](auto& some, std::size_t size) {
    if (some.size() < size) some.resize(size);
  };
  grow(clusters_, 2 * std::size_t(count));
  grow(ids_, count);
  grow(nearest_, count);
  grow(partner_, count);
  stride_ = (std::size_t(count) + 2 * most_radius + 15) / 16 * 16;
  grow(rows_, 6 * stride_);
  for (std::size_t side = 0; side < 6; ++side) {
    float* const values = row(side);
    std::fill_n(values - most_radius, most_radius, -infinity);
    std::fill_n(values + count, most_radius, -infinity);
    const float* const boxes = grains_.boxes() + (side < 3 ? side : side + 1);
    for (std::uint32_t i = 0; i < count; ++i)
      values[i] = side < 3 ? boxes[std::size_t(8) * i] : -boxes[std::size_t(8) * i];
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    ids_[i] = i;
    clusters_[i] = {i, 0, grains_.primitives(i), 0};
  }
}

template <class S>
void LocalClusterBuilder<S>::merge_all(KernelSet kernels) {
  const ClusterKernels& table = cluster_kernels(kernels);
  while (active_ > 1) {
    (radius_ == 8 ? table.nearest8 : table.nearest16)({row(0), stride_, active_, nearest_.data()});
    searched_ += active_;
    match();
    active_ = merge_round();
    for (std::size_t side = 0; side < 6; ++side) std::fill_n(row(side) + active_, most_radius, -infinity);
  }
}

/// Chooses which clusters merge: those that chose each other. Where sizes grow along the curve, each cluster
/// chooses a smaller one, and hardly any two choose each other; then a cluster also merges with its choice if
/// that is still free. At most 2 * radius clusters choose the same one, so every round merges a fixed share
/// of all clusters.
template <class S>
void LocalClusterBuilder<S>::match() {
  std::uint32_t matched = 0;
  for (std::uint32_t i = 0; i < active_; ++i) {
    const std::uint32_t other = nearest_[i];
    const bool mutual = nearest_[other] == i;
    partner_[i] = mutual ? other : i;
    matched += mutual ? 1 : 0;
  }
  if (matched / 2 * least_share >= active_) return;
  for (std::uint32_t i = 0; i < active_; ++i) {
    const std::uint32_t other = nearest_[i];
    if (partner_[i] != i || partner_[other] != other) continue;
    partner_[i] = other;
    partner_[other] = i;
  }
}

/// Merges all clusters with their partners, in place; returns the number of remaining clusters.
template <class S>
std::uint32_t LocalClusterBuilder<S>::merge_round() {
  std::uint32_t left = 0;
  float* rows[6];
  for (std::size_t side = 0; side < 6; ++side) rows[side] = row(side);
  for (std::uint32_t i = 0; i < active_; ++i) {
    const std::uint32_t other = partner_[i];
    if (other < i) continue;
    float box[6];
    for (std::size_t side = 0; side < 6; ++side) {
      box[side] = std::min(rows[side][i], rows[side][other]);
      rows[side][left] = box[side];
    }
    std::uint32_t id = ids_[i];
    if (other != i) {
      const std::uint32_t second = ids_[other];
      const float x = box[0] + box[3], y = box[1] + box[4], z = box[2] + box[5];
      clusters_[made_] = {id, second, clusters_[id].primitives + clusters_[second].primitives,
                          x * y + y * z + z * x};
      id = made_++;
    }
    ids_[left++] = id;
  }
  KBVH_ASSERT(left < active_);
  return left;
}

template <class S>
std::size_t LocalClusterBuilder<S>::bytes() const {
  return grains_.bytes() + clusters_.capacity() * sizeof(Cluster) + rows_.capacity() * sizeof(float) +
         (ids_.capacity() + nearest_.capacity() + partner_.capacity() + parts_.capacity() +
          open_.capacity()) *
             sizeof(std::uint32_t);
}

namespace {

using PartBox = std::array<float, 8>;
constexpr PartBox empty_box{infinity, infinity, infinity, 0, -infinity, -infinity, -infinity, 0};

void extend(PartBox& box, const float* other) {
  for (std::size_t side = 0; side < 3; ++side) {
    box[side] = std::min(box[side], other[side]);
    box[side + 4] = std::max(box[side + 4], other[side + 4]);
  }
}
/// Returns half the surface.
float surface(const PartBox& box) {
  const float x = box[4] - box[0], y = box[5] - box[1], z = box[6] - box[2];
  return x * y + y * z + z * x;
}

template <class S>
struct BinnedSource {
  using Part = typename BinnedBuilder<S>::Part;
  const Grains<S>& grains;
  const CurveOrder<S>& order;
  std::uint32_t* items;
  const ClusterKernels& kernels;
  std::uint32_t *entries, *end;
  alignas(64) float bin_boxes[3][sah_bins][8] = {};
  std::uint32_t bin_counts[3][sah_bins] = {};

  std::uint32_t count(const Part& part) const { return (part.end - part.begin) * grains.size(); }
  static double weight(const Part& part) { return surface(part.box); }
  std::pair<std::uint32_t, std::uint32_t> leaf(const Part& part) {
    const auto begin = std::uint32_t(end - entries);
    for (std::uint32_t k = part.begin; k < part.end; ++k) end = grains.write(order, items[k], end);
    return {begin, std::uint32_t(end - entries)};
  }
  std::pair<Part, Part> split(const Part& part) {
    BinsJob job{grains.boxes(),      items + part.begin, part.end - part.begin, {}, {},
                &bin_boxes[0][0][0], &bin_counts[0][0]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      job.lower[axis] = 2 * part.box[axis];
      const float scale = float(sah_bins) / (2 * (part.box[axis + 4] - part.box[axis]));
      job.scale[axis] = std::isfinite(scale) ? scale : 0.0F;
    }
    kernels.bins(job);
    std::uint32_t axis = 0, last_bin = 0;
    if (!best_plane(job.count, axis, last_bin)) return halves(part);
    const std::uint32_t middle = part.begin + kernels.partition(job, items + part.begin, axis, last_bin);
    std::pair<Part, Part> parts{{part.begin, middle, empty_box}, {middle, part.end, empty_box}};
    for (std::uint32_t b = 0; b < sah_bins; ++b)
      extend(b <= last_bin ? parts.first.box : parts.second.box, bin_boxes[axis][b]);
    return parts;
  }

 private:
  /// Finds the plane of least cost; returns false if all items lie in one bin of each axis.
  bool best_plane(std::uint32_t count, std::uint32_t& best_axis, std::uint32_t& last_bin) const {
    float least = infinity;
    std::uint32_t least_larger = 0;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      float right_cost[sah_bins];
      PartBox box = empty_box;
      std::uint32_t in_box = 0;
      for (std::uint32_t b = sah_bins - 1; b > 0; --b) {
        extend(box, bin_boxes[axis][b]);
        in_box += bin_counts[axis][b];
        right_cost[b] = in_box == 0 ? infinity : surface(box) * float(in_box);
      }
      box = empty_box;
      in_box = 0;
      for (std::uint32_t b = 0; b + 1 < sah_bins; ++b) {
        extend(box, bin_boxes[axis][b]);
        in_box += bin_counts[axis][b];
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

template <class S>
void BinnedBuilder<S>::build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
  tree.clear(order.count());
  if (order.count() == 0) return;
  order.sort(list, Curve::hilbert);
  order.refine_runs(tree.leaf_size());
  grains_.take(order, std::min(grain_, tree.leaf_size()));
  if (items_.size() < grains_.count()) items_.resize(grains_.count());
  Part root{0, grains_.count(), empty_box};
  for (std::uint32_t i = 0; i < grains_.count(); ++i) {
    items_[i] = i;
    extend(root.box, grains_.boxes() + std::size_t(8) * i);
  }
  BinnedSource<S> source{grains_,        order,         items_.data(), cluster_kernels(tree.kernels()),
                         tree.entries(), tree.entries()};
  lay_out(tree, source, root, parts_);
  tree.fit(order.boxes());
}

template <class S>
std::size_t BinnedBuilder<S>::bytes() const {
  return grains_.bytes() + items_.capacity() * sizeof(std::uint32_t) + parts_.capacity() * sizeof(Part);
}

template class LocalClusterBuilder<float>;
template class LocalClusterBuilder<double>;
template class BinnedBuilder<float>;
template class BinnedBuilder<double>;

}  // namespace kbvh
