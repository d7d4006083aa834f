#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace kbvh::experiments {

/// A file or folder next to results.jsonl that a merge writes.
struct PlannedFile {
  std::filesystem::path from;  ///< copied, unless there is `content`
  std::filesystem::path to;
  std::string content;
};

/// Plans what a merge does with the files of `folders` next to results.jsonl: rows of targets.json are added,
/// the pictures of scenes copied, and files of single commands (theory.json, stress.json, ccd.json,
/// benchmark.json) copied, under a new number if `out` has another of the name. Adds a sentence to `notes`
/// for each new number. Throws io::InputError for a targets.json that is no list of targets. Writes nothing.
std::vector<PlannedFile> plan_files(const std::vector<std::filesystem::path>& folders,
                                    const std::filesystem::path& out, std::vector<std::string>& notes);

/// Writes the planned files, each in one step. Throws io::InputError.
void write_files(const std::vector<PlannedFile>& files);

}  // namespace kbvh::experiments
