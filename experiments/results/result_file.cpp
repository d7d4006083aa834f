#include "experiments/results/result_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "experiments/common/machine.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

using nlohmann::json;

FolderLock::FolderLock(const std::filesystem::path& folder)
    : descriptor_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  while (descriptor_ >= 0 && ::flock(descriptor_, LOCK_EX) != 0 && errno == EINTR) {
  }
}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::optional<json> content_of(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error) || std::filesystem::file_size(file, error) == 0)
    return {};
  return json_or_nothing(io::read_file(file));
}

namespace {

/// Renames a file to the first unused one of `names`.
template <class Name>
std::string rename_to_free(const std::filesystem::path& file, const Name& name) {
  std::error_code error;
  int i = 1;
  while (std::filesystem::exists(file.parent_path() / name(i), error)) ++i;
  std::filesystem::rename(file, file.parent_path() / name(i), error);
  if (error) throw io::InputError(file.string() + ": cannot be renamed: " + error.message());
  return name(i);
}

/// Opens and locks a file; returns -1 if another process holds the lock, or if locking is not possible there
/// (then `refused` is false).
int lock_of(const std::filesystem::path& file, bool& refused) {
  refused = false;
  for (;;) {
    const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (descriptor < 0) return -1;
    if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
      refused = errno == EWOULDBLOCK;
      ::close(descriptor);
      return -1;
    }
    // The process that held the lock may have removed the file since it was opened here.
    struct stat opened {
    }, named{};
    if (::fstat(descriptor, &opened) == 0 && ::stat(file.c_str(), &named) == 0 &&
        opened.st_ino == named.st_ino)
      return descriptor;
    ::close(descriptor);
  }
}

}  // namespace

std::string set_aside(const std::filesystem::path& file) {
  return rename_to_free(file, [&](int i) {
    return file.filename().string() + ".damaged" + (i == 1 ? "" : "-" + std::to_string(i));
  });
}

ResultFile::ResultFile(const std::filesystem::path& folder, const std::string& name, json options)
    : file_(folder / name), lock_file_(folder / ("." + name + ".lock")), options_(std::move(options)) {
  prepare_folder(folder);
  bool refused = false;
  lock_ = lock_of(lock_file_, refused);
  if (refused)
    throw io::InputError(file_.string() + ": another process is writing it; take another folder, or wait");
  std::optional<json> content = content_of(file_);
  if (content && content->is_object() && content->value("options", json()) == options_ &&
      content->value("commit", json()) == json(commit())) {
    earlier_ = std::move(*content);
    is_kept_ = true;
  }
}

ResultFile::~ResultFile() {
  if (lock_ < 0) return;
  ::unlink(lock_file_.c_str());
  ::close(lock_);
}

void ResultFile::keep_what_is_there() {
  std::error_code error;
  if (!std::filesystem::exists(file_, error)) return;
  const std::string kept = rename_to_free(file_, [&](int i) {
    return file_.stem().string() + "-" + std::to_string(i + 1) + file_.extension().string();
  });
  say("note: " + file_.string() + " is of a run with other options or of another commit: it is now " + kept);
}

void ResultFile::write(const json& content) {
  if (!is_kept_) keep_what_is_there();
  is_kept_ = true;
  io::write_file_atomically(file_, content.dump(1, ' ', false, json::error_handler_t::replace) + "\n");
}

}  // namespace kbvh::experiments
