// Matrices of Eigen as positions and elements of a broad phase, read where they lie.
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Pairs set_of(const CandidateBuffer& found) {
  return {found.begin(), found.end()};
}

/// Returns the edge-edge candidates of what build(broad) takes.
template <class S = double, class Build>
Pairs edges_of(const Build& build) {
  BroadPhase<S> broad;
  build(broad);
  CandidateBuffer found;
  broad.detect_edge_edge_candidates(found);
  return set_of(found);
}

TEST(BroadPhaseOfEigen, MatricesOfAllKindsAreRead) {
  const Mesh<double> mesh = crumpled<double>(12, 1);
  const Eigen::Index n = Eigen::Index(mesh.vertex_count()), m = Eigen::Index(mesh.edges.size() / 2),
                     k = Eigen::Index(mesh.faces.size() / 3);
  const Eigen::Map<const RowMajor> rows(mesh.v0.data(), n, 3);
  const Eigen::MatrixXd columns = rows;
  const Eigen::Map<const Eigen::Matrix<int, Eigen::Dynamic, 2, Eigen::RowMajor>> e_map(mesh.edges.data(), m,
                                                                                       2);
  const Eigen::Map<const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>> f_map(mesh.faces.data(), k,
                                                                                       3);
  const Eigen::MatrixXi e = e_map, f = f_map;
  const Eigen::Matrix<std::int64_t, Eigen::Dynamic, Eigen::Dynamic> wide = e.cast<std::int64_t>();
  const Pairs expected = brute_force(mesh, CandidateKind::edge_edge, 0.1);
  ASSERT_GT(expected.size(), 100u);
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(rows, e_map, f_map, 0.1); }), expected);
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(columns, e, f, 0.1); }), expected);
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(columns, wide, f, 0.1); }), expected);
  const Eigen::Ref<const Eigen::MatrixXd> reference = columns;
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(reference, e, f, 0.1); }), expected);
  Eigen::MatrixXd larger = Eigen::MatrixXd::Constant(n + 5, 7, 1e9);
  larger.block(2, 3, n, 3) = columns;
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(larger.block(2, 3, n, 3), e, f, 0.1); }), expected);
  EXPECT_EQ(edges_of([&](auto& broad) { broad.build(columns, Eigen::MatrixXi(0, 2), f, 0.1); }), Pairs());
  // No matrix at all: of one number and more columns.
  EXPECT_EQ(edges_of([&](auto& broad) {
              broad.build(Eigen::MatrixXd(0, 3), Eigen::MatrixXi(), Eigen::MatrixXi());
            }),
            Pairs());
}

TEST(BroadPhaseOfEigen, MotionsAndUpdates) {
  const Mesh<float> mesh = crumpled<float>(12, 1);
  const Eigen::Index n = Eigen::Index(mesh.vertex_count());
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const Eigen::Map<const Rows> v(mesh.v0.data(), n, 3);
  Mesh<float> moving = mesh;
  moving.v1 = crumpled<float>(12, 2).v0;
  const Eigen::MatrixXf end = Eigen::Map<const Rows>(moving.v1.data(), n, 3);
  const Eigen::Map<const Eigen::Matrix<int, Eigen::Dynamic, 2, Eigen::RowMajor>> e(
      mesh.edges.data(), Eigen::Index(mesh.edges.size() / 2), 2);
  const Eigen::Map<const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>> f(
      mesh.faces.data(), Eigen::Index(mesh.faces.size() / 3), 3);
  const Pairs swept = brute_force(moving, CandidateKind::edge_edge, 0.1F);
  EXPECT_EQ(edges_of<float>([&](auto& broad) { broad.build(v, end, e, f, 0.1F); }), swept);
  EXPECT_EQ(edges_of<float>([&](auto& broad) {
              broad.build(v, e, f, 0.1F);
              broad.update(v, end);
            }),
            swept);
  EXPECT_EQ(edges_of<float>([&](auto& broad) {
              broad.build(end, e, f, 0.1F);
              broad.update(v);
            }),
            brute_force(mesh, CandidateKind::edge_edge, 0.1F));
}

}  // namespace
}  // namespace kbvh::test::broad_phase
