#include "experiments/io/pc2.hpp"

#include <cmath>
#include <limits>
#include <string>

#include "experiments/io/bytes.hpp"

namespace kbvh::io {
namespace {

constexpr std::size_t header_bytes = 32;
constexpr std::string_view magic{"POINTCACHE2\0", 12};

std::string plural(std::uint64_t n, const std::string& word) {
  return std::to_string(n) + " " + word + (n == 1 ? "" : "s");
}

}  // namespace

void read_pc2(AnimatedMesh& mesh, const std::filesystem::path& mesh_file, const std::filesystem::path& file,
              double frames_per_second) {
  const std::string bytes = read_file(file);
  if (bytes.size() < header_bytes) {
    fail(file, "header", "the file has " + plural(bytes.size(), "byte") + ", the header alone takes 32");
  }
  if (!std::string_view(bytes).starts_with(magic)) {
    fail(file, "header",
         "starts with " + printable(bytes.substr(0, magic.size())) + " instead of 'POINTCACHE2'");
  }
  const auto version = load_little_endian<std::int32_t>(&bytes[12]);
  const auto vertices = load_little_endian<std::int32_t>(&bytes[16]);
  const auto start = load_little_endian<float>(&bytes[20]);
  auto frames_per_sample = load_little_endian<float>(&bytes[24]);
  const auto samples = load_little_endian<std::int32_t>(&bytes[28]);
  if (version != 1) fail(file, "header", "version is " + std::to_string(version) + ", only 1 is known");
  if (vertices < 0 || static_cast<std::uint32_t>(vertices) != mesh.vertex_count) {
    fail(file, "header",
         std::to_string(vertices) + " vertices, but " + mesh_file.filename().string() + " has " +
             std::to_string(mesh.vertex_count));
  }
  if (samples < 0) fail(file, "header", "the number of samples is " + std::to_string(samples));
  if (samples == 0) fail(file, "header", "no frames (0 samples)");
  if (!std::isfinite(start)) fail(file, "header", "start frame is " + text_of(start));
  if (!std::isfinite(frames_per_sample) || frames_per_sample < 0) {
    fail(file, "header", "sample rate is " + text_of(frames_per_sample));
  }
  if (frames_per_sample == 0) {
    frames_per_sample = 1;
    mesh.notes.push_back("the header's sample rate is 0; read as 1 frame per sample");
  }
  if (samples == 1) mesh.notes.push_back("has one sample, so nothing moves");

  const std::uint64_t coordinates = std::uint64_t{3} * mesh.vertex_count;
  const std::uint64_t sample_bytes = 4 * coordinates;
  const std::uint64_t expected = header_bytes + static_cast<std::uint64_t>(samples) * sample_bytes;
  if (bytes.size() != expected) {
    const std::uint64_t whole = (bytes.size() - header_bytes) / sample_bytes;
    fail(file, "",
         "the header says " + plural(static_cast<std::uint64_t>(samples), "sample") + ", which take " +
             std::to_string(expected) + " bytes, but the file has " + std::to_string(bytes.size()) +
             " bytes, enough for " + plural(whole, "whole sample"));
  }

  if (frames_per_second == 0) frames_per_second = default_frames_per_second;
  mesh.keyframe_times.clear();
  for (std::int32_t i = 0; i < samples; ++i) {
    mesh.keyframe_times.push_back((double{start} + i * double{frames_per_sample}) / frames_per_second);
  }
  mesh.positions.resize(static_cast<std::size_t>(samples) * coordinates);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const double value = load_little_endian<float>(&bytes[header_bytes + 4 * i]);
    if (!std::isfinite(value)) {
      fail(file,
           "sample " + std::to_string(i / coordinates) + ", vertex " + std::to_string(i % coordinates / 3),
           std::string("coordinate ") + "xyz"[i % 3] + " is " + text_of(value));
    }
    mesh.positions[i] = value;
  }
}

void save_pc2(const AnimatedMesh& mesh, const std::filesystem::path& file, double frames_per_second) {
  const auto& times = mesh.keyframe_times;
  if (!(frames_per_second > 0) || !std::isfinite(frames_per_second)) {
    fail(file, "", "frames per second is " + text_of(frames_per_second));
  }
  if (times.empty()) fail(file, "", "no frames to write");
  constexpr std::size_t most = std::numeric_limits<std::int32_t>::max();
  if (mesh.vertex_count > most || times.size() > most)
    fail(file, "", "too many vertices or keyframes for a PC2 file");
  const double step =
      times.size() > 1 ? (times.back() - times.front()) / static_cast<double>(times.size() - 1) : 0;
  for (std::size_t k = 1; k < times.size(); ++k) {
    if (std::abs(times[k] - times[k - 1] - step) > 1e-5 * step) {
      fail(file, "keyframe " + std::to_string(k),
           "comes " + text_of(times[k] - times[k - 1]) + " s after the one before, but the mean step is " +
               text_of(step) + " s and a PC2 file has one step for all");
    }
  }
  std::string out(magic);
  append_little_endian(out, std::int32_t{1});
  append_little_endian(out, static_cast<std::int32_t>(mesh.vertex_count));
  append_little_endian(out, static_cast<float>(times.front() * frames_per_second));
  append_little_endian(out, times.size() > 1 ? static_cast<float>(step * frames_per_second) : 1.0f);
  append_little_endian(out, static_cast<std::int32_t>(times.size()));
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (!(std::abs(mesh.positions[i]) <= std::numeric_limits<float>::max())) {
      fail(file,
           "keyframe " + std::to_string(i / 3 / mesh.vertex_count) + ", vertex " +
               std::to_string(i / 3 % mesh.vertex_count),
           "coordinate " + text_of(mesh.positions[i]) + " does not fit a float");
    }
    append_little_endian(out, static_cast<float>(mesh.positions[i]));
  }
  write_file_atomically(file, out);
}

}  // namespace kbvh::io
