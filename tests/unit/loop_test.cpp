// The simulator in the loop: no penetration in any scene, the same bits in all ways to detect and after a run
// that was ended, conserved momentum, and a seeded fault that everybody sees.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/geometry/triangle_triangle.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/frames.hpp"
#include "experiments/loop/player.hpp"
#include "experiments/loop/simulation.hpp"
#include "loop_simulator.hpp"
#include "tests/program/temporary_folder.hpp"
#include "tests/support/random.hpp"

namespace kbvh::experiments::loop {
namespace loop_test {

using kbvh::test::Random;
using nlohmann::json;

class EveryScene : public testing::TestWithParam<std::string> {};

TEST_P(EveryScene, HasNoPenetrationInTwoHundredSteps) {
  std::uint64_t most_contacts = 0, penetrations = 0;
  double smallest_gap = 1, highest = -1e9, lowest = 1e9;
  const SimulationResult result = simulate(small(GetParam(), 200), [&](const json& record) {
    most_contacts = std::max(most_contacts, record["contacts"].get<std::uint64_t>());
    penetrations += record["penetrations"].get<std::uint64_t>();
    smallest_gap = std::min(smallest_gap, record["smallest_gap_m"].get<double>());
    const double energy = record["kinetic_j"].get<double>() + record["gravitational_j"].get<double>() +
                          record["elastic_j"].get<double>() + record["barrier_j"].get<double>();
    highest = std::max(highest, energy);
    lowest = std::min(lowest, energy);
  });
  EXPECT_EQ(result.state.step, 200u);
  EXPECT_EQ(result.penetrations, 0u);
  EXPECT_EQ(penetrations, 0u);
  EXPECT_EQ(result.stalled, 0u);
  EXPECT_EQ(result.unconverged, 0u);
  EXPECT_GT(most_contacts, 30u);
  EXPECT_GT(smallest_gap, 0);
  EXPECT_TRUE(result.state.positions.allFinite());
  EXPECT_LT(lowest, highest);
}

TEST_P(EveryScene, AllWaysToDetectGiveTheSameBits) {
  SimulationOptions options = small(GetParam(), 30);
  const std::uint64_t refit = hash_of_state(simulate(options).state);
  options.detection = Detection::rebuild;
  EXPECT_EQ(hash_of_state(simulate(options).state), refit);
  for (const double keep : {0.1, 1.0, 5.0}) {
    options.detection = Detection::kept;
    options.keep = keep;
    EXPECT_EQ(hash_of_state(simulate(options).state), refit) << keep;
  }
  options.seed = 2;
  EXPECT_NE(hash_of_state(simulate(options).state), refit);
}

TEST_P(EveryScene, LostPairsAreSeen) {
  SimulationOptions options = small(GetParam(), 100);
  options.lose_every = 1;
  const SimulationResult all = simulate(options);
  EXPECT_GT(all.penetrations, 0u);
  EXPECT_GT(all.first_penetration, 0u);
  options.lose_every = 3;
  EXPECT_GT(simulate(options).penetrations, 0u);
}

TEST_P(EveryScene, StartsApart) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    Simulator simulator(make_scene(GetParam(), 600, seed));
    const SimulatedMesh& mesh = simulator.scene.mesh;
    EXPECT_EQ(simulator.intersecting_pairs(), 0u);
    simulator.finder.look_at(mesh.positions);
    EXPECT_EQ(simulator.step.barrier_energy(mesh.positions), 0) << seed;
    double mass = 0;
    for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
      EXPECT_GT(mesh.mass[v], 0);
      mass += mesh.fixed[v] == 0 ? mesh.mass[v] : 0;
    }
    EXPECT_GT(mass, 0.05);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, testing::ValuesIn(scene_names()),
                         [](const auto& scene) { return scene.param; });

struct Killed {};

