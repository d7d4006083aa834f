#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace kbvh::experiments {

/// Holds a folder's lock during its lifetime: processes that read, alter and replace a file there take turns.
/// On file systems without locks (some network file systems) it does nothing.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_;
};

/// Returns the value of a JSON file; a discarded value for other content, nothing if there is no such file or
/// it is empty.
std::optional<nlohmann::json> content_of(const std::filesystem::path& file);

/// Renames an invalid file to FILE.damaged, FILE.damaged-2 and so on, and returns its new name without the
/// folder. Throws io::InputError if that fails.
std::string set_aside(const std::filesystem::path& file);

/// A file of results that a command writes as a whole, such as stress.json. One process at a time writes it,
/// and results of other options are never replaced.
class ResultFile {
 public:
  /// Claims the file for this process. `options` are the options of the command: every content has them as
  /// its member "options", next to "commit". Throws io::InputError if the folder cannot be written, or
  /// another process writes the file.
  ResultFile(const std::filesystem::path& folder, const std::string& name, nlohmann::json options);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  /// Replaces the file in one step. A file that was made with other options or by another commit is renamed
  /// first (stress-2.json, stress-3.json, ...), with a message. Throws io::InputError if that fails.
  void write(const nlohmann::json& content);

  /// Returns the content of an earlier run with the same options and commit; null if there is none.
  const nlohmann::json& earlier() const { return earlier_; }
  const std::filesystem::path& path() const { return file_; }

 private:
  void keep_what_is_there();

  std::filesystem::path file_, lock_file_;
  nlohmann::json options_, earlier_;
  bool is_kept_ = false;
  int lock_ = -1;
};

}  // namespace kbvh::experiments
