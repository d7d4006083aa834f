// Spheres and oriented boxes in rows of eight lanes: they contain their points exactly, for clouds of every
// shape and scale, and volumes that touch are found; with every set of kernels, bit by bit.

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/contract/audited_volumes.hpp"
#include "core/families/volumes/obb_hierarchy.hpp"
#include "core/families/volumes/sphere_hierarchy.hpp"
#include "core/judge/audit.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/rational_volumes.hpp"

namespace kbvh::test::lane_volumes_test {
namespace {

template <class S>
struct Cloud {
  Cloud(std::vector<S> points, std::uint32_t leaf_size) : positions(std::move(points)) {
    const auto count = std::uint32_t(positions.size() / 3);
    for (std::uint32_t i = 0; i < count; ++i)
      primitives.add(std::vector<std::uint32_t>{i, (i + 1) % count, (i + 5) % count});
    positions.push_back(0);  // readable past the end
    topology = build_topology(primitives, positions.data(),
                              {.method = BuildMethod::median, .width = 8, .leaf_size = leaf_size});
  }
  std::vector<S> positions;
  Primitives primitives;
  Topology topology;
};

template <class H>
std::string invalid(const H& hierarchy, const Cloud<typename H::Scalar>& cloud) {
  AuditView view{hierarchy.topology(), {}, {}};
  for (const auto& volume : hierarchy.volumes()) view.boxes.push_back(enclosing_box(volume));
  view.volumes = std::make_shared<AuditedVolumes<typename H::Volume>>(hierarchy.volumes());
  const Audit result = audit(view, cloud.primitives, cloud.positions.data());
  return result.topology_error + result.first_fault;
}

template <class H>
PairBuffer found(H& a, H& b) {
  typename H::Scratch scratch;
  std::uint64_t tests = 0;
  PairBuffer out;
  EXPECT_EQ(H::find_pairs(a, 0, b, &a == &b ? 0 : 1, scratch, tests, {}, out), 0U);
  return out;
}

template <class H>
void expect_sound() {
  using S = typename H::Scalar;
  std::optional<std::vector<S>> last;
  for_clouds<S>(31, [&](const std::vector<S>& points, const std::string& where, Random& random) {
    for (const std::uint32_t leaf_size : {1U, 4U}) {
      const Cloud<S> cloud(points, leaf_size);
      // A second cloud with one point in common.
      std::vector<S> more = points_of<S>(Shape::cloud, {0, 1}, 17, random);
      const std::size_t here = random.below(std::uint32_t(points.size() / 3)), there = random.below(17);
      for (std::size_t d = 0; d < 3; ++d) more[3 * there + d] = points[3 * here + d];
      const Cloud<S> other(more, leaf_size);
      std::vector<typename H::Volume> first;
      for (const KernelSet set : supported_kernel_sets()) {
        for (const Cover cover : {Cover::vertices, Cover::boxes}) {
          H a(cloud.topology, cloud.primitives, cover, set), b(other.topology, other.primitives, cover, set);
          a.refit(cloud.positions.data());
          b.refit(other.positions.data());
          ASSERT_EQ(invalid(a, cloud), "") << where << ", kernels " << name(set);
          ASSERT_EQ(invalid(b, other), "") << where << ", kernels " << name(set);
          std::size_t touching = 0;
          for (const auto& pair : found(a, b)) {
            const auto one = cloud.primitives[pair.primitive_a], two = other.primitives[pair.primitive_b];
            touching += std::count(one.begin(), one.end(), here) != 0 &&
                        std::count(two.begin(), two.end(), there) != 0;
          }
          const auto with = [](const Primitives& primitives, std::size_t vertex) {
            std::size_t count = 0;
            for (std::uint32_t p = 0; p < primitives.count(); ++p)
              count += std::count(primitives[p].begin(), primitives[p].end(), vertex) != 0;
            return count;
          };
          ASSERT_EQ(touching, with(cloud.primitives, here) * with(other.primitives, there))
              << where << ", kernels " << name(set);
          if (cover == Cover::boxes) continue;
          if (first.empty()) first = a.volumes();
          ASSERT_TRUE(first == a.volumes()) << where << ", kernels " << name(set);
        }
      }
    }
  });
}
TEST(LaneVolumes, WrappedSpheresAreSound) {
  expect_sound<SphereHierarchy<float, SphereBounds::wrapped>>();
  expect_sound<SphereHierarchy<double, SphereBounds::wrapped>>();
}
TEST(LaneVolumes, LayeredSpheresAreSound) {
  expect_sound<SphereHierarchy<float, SphereBounds::layered>>();
  expect_sound<SphereHierarchy<double, SphereBounds::layered>>();
}
TEST(LaneVolumes, OrientedBoxesAreSound) {
  expect_sound<ObbHierarchy<float>>();
  expect_sound<ObbHierarchy<double>>();
}

// Axes stay at right angles up to 16 roundings while the points move far from where the frames were chosen.
template <class S>
void expect_orthonormal() {
  Random random(5);
  std::vector<S> points(3 * 400);
  for (S& x : points) x = S(random.unit());
  Cloud<S> cloud(points, 4);
  for (const bool follow : {true, false}) {
    ObbHierarchy<S> boxes(cloud.topology, cloud.primitives, Cover::vertices);
    boxes.set_rule({follow, 3});
    for (int step = 0; step < 7; ++step) {
      boxes.refit(cloud.positions.data());
      EXPECT_EQ(invalid(boxes, cloud), "");
      for (const Obb<S>& box : boxes.volumes())
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j <= i; ++j) {
            double product = 0;
            for (int d = 0; d < 3; ++d) product += double(box.axis[i][d]) * double(box.axis[j][d]);
            EXPECT_LE(std::abs(product - (i == j)), 8 * double(std::numeric_limits<S>::epsilon()));
          }
      for (std::size_t i = 0; i < points.size(); ++i)
        cloud.positions[i] = step == 3 ? S(0.25) : cloud.positions[i] + S(random.unit()) * S(step % 2);
    }
  }
}
TEST(LaneVolumes, AxesStayAtRightAngles) {
  expect_orthonormal<float>();
  expect_orthonormal<double>();
}

// A wrapped sphere is no larger than a layered one around the same centre, up to roundings.
TEST(LaneVolumes, WrappedSpheresAreTighter) {
  Random random(6);
  std::vector<float> points(3 * 2000);
  for (float& x : points) x = float(random.unit());
  const Cloud<float> cloud(points, 2);
  SphereHierarchy<float, SphereBounds::wrapped> wrapped(cloud.topology, cloud.primitives, Cover::vertices);
  SphereHierarchy<float, SphereBounds::layered> layered(cloud.topology, cloud.primitives, Cover::vertices);
  wrapped.refit(cloud.positions.data());
  layered.refit(cloud.positions.data());
  double sums[2] = {0, 0};
  for (std::uint32_t node = 0; node < cloud.topology.size(); ++node) {
    EXPECT_LE(wrapped.volume(node).radius, layered.volume(node).radius * 1.00001F);
    sums[0] += double(wrapped.volume(node).radius);
    sums[1] += double(layered.volume(node).radius);
  }
  EXPECT_LT(sums[0], sums[1]);
}

TEST(LaneVolumes, OfNothingFindNothing) {
  const Primitives none;
  SphereHierarchy<float, SphereBounds::wrapped> spheres(Topology{}, none, Cover::vertices);
  ObbHierarchy<float> boxes(Topology{}, none, Cover::vertices);
  const float past_the_end = 0;
  spheres.refit(&past_the_end);
  boxes.refit(&past_the_end);
  EXPECT_TRUE(found(spheres, spheres).empty());
  EXPECT_TRUE(found(boxes, boxes).empty());
}

}  // namespace
}  // namespace kbvh::test::lane_volumes_test
