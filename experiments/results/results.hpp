#pragma once
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace kbvh::experiments {

/// The value of a text of a file that this program wrote, or a discarded one (`is_discarded`) for what is no
/// JSON or is nested deeper than anything that it writes: copying such a value would exhaust the stack.
nlohmann::json json_or_nothing(std::string_view text);

/// Makes a folder that results are to be written to, and writes and removes a small file there: a folder that
/// is none, cannot be written or is on a full disk is noticed before hours of work. Throws io::InputError.
void prepare_folder(const std::filesystem::path& folder);

/// The append-only result file of a folder, results.jsonl: one JSON object per line, written in one piece.
/// RESULTS.md documents the records. Lines that cannot be read (of a run that was killed) are skipped and
/// counted, never mended.
class ResultStore {
 public:
  /// Creates the folder and reads what is there. Throws io::InputError if it cannot be written.
  explicit ResultStore(const std::filesystem::path& folder);
  ResultStore(const ResultStore&) = delete;
  ResultStore& operator=(const ResultStore&) = delete;

  /// The newest record with this key, or nullptr.
  const nlohmann::json* find(const std::string& key) const;
  /// "FILE line N", where that record is, of one that was read from the file; else the file.
  std::string place(const std::string& key) const;
  /// Writes the record as one line, flushed to the disk. Throws io::InputError if that fails.
  void append(const nlohmann::json& record);

  const std::filesystem::path& folder() const { return folder_; }
  std::size_t records() const { return records_; }
  std::size_t unreadable_lines() const { return unreadable_; }

 private:
  std::filesystem::path folder_, file_;
  std::map<std::string, nlohmann::json> known_;
  std::map<std::string, std::size_t> line_of_;
  std::size_t records_ = 0, unreadable_ = 0;
  bool broken_end_ = false;
};

}  // namespace kbvh::experiments
