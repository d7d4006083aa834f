#include "experiments/loop/saved_state.hpp"

#include <string>

#include "core/base/hasher.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments::loop {
namespace {

constexpr char state_mark[] = "KBVHSTA1";
constexpr std::size_t word_count = 9;  // after the mark

std::uint64_t hash_of_bytes(const char* data, std::size_t size) {
  Hasher hasher;
  hasher.bytes(data, size);
  return hasher.value();
}

}  // namespace

void save_state(const std::filesystem::path& file, const SavedState& saved) {
  std::string out(state_mark, 8);
  const State& state = saved.state;
  for (const std::uint64_t word :
       {saved.options, saved.lines_bytes, saved.recording_bytes, saved.penetrations, saved.first_penetration,
        saved.stalled, saved.unconverged, state.step, std::uint64_t(state.positions.rows())})
    io::append_little_endian(out, word);
  for (const Positions* list : {&state.positions, &state.velocities})
    for (Eigen::Index i = 0; i < list->size(); ++i) io::append_little_endian(out, list->data()[i]);
  io::append_little_endian(out, hash_of_bytes(out.data(), out.size()));
  io::write_file_atomically(file, out);
}

SavedState load_state(const std::filesystem::path& file) {
  const std::string bytes = io::read_file(file);
  constexpr std::size_t begin = 8 + 8 * word_count;
  if (bytes.size() < begin + 8 || bytes.compare(0, 8, state_mark) != 0)
    io::fail(file, "", "is no saved state of a simulation");
  const auto word = [&](std::size_t i) {
    return io::load_little_endian<std::uint64_t>(bytes.data() + 8 + 8 * i);
  };
  SavedState saved;
  saved.options = word(0);
  saved.lines_bytes = word(1);
  saved.recording_bytes = word(2);
  saved.penetrations = word(3);
  saved.first_penetration = word(4);
  saved.stalled = word(5);
  saved.unconverged = word(6);
  saved.state.step = word(7);
  const std::uint64_t n = word(8);
  if (n > bytes.size() || bytes.size() != begin + 48 * n + 8 ||
      io::load_little_endian<std::uint64_t>(bytes.data() + bytes.size() - 8) !=
          hash_of_bytes(bytes.data(), bytes.size() - 8))
    io::fail(file, "", "is damaged; without it the simulation starts over");
  const char* at = bytes.data() + begin;
  for (Positions* list : {&saved.state.positions, &saved.state.velocities}) {
    list->resize(Eigen::Index(n), 3);
    for (Eigen::Index i = 0; i < list->size(); ++i, at += 8)
      list->data()[i] = io::load_little_endian<double>(at);
  }
  return saved;
}

}  // namespace kbvh::experiments::loop
