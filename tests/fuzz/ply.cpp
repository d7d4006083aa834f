#include "tests/fuzz/mesh_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const kbvh::fuzz::InputFolder folder;
  kbvh::fuzz::read_mesh(folder.write("input.ply", data, size));
  return 0;
}
