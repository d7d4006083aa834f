// Bounding volumes against rational arithmetic: the points to which a volume is fitted are inside, exactly;
// volumes that share a point overlap; a point is outside if and only if it protrudes.

#include <gtest/gtest.h>

#include "tests/support/rational_volumes.hpp"

namespace kbvh::test::bounding_volumes_test {
namespace {

template <class V>
class Volumes : public testing::Test {};
using Kinds =
    testing::Types<Box<float>, Box<double>, Dop<float, 14>, Dop<double, 14>, Dop<float, 18>, Dop<double, 18>,
                   Dop<float, 26>, Dop<double, 26>, Sphere<float>, Sphere<double>, Obb<float>, Obb<double>>;
TYPED_TEST_SUITE(Volumes, Kinds);

TYPED_TEST(Volumes, ContainEveryPointExactly) {
  using S = VolumeScalar<TypeParam>;
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    for_clouds<S>(seed, [](const std::vector<S>& points, const std::string& where, Random&) {
      TypeParam volume;
      fit(volume, all(points));
      for (std::size_t i = 0; i < points.size() / 3; ++i)
        ASSERT_TRUE(contains(volume, rational(at(points, i)))) << where;
      const Box<double> box = enclosing_box(volume);
      Box<double> tight;
      for (std::size_t i = 0; i < points.size() / 3; ++i) {
        const double p[3] = {at(points, i)[0], at(points, i)[1], at(points, i)[2]};
        ASSERT_EQ(protrusion(volume, p), 0) << where;
        tight.extend(p);
      }
      ASSERT_TRUE(box.contains(tight)) << where;
    });
}

// Points next to the surface, a few units in the last place to either side.
TYPED_TEST(Volumes, ProtrusionIsZeroExactlyInside) {
  using S = VolumeScalar<TypeParam>;
  std::size_t inside = 0, outside = 0;
  for_clouds<S>(7, [&](const std::vector<S>& points, const std::string& where, Random& random) {
    TypeParam volume;
    fit(volume, all(points));
    for (int trial = 0; trial < 24; ++trial) {
      const S* const from = at(points, random.below(std::uint32_t(points.size() / 3)));
      double p[3];
      for (std::size_t d = 0; d < 3; ++d) {
        p[d] = double(from[d]);
        // Steps of double, and of S.
        const bool own = random.below(2) == 0;
        for (std::uint32_t steps = random.below(4); steps > 0; --steps) {
          const double to = random.below(2) == 0 ? -1e300 : 1e300;
          p[d] = own ? double(std::nextafter(S(p[d]), S(to > 0 ? 1e38 : -1e38))) : std::nextafter(p[d], to);
        }
      }
      const double amount = protrusion(volume, p);
      const bool in = contains(volume, rational(p));
      ASSERT_EQ(amount == 0, in) << where << ": " << amount;
      ASSERT_GE(amount, 0) << where;
      (in ? inside : outside) += 1;
    }
  });
  EXPECT_GT(inside, 300u);
  EXPECT_GT(outside, 300u);
}

TYPED_TEST(Volumes, ProtrusionIsADistance) {
  using S = VolumeScalar<TypeParam>;
  // The corners of a cube of side 2.
  std::vector<S> points;
  for (int corner = 0; corner < 8; ++corner)
    for (int d = 0; d < 3; ++d) points.push_back((corner >> d) & 1 ? S(1) : S(-1));
  TypeParam volume;
  fit(volume, all(points));
  const double reach = std::max(-enclosing_box(volume).lower[0], enclosing_box(volume).upper[0]);
  const double p[3] = {reach + 3, 0, 0};
  EXPECT_NEAR(protrusion(volume, p), 3, 1e-5);
  const double origin[3] = {0, 0, 0};
  EXPECT_EQ(protrusion(volume, origin), 0);
}

TYPED_TEST(Volumes, ContainTheirChildrenExactly) {
  using S = VolumeScalar<TypeParam>;
  Random random(11);
  for (const Place& place : places<S>())
    for (int trial = 0; trial < 40; ++trial) {
      std::vector<TypeParam> children;
      for (std::uint32_t count = 1 + random.below(4); count > 0; --count) {
        const Shape shape = shapes[random.below(7)];
        const Place own{place.offset + (place.offset == 0 ? place.scale * random.unit() : 0),
                        place.scale * std::pow(10.0, -double(random.below(4)))};
        TypeParam child;
        fit(child, all(points_of<S>(shape, own, 1 + random.below(6), random)));
        children.push_back(child);
      }
      // Several levels: parents of parents.
      for (int level = 0; level < 6; ++level) {
        TypeParam parent;
        enclose(parent, std::span<const TypeParam>(children));
        for (const TypeParam& child : children)
          ASSERT_TRUE(contains(parent, child))
              << "offset " << place.offset << ", scale " << place.scale << ", level " << level;
        children[random.below(std::uint32_t(children.size()))] = parent;
      }
    }
}

// Two clouds with a common point, or with points on both sides of one another's segments: any exactly common
// point forbids `false`.
TYPED_TEST(Volumes, OverlapWhereTheyShareAPoint) {
  using S = VolumeScalar<TypeParam>;
  Random random(13);
  std::size_t touching = 0;
  for (const Place& place : places<S>())
    for (int trial = 0; trial < 150; ++trial) {
      auto a = points_of<S>(shapes[random.below(7)], place, 1 + random.below(6), random);
      auto b = points_of<S>(shapes[random.below(7)], place, 1 + random.below(6), random);
      if (trial % 3 != 0) {  // all of b on the other side of its first point, which becomes a's first
        const S shared[3] = {a[0], a[1], a[2]}, moved[3] = {b[0], b[1], b[2]};
        for (std::size_t i = 0; i < b.size(); ++i) {
          const bool first = i < 3;
          const double away = std::fabs(double(b[i]) - double(moved[i % 3]));
          b[i] =
              first ? shared[i % 3] : S(double(shared[i % 3]) + (trial % 3 == 1 ? away : away - place.scale));
        }
        for (std::size_t i = 3; i < a.size() && trial % 3 == 1; ++i)
          a[i] = S(double(shared[i % 3]) - std::fabs(double(a[i]) - double(shared[i % 3])));
      }
      TypeParam va, vb;
      fit(va, all(a));
      fit(vb, all(b));
      bool shared = trial % 3 != 0;
      for (int sample = 0; sample < 20 && !shared; ++sample) {  // convex combinations of a, in b?
        const std::size_t i = random.below(std::uint32_t(a.size() / 3)),
                          j = random.below(std::uint32_t(a.size() / 3));
        const Rational share(int(random.below(9)), 8);
        RationalPoint p;
        for (std::size_t d = 0; d < 3; ++d)
          p[d] = between(exact(double(at(a, i)[d])), exact(double(at(a, j)[d])), share);
        shared = contains(vb, p);
      }
      if (!shared) continue;
      ++touching;
      ASSERT_TRUE(overlap(va, vb)) << "offset " << place.offset << ", scale " << place.scale;
      ASSERT_TRUE(overlap(vb, va));
    }
  EXPECT_GT(touching, 500u);
}

TYPED_TEST(Volumes, DoNotOverlapFarApart) {
  using S = VolumeScalar<TypeParam>;
  Random random(17);
  for (const double scale : {1.0, 1e-30, 1e20})
    for (int trial = 0; trial < 300; ++trial) {
      const auto a = points_of<S>(shapes[random.below(7)], {0, scale}, 5, random);
      auto b = points_of<S>(shapes[random.below(7)], {0, scale}, 5, random);
      const std::size_t axis = random.below(3);
      for (std::size_t i = axis; i < b.size(); i += 3) b[i] += S(8 * scale);
      TypeParam va, vb;
      fit(va, all(a));
      fit(vb, all(b));
      ASSERT_FALSE(overlap(va, vb)) << scale;
    }
}

TYPED_TEST(Volumes, EmptyOnesContainAndOverlapNothing) {
  using S = VolumeScalar<TypeParam>;
  const TypeParam empty;
  TypeParam volume, parent;
  const std::vector<S> points{0, 0, 0, 1, 2, 3};
  fit(volume, all(points));
  EXPECT_FALSE(overlap(empty, volume));
  EXPECT_FALSE(overlap(volume, empty));
  EXPECT_FALSE(overlap(empty, empty));
  EXPECT_EQ(surface_area(empty), 0);
  const double origin[3] = {0, 0, 0};
  EXPECT_EQ(protrusion(empty, origin), std::numeric_limits<double>::infinity());
  EXPECT_TRUE(enclosing_box(empty).empty());
  const std::vector<TypeParam> children{empty, volume, empty}, none{empty, empty};
  enclose(parent, std::span<const TypeParam>(children));
  EXPECT_TRUE(contains(parent, volume));
  enclose(parent, std::span<const TypeParam>(none));
  EXPECT_FALSE(overlap(parent, volume));
  fit(parent, PointSet<S>(points.data(), 0));
  EXPECT_FALSE(overlap(parent, volume));
}

}  // namespace
}  // namespace kbvh::test::bounding_volumes_test
