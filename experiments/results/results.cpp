#include "experiments/results/results.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>

#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

json json_or_nothing(std::string_view text) {
  constexpr int deepest = 100;
  // The parser takes a NUL byte for the end of the text.
  if (text.find('\0') != std::string_view::npos) return json(json::value_t::discarded);
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\')
      ++i;
    else if (c == '"')
      quoted = !quoted;
    else if (!quoted && (c == '[' || c == '{') && ++depth > deepest)
      return json(json::value_t::discarded);
    else if (!quoted && (c == ']' || c == '}'))
      --depth;
  }
  return json::parse(text, nullptr, false);
}

namespace {

/// Removes temporary files of killed processes (FILE.tmp-PROCESS-ATTEMPT), if no such process runs and
/// nothing was written for an hour: the folder may be shared with another machine.
void remove_left_overs(const std::filesystem::path& folder) {
  std::error_code error;
  const auto old = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const std::size_t at = name.rfind(".tmp-");
    if (at == std::string::npos) continue;
    const auto numbers = split(name.substr(at + 5), '-');
    const auto process = parse_whole(numbers[0]);
    if (numbers.size() != 2 || !process || !parse_whole(numbers[1]) || *process > 0x7fffffff) continue;
    if (::kill(pid_t(*process), 0) == 0 || errno != ESRCH) continue;
    if (entry.is_regular_file(error) && entry.last_write_time(error) < old && !error)
      std::filesystem::remove(entry.path(), error);
  }
}

}  // namespace

void prepare_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (std::error_code ignored; !std::filesystem::is_directory(folder, ignored))
    throw io::InputError("the output folder '" + folder.string() + "' cannot be made" +
                         (error ? ": " + error.message() : ""));
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw io::InputError("the output folder '" + folder.string() + "' cannot be written");
  // The size of a record or two: with less space no measurement could be kept.
  const std::filesystem::path probe = folder / ".kbvh-room";
  try {
    io::write_file_atomically(probe, std::string(4096, ' '));
  } catch (const io::InputError& problem) {
    const std::string why = problem.what();
    throw io::InputError("the output folder '" + folder.string() + "' cannot be written" +
                         why.substr(why.rfind(": ")));
  }
  std::filesystem::remove(probe, error);
  remove_left_overs(folder);
}

ResultStore::ResultStore(const std::filesystem::path& folder, const std::filesystem::path& file,
                         const std::vector<std::filesystem::path>& others)
    : folder_(folder), file_(folder / file) {
  prepare_folder(folder);
  std::error_code error;
  const bool leads_nowhere =
      std::filesystem::is_symlink(file_, error) && !std::filesystem::exists(file_, error);
  if (leads_nowhere) throw io::InputError(file_.string() + ": is a link that leads to no file");
  if (std::filesystem::exists(file_, error) && !std::filesystem::is_regular_file(file_, error))
    throw io::InputError(file_.string() + ": is not a file to which results can be appended");
  if (const int descriptor = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC); descriptor >= 0)
    ::close(descriptor);
  else if (errno != ENOENT)
    throw io::InputError(file_.string() + ": cannot be written: " + std::strerror(errno));
  for (const std::filesystem::path& other : others)
    if (other != file_) read(other);
  broken_end_ = read(file_);
}

bool ResultStore::read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  std::size_t line = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    ++line;
    std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) end = text.size();
    const json record = json_or_nothing(std::string_view(text).substr(begin, end - begin));
    const bool blank = begin == end;
    begin = end + 1;
    if (blank) continue;
    const auto key = record.is_object() ? record.find("key") : record.end();
    if (!record.is_object() || key == record.end() || !key->is_string()) {
      ++unreadable_;
      continue;
    }
    // Times of another schema have another meaning: such a record stands for no configuration.
    if (record.contains("schema") && record.at("schema") != json(results_schema)) {
      ++other_schemas_;
      continue;
    }
    known_.insert_or_assign(key->get<std::string>(), record);
    place_of_.insert_or_assign(key->get<std::string>(), file.string() + " line " + std::to_string(line));
    ++records_;
  }
  return !text.empty() && text.back() != '\n';
}

const json* ResultStore::find(const std::string& key) const {
  const auto record = known_.find(key);
  return record == known_.end() ? nullptr : &record->second;
}

std::string ResultStore::place(const std::string& key) const {
  const auto place = place_of_.find(key);
  return place == place_of_.end() ? file_.string() : place->second;
}

void ResultStore::append(const json& record) {
  // One write, so that a reader or a second writer never sees half a line; a partial line of an earlier run
  // is terminated first, and stays in place.
  const std::string line =
      (broken_end_ ? "\n" : "") + record.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
  const auto failed = [&] {
    throw io::InputError(file_.string() + ": cannot be written: " + std::strerror(errno));
  };
  const int descriptor = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0) failed();
  const auto written = ::write(descriptor, line.data(), line.size());
  const bool complete = written == ssize_t(line.size()) && ::fsync(descriptor) == 0;
  if (written >= 0 && written != ssize_t(line.size())) errno = ENOSPC;
  const int reason = errno;
  ::close(descriptor);
  errno = reason;
  if (!complete) failed();
  broken_end_ = false;
  known_.insert_or_assign(record.at("key").get<std::string>(), record);
  place_of_.erase(record.at("key").get<std::string>());
  ++records_;
}

}  // namespace kbvh::experiments
