#include "experiments/io/animated_mesh_cache.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/validate.hpp"
#include "tests/fuzz/input_file.hpp"

namespace {

void read(const kbvh::fuzz::InputFolder& folder, std::string_view bytes) {
  const auto file =
      folder.write("input.kbvhmesh", reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  try {
    for (kbvh::io::AnimatedMesh& mesh : kbvh::io::load_cache(file)) kbvh::io::finish(mesh, file);
  } catch (const kbvh::io::InputError&) {
  }
}

}  // namespace

// Reads the input as a file, and as the payload of a file with a correct header: no random change passes a
// checksum.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const kbvh::fuzz::InputFolder folder;
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  read(folder, input);
  std::string file = "KBVHMESH";
  kbvh::io::append_little_endian(file, kbvh::io::cache_version);
  kbvh::io::append_little_endian(file, std::uint32_t(0));
  kbvh::io::append_little_endian(file, std::uint64_t(size));
  kbvh::io::append_little_endian(file, kbvh::io::cache_checksum(input));
  read(folder, file.append(input));
  return 0;
}
