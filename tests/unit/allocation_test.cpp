// Strategies promise that a frame allocates nothing once they are warm: every allocation of this program is
// counted.

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>

#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace {
std::atomic<std::uint64_t> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  void* const memory = alignment == 0
                           ? std::malloc(size)
                           : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
}  // namespace

void* operator new(std::size_t size) {
  return counted(size == 0 ? 1 : size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size == 0 ? 1 : size, std::size_t(alignment));
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace kbvh::test {
namespace {

/// Aligned arrays come from posix_memalign, which no operator counts: memory held is watched as well.
template <class S>
std::string allocations_when_warm(const StrategyEntry& entry, const TestScene<S>& test) {
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred}, CountingPolicy::silent);
  PhaseTimes times;
  PairBuffer pairs;
  for (int round = 0; round < 3; ++round) {
    std::size_t held = 0;
    for (std::size_t f = 0; f < test.frames.size(); ++f) {
      const double t = test.frames[f];
      if (f == 0) {
        session.reset(t);
        session.query(pairs, times);
        held = session.strategy().bytes();
        continue;
      }
      const std::uint64_t before = allocations;
      session.advance(t, times);
      const std::uint64_t advanced = allocations;
      session.query(pairs, times);
      if (round < 2) continue;
      if (allocations != before)
        return "t = " + std::to_string(t) + ": " + std::to_string(advanced - before) +
               " allocations to advance, " + std::to_string(allocations - advanced) + " to query";
      if (session.strategy().bytes() > held)
        return "t = " + std::to_string(t) + ": grew from " + std::to_string(held) + " to " +
               std::to_string(session.strategy().bytes()) + " bytes";
    }
  }
  return {};
}

TEST(Allocation, NoneOnceWarm) {
  for (const char* const name : {"soups", "sheets", "four_bodies_own_keyframes"}) {
    const auto in_float = synthetic_scene<float>(name, 7);
    const auto in_double = synthetic_scene<double>(name, 7);
    for (const StrategyEntry& entry : registry()) {
      // Building is what a rebuild is.
      if (entry.info.guarantee != Guarantee::exact || entry.info.family == "rebuild") continue;
      EXPECT_EQ(allocations_when_warm(entry, in_float), "") << entry.info.id << " on " << name << ", float";
      EXPECT_EQ(allocations_when_warm(entry, in_double), "") << entry.info.id << " on " << name << ", double";
    }
  }
}

TEST(Allocation, IsCounted) {
  const std::uint64_t before = allocations;
  std::vector<int> some(100);
  some[3] = 1;
  EXPECT_GT(allocations - before + std::uint64_t(some[3]), 1u);
}

}  // namespace
}  // namespace kbvh::test
