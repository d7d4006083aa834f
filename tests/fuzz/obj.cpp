#include "tests/fuzz/mesh_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const kbvh::fuzz::InputFolder folder;
  kbvh::fuzz::read_text_mesh(folder, "input.obj", {reinterpret_cast<const char*>(data), size});
  return 0;
}