TEST(Simulation, GoesOnWithTheSameBitsAfterItWasKilled) {
  TemporaryFolder folder;
  SimulationOptions options = small("sphere", 30);
  options.save_every = 4;
  options.record = true;
  options.folder = folder / "whole";
  const SimulationResult whole = simulate(options);
  options.folder = folder / "killed";
  for (const std::uint64_t last : {std::uint64_t(2), std::uint64_t(7), std::uint64_t(18)}) {
    EXPECT_THROW(simulate(options,
                          [&](const json& record) {
                            if (record["step"] == last) throw Killed{};
                          }),
                 Killed);
  }
  const SimulationResult continued = simulate(options);
  EXPECT_EQ(continued.first_step, 16u);
  EXPECT_EQ(hash_of_state(continued.state), hash_of_state(whole.state));
  const std::vector<json> expected = lines_of(folder / "whole" / "loop.jsonl"),
                          found = lines_of(folder / "killed" / "loop.jsonl");
  ASSERT_EQ(found.size(), 31u);
  ASSERT_EQ(expected.size(), 31u);
  for (std::size_t i = 1; i < found.size(); ++i)
    for (const char* key : {"step", "state", "iterates", "contacts", "kinetic_j", "momentum_kg_m_s"})
      EXPECT_EQ(found[i].at(key), expected[i].at(key)) << i << key;
  EXPECT_EQ(text_of_file(folder / "killed" / "loop.recording"),
            text_of_file(folder / "whole" / "loop.recording"));
  // More steps are a continuation, other options are not.
  options.steps = 32;
  EXPECT_EQ(simulate(options).first_step, 30u);
  options.seed = 2;
  EXPECT_THROW(simulate(options), io::InputError);
  options.seed = 1;
  std::string state = text_of_file(folder / "killed" / "loop.state");
  state[200] ^= 1;
  write_text(folder / "killed" / "loop.state", state);
  EXPECT_THROW(simulate(options), io::InputError);
}

/// A time that is over at once lets each call make one step.
TEST(Simulation, GoesOnWhereItsTimeEnded) {
  const TemporaryFolder folder;
  SimulationOptions options = small("cloths", 5);
  const std::uint64_t expected = hash_of_state(simulate(options).state);
  options.folder = folder / "out";
  options.most_seconds = 1e-9;
  for (std::uint64_t step = 0; step < 5; ++step) {
    const SimulationResult made = simulate(options);
    EXPECT_EQ(made.first_step, step);
    EXPECT_EQ(made.state.step, step + 1);
  }
  const SimulationResult whole = simulate(options);
  EXPECT_EQ(whole.first_step, 5u);
  EXPECT_EQ(hash_of_state(whole.state), expected);
  EXPECT_EQ(lines_of(options.folder / "loop.jsonl").size(), 6u);
}

/// A sheet in flight, with random velocities.
Simulated flying_sheet(const Eigen::Vector3d& gravity) {
  MeshBuilder builder;
  builder.add_cloth({9, {0, 0, 0}, {1, 0, 0.1}, {0, 1, 0}}, {});
  Simulated scene{builder.finish(), {}};
  scene.physics.gravity = gravity;
  Random random(4);
  for (Eigen::Index i = 0; i < scene.mesh.velocities.size(); ++i)
    scene.mesh.velocities.data()[i] = 1 + 0.5 * random.unit();
  return scene;
}

Eigen::Vector3d momentum_of(const Simulated& scene) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::uint32_t v = 0; v < scene.mesh.vertex_count(); ++v)
    sum += scene.mesh.mass[v] * scene.mesh.velocities.row(v).transpose();
  return sum;
}

TEST(ImplicitStep, ConservesMomentumInFlight) {
  for (const Eigen::Vector3d& gravity : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 1, -9.81)}) {
    Simulator simulator(flying_sheet(gravity));
    double mass = 0;
    for (const double one : simulator.scene.mesh.mass) mass += one;
    EXPECT_NEAR(mass, 0.2 * std::sqrt(1.01), 1e-12);  // area density times area
    const Eigen::Vector3d begin = momentum_of(simulator.scene);
    double energy = 1e9;
    for (int i = 1; i <= 50; ++i) {
      const StepReport report = simulator.advance();
      EXPECT_EQ(report.ending, Ending::converged);
      const Eigen::Vector3d expected = begin + mass * (simulator.scene.physics.time_step * i) * gravity;
      EXPECT_LE((report.momentum - expected).norm(), 1e-11) << i;
      // Implicit Euler takes energy away and never adds any.
      const double now = report.kinetic + report.elastic + report.barrier;
      if (gravity.isZero()) {
        EXPECT_LE(now, energy * (1 + 1e-9));
      }
      energy = now;
    }
  }
}

