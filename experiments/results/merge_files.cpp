#include "experiments/results/merge_files.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr const char* numbered[] = {"theory", "stress", "ccd", "benchmark"};

/// Returns the files NAME.json, NAME-2.json, ... of a folder.
std::vector<fs::path> files_of(const fs::path& folder, const std::string& name) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() != ".json" || !entry.is_regular_file(error)) continue;
    const bool has_number = stem.starts_with(name + "-") && parse_whole(stem.substr(name.size() + 1));
    if (stem == name || has_number) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// Returns the first free name of NAME.json, NAME-2.json, ...
fs::path free_name(const fs::path& folder, const std::string& name, const std::set<fs::path>& taken) {
  std::error_code error;
  for (int i = 1;; ++i) {
    fs::path file = folder / (name + (i == 1 ? "" : "-" + std::to_string(i)) + ".json");
    if (!fs::exists(file, error) && !taken.contains(file)) return file;
  }
}

/// Adds the rows of targets that are not there yet; nothing if all are.
std::optional<std::string> merged_targets(const std::vector<fs::path>& folders, const fs::path& out) {
  json all = json::array();
  std::set<std::string> known;
  bool grew = false;
  const auto take = [&](const fs::path& file, bool adds) {
    const std::optional<json> rows = content_of(file);
    if (!rows) return;
    if (!rows->is_array()) throw io::InputError(file.string() + ": is not a list of targets");
    for (const json& row : *rows)
      if (known.insert(row.dump(-1, ' ', false, json::error_handler_t::replace)).second) {
        all.push_back(row);
        grew = grew || adds;
      }
  };
  take(out / "targets.json", false);
  for (const fs::path& folder : folders) take(folder / "targets.json", true);
  if (!grew) return {};
  return all.dump(1, ' ', false, json::error_handler_t::replace) + "\n";
}

/// Adds the lines of a file that are not there yet; nothing if all are.
std::optional<std::string> merged_lines(const std::vector<fs::path>& folders, const fs::path& out,
                                        const std::string& name) {
  std::string all;
  std::set<std::string> known;
  bool grew = false;
  const auto take = [&](const fs::path& file, bool adds) {
    std::error_code error;
    if (!fs::is_regular_file(file, error) || fs::file_size(file, error) == 0) return;
    for (const std::string& line : split(io::read_file(file), '\n'))
      if (!line.empty() && known.insert(line).second) {
        all += line + "\n";
        grew = grew || adds;
      }
  };
  take(out / name, false);
  for (const fs::path& folder : folders) take(folder / name, true);
  if (!grew) return {};
  return all;
}

}  // namespace

std::vector<PlannedFile> plan_files(const std::vector<fs::path>& folders, const fs::path& out,
                                    std::vector<std::string>& notes) {
  std::vector<PlannedFile> planned;
  std::set<fs::path> taken;
  for (const std::string name : numbered) {
    std::set<std::string> contents;
    for (const fs::path& file : files_of(out, name)) contents.insert(io::read_file(file));
    for (const fs::path& folder : folders)
      for (const fs::path& file : files_of(folder, name)) {
        std::error_code error;
        if (fs::file_size(file, error) == 0 || !contents.insert(io::read_file(file)).second) continue;
        PlannedFile one{file, free_name(out, name, taken), {}};
        taken.insert(one.to);
        if (one.to.stem() != name)
          notes.push_back(file.string() + " is kept as " + one.to.filename().string() +
                          ": the report shows " + name + ".json");
        planned.push_back(std::move(one));
      }
  }
  if (std::optional<std::string> rows = merged_targets(folders, out))
    planned.push_back({{}, out / "targets.json", std::move(*rows)});
  if (std::optional<std::string> lines = merged_lines(folders, out, "theory.jsonl"))
    planned.push_back({{}, out / "theory.jsonl", std::move(*lines)});
  for (const fs::path& folder : folders) {
    std::error_code error;
    for (const auto& scene : fs::directory_iterator(folder / "scenes", error)) {
      const fs::path to = out / "scenes" / scene.path().filename();
      if (!fs::is_regular_file(scene.path() / "card.json", error) || fs::exists(to, error)) continue;
      if (taken.insert(to).second) planned.push_back({scene.path(), to, {}});
    }
  }
  return planned;
}

void write_files(const std::vector<PlannedFile>& files) {
  for (const PlannedFile& file : files) {
    std::error_code error;
    if (!file.content.empty()) {
      io::write_file_atomically(file.to, file.content);
    } else if (fs::is_directory(file.from, error)) {
      // Copied under another name first: a folder with half of its meshes would be taken for a picture.
      const fs::path unfinished = file.to.parent_path() / ("." + file.to.filename().string() + ".unfinished");
      fs::create_directories(file.to.parent_path(), error);
      fs::remove_all(unfinished, error);
      fs::copy(file.from, unfinished, fs::copy_options::recursive, error);
      if (!error) fs::rename(unfinished, file.to, error);
      if (error) throw io::InputError(file.to.string() + ": cannot be written: " + error.message());
    } else {
      io::write_file_atomically(file.to, io::read_file(file.from));
    }
  }
}

}  // namespace kbvh::experiments
