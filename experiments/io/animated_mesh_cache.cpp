#include "experiments/io/animated_mesh_cache.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "experiments/io/bytes.hpp"
#include "experiments/io/validate.hpp"

namespace kbvh::io {
namespace {

constexpr std::string_view magic = "KBVHMESH";
constexpr std::size_t header_bytes = 32;

bool all_floats(const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) {
    return std::abs(x) <= largest_coordinate && static_cast<float>(x) == x;
  });
}

template <class Stored, class T>
void append_all(std::string& out, const std::vector<T>& numbers) {
  for (const T& number : numbers) append_little_endian(out, static_cast<Stored>(number));
}

void append_mesh(std::string& out, const AnimatedMesh& mesh) {
  const bool as_float = all_floats(mesh.positions);
  for (std::uint64_t n :
       {std::uint64_t{mesh.name.size()}, std::uint64_t{mesh.vertex_count},
        std::uint64_t{mesh.primitive_offsets.size()}, std::uint64_t{mesh.primitive_vertices.size()},
        std::uint64_t{mesh.keyframe_times.size()}, std::uint64_t{mesh.positions.size()},
        std::uint64_t{mesh.degenerate_primitives}, std::uint64_t{mesh.merged_keyframes},
        std::uint64_t{as_float ? 4u : 8u}}) {
    append_little_endian(out, n);
  }
  out += mesh.name;
  append_all<std::uint32_t>(out, mesh.primitive_offsets);
  append_all<std::uint32_t>(out, mesh.primitive_vertices);
  append_all<double>(out, mesh.keyframe_times);
  as_float ? append_all<float>(out, mesh.positions) : append_all<double>(out, mesh.positions);
}

/// Reads numbers from the payload; the checksum has been checked, but the sizes in a file may still be wrong.
class PayloadReader {
 public:
  PayloadReader(const std::filesystem::path& file, std::string_view bytes) : file_(file), bytes_(bytes) {}

  std::uint64_t number() { return load_little_endian<std::uint64_t>(take(1, 8)); }

  std::string text(std::uint64_t size) {
    const char* at = take(size, 1);
    return {at, static_cast<std::size_t>(size)};
  }

  template <class Stored, class T>
  void fill(std::vector<T>& out, std::uint64_t count) {
    const char* at = take(count, sizeof(Stored));
    out.resize(static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] = static_cast<T>(load_little_endian<Stored>(at + i * sizeof(Stored)));
  }

  bool at_end() const { return at_ == bytes_.size(); }
  std::string place() const { return "payload byte " + std::to_string(at_); }

 private:
  const char* take(std::uint64_t count, std::uint64_t size) {
    if (count > (bytes_.size() - at_) / size) {
      fail(file_, place(),
           std::to_string(count) + " numbers of " + std::to_string(size) + " bytes, but only " +
               std::to_string(bytes_.size() - at_) + " bytes are left");
    }
    const char* here = bytes_.data() + at_;
    at_ += static_cast<std::size_t>(count * size);
    return here;
  }

  const std::filesystem::path& file_;
  std::string_view bytes_;
  std::size_t at_ = 0;
};

AnimatedMesh read_mesh(PayloadReader& in, const std::filesystem::path& file) {
  AnimatedMesh mesh;
  const std::string place = in.place();
  const std::uint64_t name = in.number(), vertices = in.number(), offsets = in.number(),
                      corners = in.number(), times = in.number(), positions = in.number();
  mesh.degenerate_primitives = static_cast<std::size_t>(in.number());
  mesh.merged_keyframes = static_cast<std::size_t>(in.number());
  const std::uint64_t scalar = in.number();
  if (vertices > 0xFFFFFFFFu) fail(file, place, std::to_string(vertices) + " vertices are too many");
  if (scalar != 4 && scalar != 8)
    fail(file, place, "numbers of " + std::to_string(scalar) + " bytes are not known");
  mesh.vertex_count = static_cast<std::uint32_t>(vertices);
  mesh.name = in.text(name);
  in.fill<std::uint32_t>(mesh.primitive_offsets, offsets);
  in.fill<std::uint32_t>(mesh.primitive_vertices, corners);
  in.fill<double>(mesh.keyframe_times, times);
  scalar == 4 ? in.fill<float>(mesh.positions, positions) : in.fill<double>(mesh.positions, positions);
  finish(mesh, file);
  return mesh;
}

}  // namespace

std::uint64_t cache_checksum(std::string_view bytes) {
  std::uint64_t sum = bytes.size();
  const auto add = [&](std::uint64_t word) {
    sum = (sum ^ word) * 0x9E3779B97F4A7C15u;
    sum ^= sum >> 32;
  };
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) add(load_little_endian<std::uint64_t>(bytes.data() + at));
  for (; at < bytes.size(); ++at) add(static_cast<unsigned char>(bytes[at]));
  return sum;
}

void save_cache(const std::vector<AnimatedMesh>& meshes, const std::filesystem::path& file) {
  std::string payload;
  append_little_endian(payload, std::uint64_t{meshes.size()});
  for (const AnimatedMesh& mesh : meshes) {
    if (mesh.kind != MeshKind::polygons) fail(file, mesh.name, "only polygons are kept in this format");
    append_mesh(payload, mesh);
  }
  std::string out(magic);
  append_little_endian(out, cache_version);
  append_little_endian(out, std::uint32_t{0});
  append_little_endian(out, std::uint64_t{payload.size()});
  append_little_endian(out, cache_checksum(payload));
  out += payload;
  write_file_atomically(file, out);
}

std::vector<AnimatedMesh> load_cache(const std::filesystem::path& file) {
  const std::string bytes = read_file(file);
  if (!std::string_view(bytes).starts_with(magic)) {
    fail(file, "header", "starts with " + printable(bytes.substr(0, 8)) + " instead of 'KBVHMESH'");
  }
  if (bytes.size() < header_bytes) {
    fail(file, "header", "is cut off after " + std::to_string(bytes.size()) + " of 32 bytes");
  }
  const auto version = load_little_endian<std::uint32_t>(&bytes[8]);
  const auto reserved = load_little_endian<std::uint32_t>(&bytes[12]);
  if (version != cache_version || reserved != 0) {
    fail(file, "header",
         "version is " + std::to_string(version) + ", only " + std::to_string(cache_version) +
             " is known; delete the file to recreate it");
  }
  const auto size = load_little_endian<std::uint64_t>(&bytes[16]);
  if (size != bytes.size() - header_bytes) {
    fail(file, "header",
         "the payload should have " + std::to_string(size) + " bytes, but " +
             std::to_string(bytes.size() - header_bytes) + " are there");
  }
  const std::string_view payload = std::string_view(bytes).substr(header_bytes);
  if (cache_checksum(payload) != load_little_endian<std::uint64_t>(&bytes[24])) {
    fail(file, "payload",
         "the checksum of its " + std::to_string(size) + " bytes is wrong: the file is damaged");
  }
  PayloadReader in(file, payload);
  const std::uint64_t count = in.number();
  std::vector<AnimatedMesh> meshes;
  for (std::uint64_t i = 0; i < count; ++i) meshes.push_back(read_mesh(in, file));
  if (!in.at_end()) fail(file, in.place(), "bytes are left over after " + std::to_string(count) + " meshes");
  return meshes;
}

}  // namespace kbvh::io
