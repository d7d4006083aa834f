#pragma once
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace kbvh::experiments {

/// Parses the text of a file that this program wrote. Returns a discarded value (`is_discarded`) if it is not
/// JSON or is nested deeper than any output of the program: copying such a value would exhaust the stack.
nlohmann::json json_or_nothing(std::string_view text);

/// Makes a folder for results, and writes and removes a small file there: a path that is no folder, is not
/// writable or is on a full disk is detected before hours of work. Throws io::InputError.
void prepare_folder(const std::filesystem::path& folder);

/// The append-only result file of a folder, results.jsonl: one JSON object per line, written in one piece.
/// RESULTS.md documents the records. Unreadable lines (of a killed run) are skipped and counted, never
/// repaired.
class ResultStore {
 public:
  /// Creates the folder and reads existing records. `file` is where records are appended, relative to the
  /// folder; those of `others` are known as well (they need not exist; `file` counts after them). Throws
  /// io::InputError if the folder or the file cannot be written.
  explicit ResultStore(const std::filesystem::path& folder,
                       const std::filesystem::path& file = "results.jsonl",
                       const std::vector<std::filesystem::path>& others = {});
  ResultStore(const ResultStore&) = delete;
  ResultStore& operator=(const ResultStore&) = delete;

  /// Returns the newest record with this key, or nullptr.
  const nlohmann::json* find(const std::string& key) const;
  /// Returns "FILE line N", the place of a record that was read; else the file.
  std::string place(const std::string& key) const;
  /// Writes the record as one line, flushed to disk. Throws io::InputError if that fails.
  void append(const nlohmann::json& record);

  const std::filesystem::path& folder() const { return folder_; }
  std::size_t records() const { return records_; }
  std::size_t unreadable_lines() const { return unreadable_; }
  /// Returns the number of records that are of another schema than this program's; they stay in the file.
  std::size_t other_schemas() const { return other_schemas_; }

 private:
  /// Returns whether the file ends in the middle of a line.
  bool read(const std::filesystem::path& file);

  std::filesystem::path folder_, file_;
  std::map<std::string, nlohmann::json> known_;
  std::map<std::string, std::string> place_of_;
  std::size_t records_ = 0, unreadable_ = 0, other_schemas_ = 0;
  bool broken_end_ = false;
};

}  // namespace kbvh::experiments
