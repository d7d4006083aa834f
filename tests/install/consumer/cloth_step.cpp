// Steps a cloth that falls over a ridge: positions in matrices of Eigen, contacts from kbvh::broad_phase,
// constraints by projection (position-based dynamics). Links kbvh::broad_phase and Eigen, nothing else.

#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"

using Eigen::Vector3d;

constexpr int side = 24, cloth = side * side;  // vertices; those of the ridge follow, which never move
constexpr double spacing = 0.05, thickness = 0.02, dt = 0.003;

/// The cloth and, behind it, the ridge: one mesh, so that contacts with either are found in the same way.
struct Mesh {
  Eigen::MatrixXd V{cloth + 4, 3};
  Eigen::MatrixXi E, F{2 * (side - 1) * (side - 1) + 2, 3};
  Mesh() {
    int f = 0;
    std::vector<std::pair<int, int>> edges;
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const int v = y * side + x;
        V.row(v) << (x - 0.45 * side) * spacing, (y - 0.5 * side) * spacing,
            0.3 + 0.001 * ((7 * x + 3 * y) % 5);
        if (x + 1 < side) edges.emplace_back(v, v + 1);
        if (y + 1 < side) edges.emplace_back(v, v + side);
        if (x + 1 == side || y + 1 == side) continue;
        edges.emplace_back(v + 1, v + side);
        F.row(f++) << v, v + 1, v + side;
        F.row(f++) << v + 1, v + side + 1, v + side;
      }
    V.bottomRows(4) << -0.3, 0, -0.5, 0.3, 0, -0.5, 0, -2, 0.2, 0, 2, 0.2;
    F.row(f++) << cloth, cloth + 2, cloth + 3;
    F.row(f++) << cloth + 1, cloth + 3, cloth + 2;
    for (const auto& [a, b] : {std::pair(2, 3), {0, 2}, {0, 3}, {1, 2}, {1, 3}})
      edges.emplace_back(cloth + a, cloth + b);
    E.resize(Eigen::Index(edges.size()), 2);
    for (std::size_t e = 0; e < edges.size(); ++e) E.row(Eigen::Index(e)) << edges[e].first, edges[e].second;
  }
};

/// Moves two points apart that are nearer than the thickness. Their difference is the weighted sum of the
/// four vertices.
void separate(Eigen::MatrixXd& V, const int (&v)[4], const double (&weights)[4]) {
  Vector3d gap = Vector3d::Zero();
  double sum = 0;
  for (int i = 0; i < 4; ++i) {
    gap += weights[i] * V.row(v[i]).transpose();
    if (v[i] < cloth) sum += weights[i] * weights[i];
  }
  const double distance = gap.norm();
  if (distance >= thickness || distance < 1e-9 || sum == 0) return;
  gap *= (thickness - distance) / (distance * sum);
  for (int i = 0; i < 4; ++i)
    if (v[i] < cloth) V.row(v[i]) += weights[i] * gap.transpose();
}

void separate_face_vertex(const Mesh& mesh, Eigen::MatrixXd& V, kbvh::Candidate pair) {
  const int v[4] = {int(pair.second), mesh.F(pair.first, 0), mesh.F(pair.first, 1), mesh.F(pair.first, 2)};
  Eigen::Matrix<double, 3, 2> sides;
  sides << (V.row(v[2]) - V.row(v[1])).transpose(), (V.row(v[3]) - V.row(v[1])).transpose();
  const Vector3d from = (V.row(v[0]) - V.row(v[1])).transpose();
  const Eigen::Vector2d at = (sides.transpose() * sides).ldlt().solve(sides.transpose() * from);
  if (at.minCoeff() >= 0 && at.sum() <= 1) separate(V, v, {1, at.sum() - 1, -at[0], -at[1]});
}

void separate_edges(const Mesh& mesh, Eigen::MatrixXd& V, kbvh::Candidate pair) {
  const int v[4] = {mesh.E(pair.first, 0), mesh.E(pair.first, 1), mesh.E(pair.second, 0),
                    mesh.E(pair.second, 1)};
  const Vector3d a = (V.row(v[1]) - V.row(v[0])).transpose(), b = (V.row(v[3]) - V.row(v[2])).transpose();
  const Vector3d w = (V.row(v[0]) - V.row(v[2])).transpose();
  const double aa = a.dot(a), ab = a.dot(b), bb = b.dot(b), det = aa * bb - ab * ab;
  if (det < 1e-6 * aa * bb) return;  // parallel: vertices and faces keep them apart
  const double s = std::clamp((ab * b.dot(w) - bb * a.dot(w)) / det, 0.0, 1.0);
  const double t = std::clamp((b.dot(w) + s * ab) / bb, 0.0, 1.0);
  separate(V, v, {1 - s, s, t - 1, -t});
}

int main() {
  const Mesh mesh;
  Eigen::MatrixXd V = mesh.V, velocity = Eigen::MatrixXd::Zero(V.rows(), 3);
  kbvh::BroadPhase<double> broad;
  broad.build(V, mesh.E, mesh.F, thickness);  // elements within the thickness are candidates, always:
  broad.valid_for(thickness);                 // nothing is detected again until a vertex moved so far
  int iterates = 0, truncated = 0;
  for (int i = 0; i < 160; ++i) {
    const Eigen::MatrixXd before = V;
    velocity.topRows(cloth).col(2).array() -= 9.81 * dt;
    V += dt * velocity;
    for (int iterate = 0; iterate < 10; ++iterate) {
      for (Eigen::Index e = 0; e + 5 < mesh.E.rows(); ++e) {  // all but the ridge's five keep their length
        const int a = mesh.E(e, 0), b = mesh.E(e, 1);
        const double length = (mesh.V.row(a) - mesh.V.row(b)).norm();
        const Vector3d along = (V.row(a) - V.row(b)).transpose();
        const Vector3d half = 0.5 * (1 - length / along.norm()) * along;
        V.row(a) -= half.transpose();
        V.row(b) += half.transpose();
      }
      broad.update(V);
      ++iterates;
      for (const kbvh::Candidate pair : broad.candidates(kbvh::CandidateKind::face_vertex))
        separate_face_vertex(mesh, V, pair);
      for (const kbvh::Candidate pair : broad.candidates(kbvh::CandidateKind::edge_edge))
        separate_edges(mesh, V, pair);
    }
    // What the iterates have left undone: nothing moves beyond the first contact on the straight way.
    broad.update(before, V);
    const kbvh::EarliestImpact impact = broad.earliest_impact();
    if (impact.touches) V = before + 0.9 * impact.begin * (V - before);
    truncated += impact.touches ? 1 : 0;
    velocity = 0.99 * (V - before) / dt;
  }
  broad.update(V);
  kbvh::CandidateBuffer found;
  broad.within(kbvh::CandidateKind::face_vertex, thickness, found);
  const std::size_t contacts = found.size();
  broad.within(kbvh::CandidateKind::edge_face, 0, found);
  std::printf("%d iterates, %d steps cut at a contact, %llu searches\n", iterates, truncated,
              (unsigned long long)broad.detections());
  std::printf("%zu contacts of vertices and faces, %zu edges through faces\n", contacts, found.size());
}
