#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace kbvh::experiments {

/// Holds a folder's lock while it lives: processes that read, alter and replace a file there take turns.
/// Where folders cannot be locked (some network file systems) it does nothing.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_;
};

/// What a file of JSON holds; a discarded value for anything else, nothing if there is no such file or it is
/// empty.
std::optional<nlohmann::json> content_of(const std::filesystem::path& file);

/// Renames a file that is not what it should be to FILE.damaged, FILE.damaged-2 and so on, and returns its
/// new name without the folder. Throws io::InputError if that fails.
std::string set_aside(const std::filesystem::path& file);

/// A file of results that a command writes as a whole, such as stress.json. One process at a time writes it,
/// and the results of another question are never replaced.
class ResultFile {
 public:
  /// Claims the file for this process. `options` is what was asked: every content has it as its member
  /// "options", beside "commit". Throws io::InputError if the folder cannot be written, or another process
  /// writes the file.
  ResultFile(const std::filesystem::path& folder, const std::string& name, nlohmann::json options);
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  /// Replaces the file in one step. A file that was made with other options or by another commit is renamed
  /// first (stress-2.json, stress-3.json, ...), which a message says. Throws io::InputError if that fails.
  void write(const nlohmann::json& content);

  /// What an earlier run with the same options and commit left; null if there is none.
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
