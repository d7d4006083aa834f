// Contacts between frames, before and after changes of flight plans: a leaf falls onto a table, and is thrown
// up again after it has touched the table.

#include <algorithm>
#include <cstdio>
#include <exception>
#include <vector>

#include "core/facade/world.hpp"

int main() try {
  kbvh::World world;
  const std::vector<std::uint32_t> triangle{0, 1, 2};
  world.add_body("table", {triangle}, std::vector<double>{0},
                 std::vector<float>{-1, -1, 0, 3, -1, 0, -1, 3, 0});
  const auto leaf = world.add_body("leaf", {triangle}, std::vector<double>{0, 2},
                                   std::vector<float>{0, 0, 1, 1, 0, 1, 0, 1, 1.5F,       // at 0 s
                                                      0, 0, -1, 1, 0, -1, 0, 1, -0.5F});  // at 2 s
  world.start("bottom_up");

  std::vector<kbvh::WorldContact> contacts;
  std::size_t before = 0, after = 0;
  for (const double t : {0.5, 1.0, 1.25}) {
    world.contacts(std::min(t, world.next_knot()), contacts);
    before += contacts.size();
    std::printf("until t = %g: %zu contacts\n", t, contacts.size());
  }
  std::vector<kbvh::WorldPlan> up(3);
  for (std::uint32_t v = 0; v < 3; ++v) up[v] = {.body = leaf, .vertex = v, .velocity = {0, 0, 2}};
  world.change_plans(up);
  for (const double t : {1.5, 1.75, 2.0}) {
    world.contacts(t, contacts);
    after += contacts.size();
    std::printf("until t = %g: %zu contacts\n", t, contacts.size());
  }
  std::printf("%s on the way down, %s on the way up\n", before > 0 ? "contacts" : "none",
              after > 0 ? "contacts" : "none");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