/// Two sheets that fly into each other, both free: contact conserves momentum.
TEST(ImplicitStep, ConservesMomentumInAnImpact) {
  MeshBuilder builder;
  builder.add_cloth({7, {0, 0, 0}, {0.5, 0, 0.02}, {0, 0.5, 0}}, {});
  builder.add_cloth({7, {0.1, 0.05, 0.05}, {0.5, 0, 0}, {0, 0.5, 0.01}}, {});
  Simulated scene{builder.finish(), {}};
  scene.physics.gravity.setZero();
  for (Eigen::Index v = 0; v < scene.mesh.velocities.rows(); ++v)
    scene.mesh.velocities(v, 2) = v < 49 ? 1 : -1.5;
  Simulator simulator(std::move(scene), Detection::kept, 2e-3);
  const Eigen::Vector3d begin = momentum_of(simulator.scene);
  std::uint64_t most_contacts = 0;
  for (int i = 0; i < 40; ++i) {
    const StepReport report = simulator.advance();
    most_contacts = std::max(most_contacts, report.contacts);
    EXPECT_EQ(simulator.intersecting_pairs(), 0u);
    EXPECT_LE((report.momentum - begin).norm(), 2e-5 * begin.norm()) << i;
  }
  EXPECT_GT(most_contacts, 20u);
}

/// A soft box slides on a floor: friction takes coefficient * gravity of its speed, then it stands still.
TEST(ImplicitStep, FrictionStopsWhatSlides) {
  for (const double friction : {0.0, 0.3}) {
    MeshBuilder builder;
    const std::vector<Eigen::Vector3d> floor{{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}};
    const std::vector<Eigen::Vector3<std::uint32_t>> floor_faces{{0, 1, 2}, {0, 2, 3}};
    builder.add_obstacle(floor, floor_faces);
    const std::uint32_t first = builder.add_soft_box({-0.1, -0.13, 0.0031}, 0.2, 2, 100, 2000);
    Simulated scene{builder.finish(), {}};
    scene.physics.friction = friction;
    constexpr double speed = 1.2;
    for (Eigen::Index v = first; v < scene.mesh.velocities.rows(); ++v) scene.mesh.velocities(v, 0) = speed;
    Simulator simulator(std::move(scene));
    double at_20 = 0, at_35 = 0, last = 0;
    for (int i = 1; i <= 80; ++i) {
      last = simulator.advance().momentum[0] / 0.8;  // kg
      if (i == 20) at_20 = last;
      if (i == 35) at_35 = last;
    }
    if (friction == 0) {
      EXPECT_NEAR(last, speed, 1e-3);
    } else {
      EXPECT_NEAR(at_20 - at_35, 0.3 * 9.81 * 0.15, 0.1 * 0.3 * 9.81 * 0.15);
      EXPECT_NEAR(last, 0, 0.02);
    }
    EXPECT_EQ(simulator.intersecting_pairs(), 0u);
  }
}

TEST(PenetrationCheck, CountsWhatAllPairsCount) {
  Simulated scene = make_scene("cloths", 200, 1);
  Random random(5);
  PenetrationCheck check(scene.mesh);
  std::uint64_t sum = 0;
  for (const double noise : {0.0, 0.02, 0.1, 0.5}) {
    Positions x = scene.mesh.positions;
    for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] += noise * random.unit();
    std::uint64_t expected = 0;
    const FaceList& faces = scene.mesh.faces;
    for (Eigen::Index a = 0; a < faces.rows(); ++a)
      for (Eigen::Index b = 0; b < a; ++b) {
        bool incident = false;
        for (int i = 0; i < 9; ++i) incident = incident || faces(a, i / 3) == faces(b, i % 3);
        const auto at = [&](Eigen::Index face, int k) { return x.data() + std::size_t(3) * faces(face, k); };
        expected +=
            !incident && triangles_intersect(at(a, 0), at(a, 1), at(a, 2), at(b, 0), at(b, 1), at(b, 2));
      }
    EXPECT_EQ(check.intersecting_pairs(x), expected) << noise;
    sum += expected;
  }
  EXPECT_GT(sum, 100u);
}

TEST(Simulation, FramesAreTheStatesAsObjFiles) {
  TemporaryFolder folder;
  SimulationOptions options = small("stack", 4);
  options.folder = folder / "out";
  options.frames_every = 2;
  const State last = simulate(options).state;
  EXPECT_EQ(io::numbered_frames(folder / "out" / "frames").size(), 3u);
  const io::AnimatedMesh mesh = io::read_frames(folder / "out" / "frames", 50);
  ASSERT_EQ(mesh.vertex_count, std::uint32_t(last.positions.rows()));
  ASSERT_EQ(mesh.keyframe_times.size(), 3u);
  const Positions first = make_scene("stack", options.triangles, 1).mesh.positions;
  const std::size_t size = std::size_t(first.size());
  for (std::size_t i = 0; i < size; ++i) {
    EXPECT_EQ(mesh.positions[i], first.data()[i]);
    EXPECT_EQ(mesh.positions[2 * size + i], last.positions.data()[i]);
  }
}

