#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "experiments/loop/contact_finder.hpp"

namespace kbvh::experiments::loop {

/// A recording: what a simulator asked its broad phase, iterate by iterate. One file of little-endian
/// numbers:
///
///   bytes  content
///   8      "KBVHLOOP"
///   4      version, 1
///   4 x 4  numbers of vertices n, edges m, faces k, inner vertices i
///   8      radius, double, m: pairs within it were asked for
///   8      separation, double, m: impacts at it were asked for
///   n      1 for each vertex of an obstacle, else 0: elements of such vertices alone are no pairs
///   8 m    edges, two vertices each, 4 bytes a vertex
///   12 k   faces, three vertices each
///   4 i    inner vertices, ascending
///
/// and then, for each iterate, 16 + 48 n bytes:
///
///   4      step, from 0
///   4      iterate within its step, from 0
///   8      displacement, double, m: no coordinate of a vertex changes by more during the motion
///   24 n   positions x at the start of the motion, 3 doubles a vertex
///   24 n   positions at its end
///
/// The simulator moved along a part of each motion; the next one of the same step begins where it stopped.
struct RecordingHeader {
  ContactMesh mesh;
  double radius = 0, separation = 0;
};

/// One motion of a recording.
struct RecordedIterate {
  std::uint32_t step = 0, iterate = 0;
  double displacement = 0;
  Positions begin, end;
};

/// Writes a recording while a simulation runs.
class RecordingWriter : public IterateSink {
 public:
  /// Starts a file and replaces an existing one.
  RecordingWriter(std::filesystem::path file, const RecordingHeader& header);
  /// Continues a file after its first `bytes` bytes; what follows them is cut off. Throws io::InputError if
  /// the file is shorter, or does not begin with this header.
  RecordingWriter(std::filesystem::path file, const RecordingHeader& header, std::uint64_t bytes);

  /// Sets the step to which the next iterates belong.
  void begin_step(std::uint32_t step) { step_ = step; }
  /// Throws io::InputError if the file cannot be written.
  void take(std::uint32_t iterate, const Positions& x, const Positions& end) override;
  /// Writes everything so far to the file and returns its number of bytes. Throws io::InputError if it cannot
  /// be written.
  std::uint64_t flush();

 private:
  void open(std::ios::openmode mode);
  void write(const std::string& bytes);

  std::filesystem::path file_;
  std::ofstream out_;
  std::uint64_t bytes_ = 0;
  std::uint32_t step_ = 0;
  std::string buffer_;
};

/// Reads a recording, one iterate after the other. Throws io::InputError, with file and place, for a file
/// that is none: a wrong header, numbers that do not fit its size, ids out of range, coordinates that are no
/// numbers.
class RecordingReader {
 public:
  explicit RecordingReader(std::filesystem::path file);
  const RecordingHeader& header() const { return header_; }
  std::uint64_t iterates() const { return iterates_; }
  /// Reads the next iterate; returns false after the last one.
  bool next(RecordedIterate& iterate);

 private:
  void read_header();
  void read(std::size_t bytes);
  void read_positions(Positions& positions);

  std::filesystem::path file_;
  std::ifstream in_;
  RecordingHeader header_;
  std::uint64_t iterates_ = 0, read_iterates_ = 0;
  std::string buffer_;
};

}  // namespace kbvh::experiments::loop
