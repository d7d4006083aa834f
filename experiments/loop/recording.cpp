#include "experiments/loop/recording.hpp"

#include <cmath>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/motion/admissible.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments::loop {
namespace {

constexpr char recording_mark[] = "KBVHLOOP";
constexpr std::uint32_t recording_version = 1;
constexpr std::size_t fixed_header_bytes = 8 + 5 * 4 + 2 * 8;
constexpr std::uint64_t most_elements = std::uint64_t(1) << 30;

std::uint64_t iterate_bytes(std::uint64_t vertices) {
  return 16 + 48 * vertices;
}

std::string bytes_of(const RecordingHeader& header) {
  const ContactMesh& mesh = header.mesh;
  std::string out(recording_mark, 8);
  io::append_little_endian(out, recording_version);
  io::append_little_endian(out, mesh.vertices);
  io::append_little_endian(out, std::uint32_t(mesh.edges.rows()));
  io::append_little_endian(out, std::uint32_t(mesh.faces.rows()));
  io::append_little_endian(out, std::uint32_t(mesh.inner.size()));
  io::append_little_endian(out, header.radius);
  io::append_little_endian(out, header.separation);
  for (const std::uint8_t obstacle : mesh.obstacle) out.push_back(char(obstacle));
  for (Eigen::Index i = 0; i < mesh.edges.size(); ++i) io::append_little_endian(out, mesh.edges.data()[i]);
  for (Eigen::Index i = 0; i < mesh.faces.size(); ++i) io::append_little_endian(out, mesh.faces.data()[i]);
  for (const std::uint32_t vertex : mesh.inner) io::append_little_endian(out, vertex);
  return out;
}

void append_positions(std::string& out, const Positions& positions) {
  for (Eigen::Index i = 0; i < positions.size(); ++i) io::append_little_endian(out, positions.data()[i]);
}

}  // namespace

RecordingWriter::RecordingWriter(std::filesystem::path file, const RecordingHeader& header)
    : file_(std::move(file)) {
  open(std::ios::trunc);
  write(bytes_of(header));
}

RecordingWriter::RecordingWriter(std::filesystem::path file, const RecordingHeader& header,
                                 std::uint64_t bytes)
    : file_(std::move(file)) {
  const std::string expected = bytes_of(header);
  std::string there(expected.size(), '\0');
  std::ifstream in(file_, std::ios::binary);
  in.read(there.data(), std::streamsize(there.size()));
  if (!in || there != expected) io::fail(file_, "", "is not the recording that this simulation began");
  in.close();
  std::error_code error;
  if (std::filesystem::file_size(file_, error) < bytes || error)
    io::fail(file_, "", "is shorter than when the simulation was saved");
  std::filesystem::resize_file(file_, bytes, error);
  if (error) io::fail(file_, "", "cannot be cut: " + error.message());
  open(std::ios::app);
  bytes_ = bytes;
}

void RecordingWriter::open(std::ios::openmode mode) {
  out_.open(file_, std::ios::binary | std::ios::out | mode);
  if (!out_) io::fail(file_, "", "cannot be written");
}

void RecordingWriter::write(const std::string& bytes) {
  out_.write(bytes.data(), std::streamsize(bytes.size()));
  if (!out_) io::fail(file_, "", "cannot be written");
  bytes_ += bytes.size();
}

void RecordingWriter::take(std::uint32_t iterate, const Positions& x, const Positions& end) {
  buffer_.clear();
  io::append_little_endian(buffer_, step_);
  io::append_little_endian(buffer_, iterate);
  // A difference is rounded by half an ulp at most.
  const double largest = (end - x).cwiseAbs().maxCoeff();
  io::append_little_endian(buffer_, std::nextafter(largest, 2 * largest + 1));
  append_positions(buffer_, x);
  append_positions(buffer_, end);
  write(buffer_);
}

std::uint64_t RecordingWriter::flush() {
  out_.flush();
  if (!out_) io::fail(file_, "", "cannot be written");
  return bytes_;
}

RecordingReader::RecordingReader(std::filesystem::path file)
    : file_(std::move(file)), in_(file_, std::ios::binary) {
  if (!in_) io::fail(file_, "", "cannot be read");
  read_header();
}