/// A recording of a few steps.
class Recorded : public testing::Test {
 protected:
  void SetUp() override {
    SimulationOptions options = small("sheets", 25);
    options.record = true;
    options.folder = folder_ / "out";
    simulate(options);
    file_ = folder_ / "out" / "loop.recording";
  }
  TemporaryFolder folder_;
  std::filesystem::path file_;
};

TEST_F(Recorded, HoldsEveryIterate) {
  const Simulated scene = make_scene("sheets", 200, 1);
  RecordingReader reader(file_);
  EXPECT_TRUE(reader.header().mesh.edges == scene.mesh.edges);
  EXPECT_TRUE(reader.header().mesh.faces == scene.mesh.faces);
  EXPECT_EQ(reader.header().mesh.obstacle, scene.mesh.obstacle);
  EXPECT_EQ(reader.header().mesh.inner, scene.mesh.inner);
  EXPECT_EQ(reader.header().radius, scene.physics.radius());
  EXPECT_EQ(reader.header().separation, scene.physics.thickness);
  std::uint64_t iterates = 0, expected = 0;
  for (const json& line : lines_of(folder_ / "out" / "loop.jsonl"))
    if (line.contains("iterates")) expected += line["iterates"].get<std::uint64_t>();
  RecordedIterate former, iterate;
  for (; reader.next(iterate); ++iterates) {
    if (iterates == 0) {
      EXPECT_TRUE(iterate.begin == scene.mesh.positions);
    } else {
      EXPECT_EQ(iterate.step, iterate.iterate == 0 ? former.step + 1 : former.step);
      EXPECT_TRUE(iterate.iterate == 0 || iterate.iterate == former.iterate + 1);
    }
    const double largest = (iterate.end - iterate.begin).cwiseAbs().maxCoeff();
    EXPECT_GE(iterate.displacement, largest);
    EXPECT_LE(iterate.displacement, largest * (1 + 1e-12));
    former = iterate;
  }
  EXPECT_EQ(iterates, expected);
  EXPECT_EQ(former.step, 24u);
}

TEST_F(Recorded, AllWaysAgreeOnIt) {
  PlaySettings settings;
  settings.truth_every = 20;
  const PlayResult result = play(file_, settings);
  EXPECT_EQ(result.steps, 25u);
  EXPECT_GE(result.truths, 2u);
  EXPECT_GT(result.true_pairs, 0u);
  ASSERT_EQ(result.ways.size(), 15u);
  for (const PlayedWay& way : result.ways) {
    EXPECT_EQ(way.differences, 0u) << name(way.question) << name(way.detection) << way.keep;
    EXPECT_EQ(way.lacking, 0u) << name(way.question) << name(way.detection) << way.keep;
    EXPECT_GT(way.over_refit, 0);
    EXPECT_GT(way.listed, 0u);
    if (way.detection == Detection::kept && way.keep == 2) {
      EXPECT_LT(way.searches, 2 * result.iterates);
    }
  }
  EXPECT_TRUE(result.agree());
}

TEST_F(Recorded, AWayThatLosesPairsIsFound) {
  PlaySettings settings;
  settings.truth_every = 1;
  settings.keep = {1};
  settings.lose_every = 5;
  const PlayResult result = play(file_, settings);
  EXPECT_FALSE(result.agree());
  for (const PlayedWay& way : result.ways) {
    if (way.question == IterateQuestion::impact) continue;
    EXPECT_EQ(way.differences > 0, way.detection == Detection::kept);
    EXPECT_EQ(way.lacking > 0, way.detection == Detection::kept);
  }
}

TEST_F(Recorded, StrategiesAnswerLikeTheBroadPhase) {
  PlaySettings settings;
  settings.truth_every = 20;
  settings.strategies = {{"bottom_up", {"bottom_up"}}, {"lbvh", {"lbvh"}}};
  const PlayResult result = play(file_, settings);
  EXPECT_GT(result.true_pairs, 0u);
  ASSERT_EQ(result.ways.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const PlayedWay& way = result.ways[i];
    EXPECT_EQ(way.question, i < 3 ? IterateQuestion::swept : IterateQuestion::impact);
    EXPECT_EQ(way.strategy, i % 3 == 0 ? "" : settings.strategies[i % 3 - 1].label);
    EXPECT_EQ(way.differences, 0u) << way.strategy;
    EXPECT_EQ(way.lacking, 0u) << way.strategy;
    EXPECT_EQ(way.listed, result.ways[0].listed) << way.strategy;
    if (i % 3 > 0) {
      EXPECT_EQ(way.searches, 2 * result.iterates) << way.strategy;
    }
  }
  EXPECT_TRUE(result.agree());

  settings.lose_every = 5;
  settings.truth_every = 1;
  PlayResult lossy = play(file_, settings);
  EXPECT_FALSE(lossy.agree());
  for (const PlayedWay& way : lossy.ways) {
    if (way.question == IterateQuestion::impact) continue;
    EXPECT_EQ(way.differences > 0, !way.strategy.empty());
    EXPECT_EQ(way.lacking > 0, !way.strategy.empty());
  }
  for (PlayedWay& way : lossy.ways) way.exact = way.strategy.empty();
  EXPECT_TRUE(lossy.agree());
}

