#include "tests/fuzz/mesh_target.hpp"

// The point cache moves a fixed triangle.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const kbvh::fuzz::InputFolder folder;
  static const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  static const auto mesh =
      folder.write("mesh.obj", reinterpret_cast<const std::uint8_t*>(triangle.data()), triangle.size());
  kbvh::fuzz::read_mesh(mesh, folder.write("motion.pc2", data, size));
  return 0;
}
