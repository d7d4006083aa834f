// V and F of Eigen enter a world and leave it without copies.

#include "core/facade/eigen_maps.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace kbvh::test::world_eigen_test {
namespace {

using Faces = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

template <class S>
void a_triangle_falls_through_another() {
  VertexRows<S> fixed(3, 3), clip(6, 3);  // two keyframes of three vertices, one below the other
  fixed << 0, 0, 0, 4, 0, 0, 0, 4, 0;
  clip << 1, 1, 1, 1, 1, 3, 1, 2, 3, 1, 1, -1, 1, 1, 1, 1, 2, 1;
  Faces faces(1, 3);
  faces << 0, 1, 2;
  World world(std::is_same_v<S, float> ? Precision::float32 : Precision::float64);
  const double rest[] = {0}, times[] = {0, 1};
  world.add_body("fixed", {triangle_span(faces)}, rest, vertex_span(fixed));
  world.add_body("falling", {triangle_span(faces)}, times, vertex_span(clip));
  world.start("bottom_up");
  std::vector<WorldPair> pairs;
  world.pairs(pairs);
  EXPECT_TRUE(pairs.empty());
  world.advance(1);
  world.pairs(pairs);
  EXPECT_EQ(pairs, (std::vector<WorldPair>{{0, 0, 1, 0}}));
  const auto now = vertex_rows<S>(world.current_positions(1));
  EXPECT_EQ(now, clip.bottomRows(3));
  EXPECT_EQ(now.data(), world.current_positions(1).data);
}

TEST(WorldEigen, MatricesEnterAndLeaveInPlace) {
  a_triangle_falls_through_another<float>();
  a_triangle_falls_through_another<double>();
  const VertexRows<float> vertices = VertexRows<float>::Random(5, 3);
  EXPECT_EQ(vertex_span(vertices).data(), vertices.data());
  EXPECT_EQ(vertex_span(vertices).size(), 15u);
  const Eigen::Map<const VertexRows<float>> map(vertices.data(), 4, 3);
  EXPECT_EQ(vertex_span(map).data(), vertices.data());
  EXPECT_EQ(vertex_span(map).size(), 12u);
}

TEST(WorldEigen, WrongScalarsAndIndicesAreRefused) {
  VertexRows<double> vertices(3, 3);
  vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0;
  Faces faces(1, 3);
  faces << 0, 1, -2;
  World world(Precision::float64);
  EXPECT_THROW(world.add_body("negative", {triangle_span(faces)}, vertex_span(vertices)), std::invalid_argument);
  faces << 0, 1, 2;
  const std::uint32_t body = world.add_body("resting", {triangle_span(faces)}, vertex_span(vertices));
  world.start("bottom_up");
  EXPECT_THROW(vertex_rows<float>(world.current_positions(body)), std::invalid_argument);
  EXPECT_EQ(vertex_rows<double>(world.current_positions(body)), vertices);
}

}  // namespace
}  // namespace kbvh::test::world_eigen_test
