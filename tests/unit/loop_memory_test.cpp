// What a simulation allocates once it is warm, and that its memory does not grow with its steps: this test
// counts every allocation of its program.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "experiments/loop/simulation.hpp"
#include "loop_simulator.hpp"
#include "tests/program/temporary_folder.hpp"

namespace {
std::atomic<std::uint64_t> allocations{0};
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define KBVH_COUNTS_ALLOCATIONS 1
extern "C" void* __libc_malloc(std::size_t size) noexcept;
// In place of the library's: operator new, Eigen and everything else come here.
extern "C" void* malloc(std::size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}
#else
#define KBVH_COUNTS_ALLOCATIONS 0
#endif

namespace kbvh::experiments::loop {
namespace loop_memory_test {

/// Returns the memory that is in use, in bytes.
std::uint64_t bytes_in_use() {
  const auto info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

TEST(LoopMemory, AnIterateWithKnownBlocksTakesWhatANumericFactorisationTakes) {
  if (KBVH_COUNTS_ALLOCATIONS == 0) GTEST_SKIP() << "allocations are not counted in this build";
  MeshBuilder builder;
  builder.add_cloth({40, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {});
  const SimulatedMesh mesh = builder.finish();
  NewtonSystem system(mesh);
  Positions direction;
  for (int iterate = 0; iterate < 6; ++iterate) {
    const std::uint64_t before = allocations;
    system.clear();
    for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
      system.add_gradient(v, Eigen::Vector3d(1, 2, double(v)));
      system.add_block(v, Eigen::Matrix3d(Eigen::Vector3d(5, 6, 7).asDiagonal()));
    }
    for (const Spring& spring : mesh.springs)
      if (iterate % 2 == 0 || spring.a % 7 != 0)
        system.add_block(spring.a, spring.b, 0.1 * Eigen::Matrix3d::Identity());
    system.solve(direction);
    if (iterate > 0) {
      EXPECT_LE(allocations - before, 4u) << iterate;
    }
  }
  EXPECT_EQ(system.orders(), 1u);
}

TEST(LoopMemory, AStepTakesWhatItsOrdersTake) {
  if (KBVH_COUNTS_ALLOCATIONS == 0) GTEST_SKIP() << "allocations are not counted in this build";
  Simulator simulator(make_scene("sphere", 200, 1));
  for (int i = 0; i < 150; ++i) simulator.advance();
  std::uint64_t iterates = 0, orders = 0;
  const std::uint64_t before = allocations;
  for (int i = 0; i < 40; ++i) {
    const StepReport report = simulator.advance();
    iterates += report.iterates;
    orders += report.orders;
  }
  EXPECT_GE(orders, 40u);
  EXPECT_LE(orders, iterates);
  // A numeric factorisation each iterate, a symbolic one each order, and lists that grew.
  EXPECT_LE(allocations - before, 4 * iterates + 40 * orders + 40)
      << iterates << " iterates, " << orders << " orders";
}

TEST(LoopMemory, DoesNotGrowWithTheSteps) {
  TemporaryFolder folder;
  SimulationOptions options;
  options.scene = "sheets";
  options.triangles = 150;
  options.steps = 400;
  options.record = true;
  options.folder = folder / "out";
  std::uint64_t early = 0, late = 0, most_contacts = 0;
  simulate(options, [&](const nlohmann::json& record) {
    const auto step = record["step"].get<std::uint64_t>();
    if (step == 200) early = bytes_in_use();
    if (step == 400) late = bytes_in_use();
    most_contacts = std::max(most_contacts, record["contacts"].get<std::uint64_t>());
    EXPECT_GT(record["memory_bytes"].get<std::uint64_t>(), 0u);
  });
  EXPECT_GT(most_contacts, 30u);
  // One array of positions a step would be 200 * 24 * 400 bytes.
  EXPECT_LE(late, early + early / 5 + 100000) << early;
}

}  // namespace loop_memory_test
}  // namespace kbvh::experiments::loop
