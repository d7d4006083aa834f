#include "experiments/io/frames.hpp"

#include <algorithm>
#include <string>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/io/ply.hpp"
#include "experiments/io/validate.hpp"

namespace kbvh::io {
namespace {

namespace fs = std::filesystem;

struct Frame {
  fs::path file;
  std::int64_t number = 0;
  std::string rest;  // the name without its number
};

Frame parse_name(const fs::path& file) {
  constexpr std::string_view digits = "0123456789";
  const std::string stem = file.stem().string();
  const std::size_t last = stem.find_last_of(digits);
  if (last == std::string::npos) {
    fail(file, "", "has no number in its name, in a folder of numbered frames");
  }
  const std::size_t before = stem.find_last_not_of(digits, last);
  const std::size_t first = before == std::string::npos ? 0 : before + 1;
  const std::string text = stem.substr(first, last + 1 - first);
  const std::optional<std::int64_t> number = parse_integer(text);
  if (!number) fail(file, "", "the frame number " + printable(text) + " is too large");
  return {file, *number, stem.substr(0, first) + "#" + stem.substr(last + 1) + file.extension().string()};
}

std::string name_of(const fs::path& file) {
  return file.filename().string();
}

void check_same_faces(const AnimatedMesh& first, const fs::path& first_file, const AnimatedMesh& mesh,
                      const fs::path& file) {
  const auto differ = [&](std::string_view place, const std::string& here, const std::string& there) {
    fail(file, place, here + ", but " + name_of(first_file) + " has " + there);
  };
  if (mesh.vertex_count != first.vertex_count) {
    differ("", std::to_string(mesh.vertex_count) + " vertices", std::to_string(first.vertex_count));
  }
  if (mesh.primitive_count() != first.primitive_count()) {
    differ("", std::to_string(mesh.primitive_count()) + " faces", std::to_string(first.primitive_count()));
  }
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    const auto corners = [&](const AnimatedMesh& m) {
      return std::vector<std::uint32_t>(m.primitive_vertices.begin() + m.primitive_offsets[p],
                                        m.primitive_vertices.begin() + m.primitive_offsets[p + 1]);
    };
    const auto text = [&](const AnimatedMesh& m) {
      std::string out;
      for (std::uint32_t v : corners(m)) out += (out.empty() ? "(" : ", ") + std::to_string(v);
      return out + ")";
    };
    if (corners(mesh) != corners(first))
      differ("face " + std::to_string(p), "vertices " + text(mesh), text(first));
  }
}

}  // namespace

std::string lower_extension(const fs::path& file) {
  std::string text = file.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return text;
}

AnimatedMesh read_mesh_file(const fs::path& file) {
  return lower_extension(file) == ".ply" ? read_ply(file) : read_obj(file);
}

std::vector<fs::path> numbered_frames(const fs::path& folder) {
  std::vector<Frame> frames;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string extension = lower_extension(it->path());
    const bool hidden = name_of(it->path()).starts_with('.');
    if ((extension == ".obj" || extension == ".ply") && !hidden) frames.push_back(parse_name(it->path()));
  }
  if (error) fail(folder, "", "the folder cannot be read: " + error.message());
  if (frames.empty()) fail(folder, "", "no frames (the folder has no .obj or .ply file)");
  std::sort(frames.begin(), frames.end(), [](const Frame& a, const Frame& b) {
    return a.number != b.number ? a.number < b.number : a.file < b.file;
  });
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const Frame &a = frames[i - 1], &b = frames[i];
    if (a.rest != b.rest) {
      fail(folder, "", name_of(a.file) + " and " + name_of(b.file) + " differ in more than the frame number");
    }
    if (a.number == b.number) {
      fail(folder, "",
           name_of(a.file) + " and " + name_of(b.file) + " are both frame " + std::to_string(a.number));
    }
  }
  std::int64_t step = frames.size() > 1 ? frames[1].number - frames[0].number : 1;
  for (std::size_t i = 1; i < frames.size(); ++i)
    step = std::min(step, frames[i].number - frames[i - 1].number);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].number - frames[i - 1].number != step) {
      fail(folder, "",
           "frame " + std::to_string(frames[i - 1].number + step) + " is missing between " +
               name_of(frames[i - 1].file) + " and " + name_of(frames[i].file));
    }
  }
  std::vector<fs::path> files;
  for (Frame& frame : frames) files.push_back(std::move(frame.file));
  return files;
}

AnimatedMesh read_frames(const fs::path& folder, double frames_per_second) {
  const std::vector<fs::path> files = numbered_frames(folder);
  if (frames_per_second == 0) frames_per_second = default_frames_per_second;
  AnimatedMesh all = read_mesh_file(files[0]);
  finish(all, files[0]);  // each by itself, so that an error in a coordinate names its own file
  for (std::string& text : all.notes) text = name_of(files[0]) + ": " + text;
  all.name = folder.has_filename() ? name_of(folder) : name_of(folder.parent_path());
  for (std::size_t i = 1; i < files.size(); ++i) {
    AnimatedMesh frame = read_mesh_file(files[i]);
    finish(frame, files[i]);
    check_same_faces(all, files[0], frame, files[i]);
    if (all.notes.empty())
      for (const std::string& text : frame.notes) all.notes.push_back(name_of(files[i]) + ": " + text);
    all.positions.insert(all.positions.end(), frame.positions.begin(), frame.positions.end());
    all.keyframe_times.push_back(static_cast<double>(i) / frames_per_second);
  }
  return all;
}

}  // namespace kbvh::io
