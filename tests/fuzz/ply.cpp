#include "tests/fuzz/mesh_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const kbvh::fuzz::InputFolder folder;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (bytes.find("format ascii") != std::string_view::npos &&
      bytes.find("format binary") == std::string_view::npos)
    kbvh::fuzz::read_text_mesh(folder, "input.ply", bytes);
  else
    kbvh::fuzz::read_mesh(folder.write("input.ply", data, size));
  return 0;
}
