#include "experiments/loop/frames.hpp"

#include <string>
#include <system_error>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/obj.hpp"

namespace kbvh::experiments::loop {

void save_frame(const std::filesystem::path& folder, const SimulatedMesh& mesh, const Positions& x,
                std::uint64_t step) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) io::fail(folder, "", "cannot be made: " + error.message());
  io::AnimatedMesh frame;
  frame.vertex_count = mesh.vertex_count();
  frame.keyframe_times = {0};
  frame.positions.assign(x.data(), x.data() + x.size());
  frame.primitive_vertices.assign(mesh.faces.data(), mesh.faces.data() + mesh.faces.size());
  for (Eigen::Index f = 1; f <= mesh.faces.rows(); ++f)
    frame.primitive_offsets.push_back(std::uint32_t(3 * f));
  const std::string number = std::to_string(step);
  const std::string padded = number.size() < 6 ? std::string(6 - number.size(), '0') + number : number;
  io::save_obj(frame, folder / ("frame_" + padded + ".obj"));
}

}  // namespace kbvh::experiments::loop