TEST_F(Recorded, DamageIsRefused) {
  const std::string whole = text_of_file(file_);
  const auto refused = [&](const std::string& bytes) {
    const std::filesystem::path file = folder_ / "damaged";
    write_text(file, bytes);
    try {
      RecordingReader reader(file);
      RecordedIterate iterate;
      while (reader.next(iterate)) {
      }
    } catch (const io::InputError& problem) {
      return std::string(problem.what()).find("damaged: ") != std::string::npos;
    }
    return false;
  };
  EXPECT_FALSE(refused(whole));
  EXPECT_TRUE(refused(""));
  EXPECT_TRUE(refused("KBVHLOOP"));
  EXPECT_TRUE(refused(whole.substr(0, whole.size() - 1)));
  EXPECT_TRUE(refused(whole + "x"));
  const auto with = [&](std::size_t at, char value) {
    std::string bytes = whole;
    bytes[at] = value;
    return bytes;
  };
  EXPECT_TRUE(refused(with(0, 'k')));
  EXPECT_TRUE(refused(with(8, 2)));        // version
  EXPECT_TRUE(refused(with(15, '\x7f')));  // vertices
  EXPECT_TRUE(refused(with(23, '\x7f')));  // faces
  EXPECT_TRUE(refused(with(35, '\xff')));  // a negative radius
  EXPECT_TRUE(refused(with(44, 2)));       // neither of an obstacle nor free
  std::uint32_t vertices = 0;
  std::memcpy(&vertices, whole.data() + 12, 4);
  EXPECT_TRUE(refused(with(44 + vertices + 3, 1)));      // an edge that names no vertex
  EXPECT_TRUE(refused(with(whole.size() - 1, '\x7f')));  // no number, or out of range
  EXPECT_THROW(RecordingReader(folder_ / "nothing"), io::InputError);
}

TEST(Scenes, UnknownNamesAreRefused) {
  EXPECT_THROW(make_scene("sphere2", 100, 1), std::invalid_argument);
  EXPECT_THROW(scene_title(""), std::invalid_argument);
  EXPECT_THROW(detection("often"), std::invalid_argument);
  for (const std::string& scene : scene_names()) EXPECT_FALSE(scene_title(scene).empty());
  EXPECT_EQ(detection("kept"), Detection::kept);
}

TEST(Scenes, SurfacesAreClosedAndSizesFollow) {
  const Simulated stack = make_scene("stack", 1000, 1);
  EXPECT_GT(stack.mesh.inner.size(), 100u);
  // Boxes: 12 triangles for each square of a side's cells; floor: 32.
  EXPECT_NEAR(double(stack.mesh.faces.rows()), 1000, 150);
  // Volume by the divergence theorem: all faces of a box turn outward.
  double volume = 0;
  for (Eigen::Index f = 32; f < stack.mesh.faces.rows(); ++f) {
    const auto corner = [&](int k) {
      return Eigen::Vector3d(stack.mesh.positions.row(stack.mesh.faces(f, k)));
    };
    Eigen::Matrix3d corners;
    corners << corner(0), corner(1), corner(2);
    volume += corners.determinant() / 6;
  }
  EXPECT_NEAR(volume, 3 * 0.008, 1e-3);
  EXPECT_NEAR(double(make_scene("sphere", 4000, 1).mesh.faces.rows()), 4000 + 2000, 300);
  EXPECT_NEAR(double(make_scene("sheets", 4000, 1).mesh.faces.rows()), 4000 + 128, 200);
  EXPECT_NEAR(double(make_scene("cloths", 4000, 1).mesh.faces.rows()), 4000, 200);
}

}  // namespace loop_test
}  // namespace kbvh::experiments::loop
