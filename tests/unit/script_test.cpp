// Bodies that follow a script: where they are, how well they follow it, that contact holds them back, and
// that a run that was killed finds them where it left them.
#include "experiments/loop/script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "experiments/loop/simulation.hpp"
#include "loop_simulator.hpp"
#include "tests/program/temporary_folder.hpp"

namespace kbvh::experiments::loop {
namespace script_test {

using nlohmann::json;

TEST(Script, BeginsSmoothlyInThePoseOfTheMesh) {
  for (const char* scene : {"walker", "knot"}) {
    const SimulatedMesh mesh = make_scene(scene, 400, 1).mesh;
    ScriptPlayer script(mesh);
    EXPECT_GT(script.driven().size(), 20u);
    EXPECT_LT(script.driven().size(), mesh.vertex_count());
    Positions x = mesh.positions;
    script.place(0, x);
    EXPECT_TRUE(x == mesh.positions) << scene;
    script.place(0.01, x);
    EXPECT_LT(script.largest_distance(x, mesh.positions), 2e-3) << scene;
    script.place(0.6, x);
    EXPECT_GT(script.largest_distance(x, mesh.positions), 0.1) << scene;
    for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
      if (!mesh.is_driven(v)) {
        EXPECT_TRUE(x.row(v) == mesh.positions.row(v));
      }
  }
}

TEST(Script, JointsAreRigidAndHoldTogether) {
  const SimulatedMesh mesh = make_scene("walker", 400, 1).mesh;
  std::vector<Pose> poses;
  double most_turned = 0;
  for (const double time : {0.0, 0.13, 0.5, 0.77, 3.0, 99.99}) {
    pose_joints(mesh.joints, time, poses);
    ASSERT_EQ(poses.size(), mesh.joints.size());
    for (std::size_t j = 0; j < poses.size(); ++j) {
      const Pose& pose = poses[j];
      EXPECT_LT((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-13);
      EXPECT_GT(pose.rotation.determinant(), 0);
      const Joint& joint = mesh.joints[j];
      if (joint.parent < 0) continue;
      ASSERT_LT(std::size_t(joint.parent), j);
      const Pose& parent = poses[std::size_t(joint.parent)];
      const Eigen::Vector3d here = pose.rotation * joint.pivot + pose.shift,
                            there = parent.rotation * joint.pivot + parent.shift;
      EXPECT_LT((here - there).norm(), 1e-12) << time;
      most_turned = std::max(most_turned, (pose.rotation - parent.rotation).norm());
    }
  }
  EXPECT_GT(most_turned, 0.5);
}

TEST(Script, AJointTurnsAsItsNumbersSay) {
  Joint joint;
  joint.pivot = {1, 0, 0};
  joint.turn = 2;
  joint.travel = {0, 0, 3};
  joint.period = 4;
  std::vector<Pose> poses;
  // Half a period; 0.25 s of the turn are lost while it starts.
  pose_joints({joint}, 2, poses);
  const Eigen::Vector3d at = poses[0].rotation * Eigen::Vector3d(2, 0, 0) + poses[0].shift;
  EXPECT_LT((at - Eigen::Vector3d(1 + std::cos(3.5), std::sin(3.5), 3)).norm(), 1e-12);
  joint.turn = 0;
  joint.bend = 0.3;
  joint.swing = 0.2;
  joint.phase = 0.5;
  pose_joints({joint}, 1, poses);  // a quarter of a period: sin(pi / 2 + phase)
  EXPECT_NEAR(poses[0].rotation(1, 0), std::sin(0.3 + 0.2 * std::cos(0.5)), 1e-12);
  EXPECT_NEAR(poses[0].shift[2], 1.5, 1e-12);
}

TEST(Walker, FollowsItsScriptAndItsSkirtsAreContacts) {
  Simulator simulator(make_scene("walker", 300, 2));
  ScriptPlayer script(simulator.scene.mesh);
  Positions places = simulator.scene.mesh.positions;
  std::uint64_t most_contacts = 0;
  for (int i = 1; i <= 60; ++i) {
    const StepReport report = simulator.advance();
    most_contacts = std::max(most_contacts, report.contacts);
    script.place(i * simulator.scene.physics.time_step, places);
    EXPECT_EQ(script.largest_distance(simulator.state.positions, places), report.lag);
    EXPECT_LT(report.lag, 2e-3) << i;
    EXPECT_EQ(report.ending, Ending::converged) << i;
    EXPECT_EQ(simulator.intersecting_pairs(), 0u) << i;
  }
  EXPECT_GT(most_contacts, 10u);
}

/// A plate that is driven through a floor stays above it.
TEST(Script, ContactHoldsBackWhatIsDriven) {
  for (const std::uint32_t lost : {0u, 1u}) {
    MeshBuilder builder;
    const std::vector<Eigen::Vector3d> floor{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    const std::vector<Eigen::Vector3<std::uint32_t>> faces{{0, 1, 2}, {0, 2, 3}};
    builder.add_obstacle(floor, faces);
    constexpr std::uint32_t side = 4;
    const std::uint32_t first =
        builder.add_cloth({side, {-0.2, -0.21, 0.02}, {0.4, 0, 0}, {0, 0.4, 0}}, MeshBuilder::Material{});
    Joint down;
    down.travel = {0, 0, -0.06};
    down.period = 0.4;
    const std::int32_t joint = builder.add_joint(down);
    for (std::uint32_t v = 0; v < side * side; ++v) builder.drive(first + v, joint);
    const Simulated scene{builder.finish(), {}};
    const ContactMesh mesh(scene.mesh);
    ContactFinder finder(mesh, {Detection::refit, 0, scene.physics.radius(), lost});
    ImplicitStep step(scene, finder);
    State state = first_state(scene.mesh);
    PenetrationCheck check(scene.mesh);
    double largest_lag = 0, lowest = 1;
    std::uint64_t penetrations = 0;
    for (int i = 0; i < 40; ++i) {
      largest_lag = std::max(largest_lag, step.advance(state).lag);
      penetrations += check.intersecting_pairs(state.positions);
      for (std::uint32_t v = first; v < first + side * side; ++v)
        lowest = std::min(lowest, state.positions(v, 2));
    }
    if (lost == 0) {
      EXPECT_GT(lowest, scene.physics.thickness);
      EXPECT_GT(largest_lag, 0.035);
      EXPECT_EQ(penetrations, 0u);
    } else {
      EXPECT_NEAR(lowest, -0.04, 1e-3);
      EXPECT_LT(largest_lag, 1e-6);
    }
  }
}

TEST(Knot, TakesTheSlackOutOfARope) {
  Simulator simulator(make_scene("knot", 600, 1));
  const SimulatedMesh& mesh = simulator.scene.mesh;
  // The first vertex of no face is the last one of the second ring: its centre.
  const std::uint32_t stride = (mesh.inner.at(0) + 1) / 2;
  ASSERT_EQ(mesh.vertex_count() % stride, 0u);
  const auto length = [&] {
    double sum = 0;
    for (std::uint32_t v = 2 * stride - 1; v < mesh.vertex_count(); v += stride)
      sum += (simulator.state.positions.row(v) - simulator.state.positions.row(v - stride)).norm();
    return sum;
  };
  const auto apart = [&] {
    return (simulator.state.positions.row(0) -
            simulator.state.positions.row(Eigen::Index(mesh.vertex_count()) - 2))
        .norm();
  };
  const double begin = length(), first_distance = apart();
  double longest = begin, farthest = first_distance;
  for (int i = 0; i < 100; ++i) {
    EXPECT_NE(simulator.advance().ending, Ending::stalled) << i;
    EXPECT_EQ(simulator.intersecting_pairs(), 0u) << i;
    longest = std::max(longest, length());
    farthest = std::max(farthest, apart());
  }
  EXPECT_LT(longest, 1.8 * begin);  // it is elastic
  EXPECT_GT(farthest, first_distance + 0.3);
  EXPECT_LT(farthest, begin);
}

struct Killed {};

TEST(Walker, GoesOnWithTheSameBitsAfterItWasKilled) {
  TemporaryFolder folder;
  SimulationOptions options;
  options.scene = "walker";
  options.triangles = 150;
  options.steps = 20;
  options.save_every = 3;
  options.folder = folder / "whole";
  const State whole = simulate(options).state;
  options.folder = folder / "killed";
  const auto kill = [](const json& record) {
    if (record["step"] == 11) throw Killed{};
  };
  EXPECT_THROW(simulate(options, kill), Killed);
  const SimulationResult continued = simulate(options);
  EXPECT_EQ(continued.first_step, 9u);
  EXPECT_EQ(hash_of_state(continued.state), hash_of_state(whole));
  const std::vector<json> expected = lines_of(folder / "whole" / "loop.jsonl"),
                          found = lines_of(folder / "killed" / "loop.jsonl");
  ASSERT_EQ(found.size(), expected.size());
  EXPECT_GT(expected[0]["mesh"]["driven_vertices"].get<std::uint64_t>(), 100u);
  for (std::size_t i = 1; i < found.size(); ++i)
    for (const char* key : {"step", "state", "lag_m", "orders", "iterates"})
      EXPECT_EQ(found[i].at(key), expected[i].at(key)) << i << key;
}

}  // namespace script_test
}  // namespace kbvh::experiments::loop
