// Steps through the events of a kinetic AABB tree: prints the scheduled events, the bounds that an event
// touches, and the new certificates.

#include <cstdio>
#include <exception>
#include <vector>

#include "core/facade/world.hpp"

namespace {

void print(const kbvh::WorldEvent& event) {
  static const char* const sides[] = {"lower x", "upper x", "lower y", "upper y", "lower z", "upper z"};
  std::printf("t = %.6g: node %u of body %u, %s: vertex %u overtakes vertex %u\n", event.time, event.node,
              event.body, sides[event.side], event.loser, event.winner);
}

}  // namespace

int main() try {
  // Two triangles of one body that pass each other, above a third one at rest.
  kbvh::World world(kbvh::Precision::float64);
  const std::vector<std::uint32_t> two{0, 1, 2, 3, 4, 5}, one{0, 1, 2};
  world.add_body("pair", {two}, std::vector<double>{0, 1},
                 std::vector<double>{0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 1, 3, 0, 1, 2, 1, 1,    // at 0 s
                                     2, 0, 0, 3, 0, 0, 2, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1});  // at 1 s
  world.add_body("floor", {one}, std::vector<double>{0}, std::vector<double>{0, 0, -1, 3, 0, -1, 0, 3, -1});
  world.start("kinetic_aabb");

  std::vector<kbvh::WorldEvent> queue;
  world.scheduled_events(queue);
  std::printf("%zu events are scheduled\n", queue.size());
  for (const kbvh::WorldEvent& event : queue) print(event);
  kbvh::WorldStep step;
  while (world.step_event(1, step)) {
    std::printf("event at ");
    print(step.event);
    for (const kbvh::WorldBoundChange& change : step.touched)
      std::printf("  node %u, side %u: vertex %u instead of %u\n", change.node, change.side,
                  change.new_vertex, change.old_vertex);
    std::printf("  %zu certificates rescheduled, next event at t = %g\n", step.rescheduled.size(),
                world.next_event_time());
  }
  world.advance(1);
  world.scheduled_events(queue);
  std::printf("%zu events are left\n", queue.size());
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