void RecordingReader::read(std::size_t bytes) {
  buffer_.resize(bytes);
  in_.read(buffer_.data(), std::streamsize(bytes));
  if (!in_) io::fail(file_, "", "ends too early");
}

void RecordingReader::read_header() {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file_, error);
  if (error || size < fixed_header_bytes) io::fail(file_, "", "is no recording of a simulation");
  read(fixed_header_bytes);
  if (std::memcmp(buffer_.data(), recording_mark, 8) != 0)
    io::fail(file_, "", "is no recording of a simulation");
  const auto word = [&](std::size_t i) {
    return io::load_little_endian<std::uint32_t>(buffer_.data() + 8 + 4 * i);
  };
  if (word(0) != recording_version)
    io::fail(file_, "",
             "has version " + std::to_string(word(0)) + ", not " + std::to_string(recording_version));
  ContactMesh& mesh = header_.mesh;
  mesh.vertices = word(1);
  const std::uint64_t n = word(1), m = word(2), k = word(3), inner = word(4);
  header_.radius = io::load_little_endian<double>(buffer_.data() + 28);
  header_.separation = io::load_little_endian<double>(buffer_.data() + 36);
  if (n >= most_elements || m >= most_elements || k >= most_elements || inner > n)
    io::fail(file_, "header", "has numbers of elements that are too large");
  const std::uint64_t header_bytes = fixed_header_bytes + n + 8 * m + 12 * k + 4 * inner;
  if (size < header_bytes || (size - header_bytes) % iterate_bytes(n) != 0)
    io::fail(file_, "", "has a size that does not fit its header");
  if (!(header_.separation >= 0 && header_.separation <= header_.radius &&
        header_.radius <= admissible_magnitude<double>))
    io::fail(file_, "header", "has a radius or a separation that is no length");
  iterates_ = (size - header_bytes) / iterate_bytes(n);
  read(std::size_t(header_bytes - fixed_header_bytes));
  const char* at = buffer_.data();
  for (std::uint64_t v = 0; v < n; ++v) {
    if (*at != 0 && *at != 1)
      io::fail(file_, "vertex " + std::to_string(v), "is neither of an obstacle nor free");
    mesh.obstacle.push_back(std::uint8_t(*at++));
  }
  const auto vertex = [&](const char* what, std::uint64_t id) {
    const auto value = io::load_little_endian<std::uint32_t>(at);
    at += 4;
    if (value >= n)
      io::fail(file_, what + (" " + std::to_string(id)),
               "names vertex " + std::to_string(value) + " of " + std::to_string(n));
    return value;
  };
  mesh.edges.resize(Eigen::Index(m), 2);
  for (std::uint64_t i = 0; i < 2 * m; ++i) mesh.edges.data()[i] = vertex("edge", i / 2);
  mesh.faces.resize(Eigen::Index(k), 3);
  for (std::uint64_t i = 0; i < 3 * k; ++i) mesh.faces.data()[i] = vertex("face", i / 3);
  for (std::uint64_t i = 0; i < inner; ++i) {
    mesh.inner.push_back(vertex("inner vertex", i));
    if (i > 0 && mesh.inner[i] <= mesh.inner[i - 1]) io::fail(file_, "inner vertices", "are not ascending");
  }
}

void RecordingReader::read_positions(Positions& positions) {
  const Eigen::Index n = Eigen::Index(header_.mesh.vertices);
  positions.resize(n, 3);
  read(24 * std::size_t(n));
  for (Eigen::Index i = 0; i < 3 * n; ++i) {
    const auto value = io::load_little_endian<double>(buffer_.data() + 8 * i);
    if (!(std::fabs(value) <= admissible_magnitude<double>))
      io::fail(file_, "iterate " + std::to_string(read_iterates_), "has a coordinate that is out of range");
    positions.data()[i] = value;
  }
}

bool RecordingReader::next(RecordedIterate& iterate) {
  if (read_iterates_ == iterates_) return false;
  read(16);
  iterate.step = io::load_little_endian<std::uint32_t>(buffer_.data());
  iterate.iterate = io::load_little_endian<std::uint32_t>(buffer_.data() + 4);
  iterate.displacement = io::load_little_endian<double>(buffer_.data() + 8);
  read_positions(iterate.begin);
  read_positions(iterate.end);
  ++read_iterates_;
  return true;
}

}  // namespace kbvh::experiments::loop
