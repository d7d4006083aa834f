#include "experiments/loop/frames.hpp"

#include <algorithm>
#include <string>
#include <system_error>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/loop/recording.hpp"

namespace kbvh::experiments::loop {

namespace {

/// Makes the folder, and returns a mesh of these faces with one keyframe.
io::AnimatedMesh begin_clip(const std::filesystem::path& folder, const FaceList& faces, const Positions& x) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) io::fail(folder, "", "cannot be made: " + error.message());
  io::AnimatedMesh clip;
  clip.vertex_count = std::uint32_t(x.rows());
  clip.keyframe_times = {0};
  clip.positions.assign(x.data(), x.data() + x.size());
  clip.primitive_vertices.assign(faces.data(), faces.data() + faces.size());
  for (Eigen::Index f = 1; f <= faces.rows(); ++f) clip.primitive_offsets.push_back(std::uint32_t(3 * f));
  return clip;
}

}  // namespace

void save_frame(const std::filesystem::path& folder, const SimulatedMesh& mesh, const Positions& x,
                std::uint64_t step) {
  const io::AnimatedMesh frame = begin_clip(folder, mesh.faces, x);
  const std::string number = std::to_string(step);
  const std::string padded = number.size() < 6 ? std::string(6 - number.size(), '0') + number : number;
  io::save_obj(frame, folder / ("frame_" + padded + ".obj"));
}

std::uint64_t save_iterates(const std::filesystem::path& recording, const std::filesystem::path& folder,
                            std::uint64_t most) {
  RecordingReader reader(recording);
  RecordedIterate iterate;
  if (!reader.next(iterate)) io::fail(recording, "", "has no iterates");
  io::AnimatedMesh clip = begin_clip(folder, reader.header().mesh.faces, iterate.begin);
  const std::uint64_t count = most > 0 ? std::min(most, reader.iterates()) : reader.iterates();
  clip.positions.reserve(clip.positions.size() * count);
  io::save_obj(clip, folder / "iterates.obj");
  while (clip.keyframe_times.size() < count && reader.next(iterate)) {
    clip.keyframe_times.push_back(double(clip.keyframe_times.size()) / io::default_frames_per_second);
    clip.positions.insert(clip.positions.end(), iterate.begin.data(),
                          iterate.begin.data() + iterate.begin.size());
  }
  io::save_pc2(clip, folder / "iterates.pc2");
  return clip.keyframe_times.size();
}

}  // namespace kbvh::experiments::loop
