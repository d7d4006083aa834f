#include "experiments/results/merge.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/merge_files.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

/// Returns whether a text is a time as this program writes it, 2026-01-31T23:59:59Z, on a day that exists.
bool is_time(const std::string& text) {
  constexpr std::string_view form = "dddd-dd-ddTdd:dd:ddZ";
  if (text.size() != form.size()) return false;
  for (std::size_t i = 0; i < form.size(); ++i)
    if (form[i] == 'd' ? text[i] < '0' || text[i] > '9' : text[i] != form[i]) return false;
  const auto at = [&](std::size_t begin, std::size_t digits) {
    return unsigned(*parse_whole(std::string_view(text).substr(begin, digits)));
  };
  const std::chrono::year_month_day day{std::chrono::year(int(at(0, 4))), std::chrono::month(at(5, 2)),
                                        std::chrono::day(at(8, 2))};
  return at(0, 4) > 0 && day.ok() && at(11, 2) < 24 && at(14, 2) < 60 && at(17, 2) <= 60;
}

/// One line of a results file.
struct Line {
  std::string text, place;  // the place is "FILE line N"
  json record;

  std::string key() const { return record.at("key").get<std::string>(); }
  /// Returns when it was measured; empty if it does not say so.
  std::string time() const {
    const auto when = record.find("when");
    return when != record.end() && when->is_string() && is_time(*when) ? when->get<std::string>() : "";
  }
  /// Orders the records of one key; the largest counts.
  std::pair<bool, std::string> rank() const {
    const auto unfinished = record.find("unfinished");
    return {unfinished == record.end() || *unfinished != json(true), time()};
  }
};

std::string text_at(const json& object, const char* name) {
  const auto found = object.find(name);
  return found == object.end() ? "" : found->is_string() ? found->get<std::string>() : found->dump();
}

/// Returns why a JSON value is no record that can be merged; "" for a record.
std::string no_record(const json& value) {
  if (!value.is_object() || !value.contains("schema")) return "is no record of results: it has no schema";
  // Readers show older records apart from newer ones.
  if (value.at("schema") != json(results_schema) && value.at("schema") != json(oldest_results_schema))
    return "has schema " + value.at("schema").dump(-1, ' ', false, json::error_handler_t::replace) +
           ", but this program merges schemas " + std::to_string(oldest_results_schema) + " to " +
           std::to_string(results_schema);
  if (!value.contains("key") || !value.at("key").is_string() || value.at("key").get<std::string>().empty())
    return "is no record of results: it has no key";
  if (!value.contains("machine") || !value.at("machine").is_object())
    return "is no record of results: it does not describe the machine";
  return {};
}

/// Reads the records of a file. Unreadable lines, which killed studies leave behind, are skipped with a note.
std::vector<Line> read_lines(const fs::path& file, std::vector<std::string>& notes) {
  const std::string all = io::read_file(file);
  std::vector<Line> lines;
  std::size_t number = 0, defects = 0, undated = 0;
  std::string first_defect, first_undated;
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = all.find('\n', begin);
    const bool breaks_off = end == std::string::npos;
    if (breaks_off) end = all.size();
    Line line{all.substr(begin, end - begin), file.string() + " line " + std::to_string(++number), {}};
    begin = end + 1;
    if (line.text.find_first_not_of(" \t\r") == std::string::npos) continue;
    line.record = json_or_nothing(line.text);
    if (line.record.is_discarded()) {
      notes.push_back(line.place + " is skipped: it " +
                      (breaks_off ? "breaks off, as after an interrupted run" : "is not JSON"));
      continue;
    }
    if (const std::string why = no_record(line.record); !why.empty())
      throw io::InputError(line.place + ": " + why);
    if (const std::string why = unusable(line.record); !why.empty() && ++defects == 1)
      first_defect = line.place + ": " + why;
    if (line.time().empty() && ++undated == 1) first_undated = line.place;
    lines.push_back(std::move(line));
  }
  if (lines.empty()) throw io::InputError(file.string() + ": has no record of results");
  if (defects > 0)
    notes.push_back(counted(defects, "record") + " of " + file.string() +
                    (defects == 1 ? " lacks" : " lack") + " a field that tables need (" + first_defect +
                    "), and " + (defects == 1 ? "is" : "are") + " kept unchanged");
  if (undated > 0)
    notes.push_back(counted(undated, "record") + " of " + file.string() + (undated == 1 ? " has" : " have") +
                    " no valid time (" + first_undated + "), and " + (undated == 1 ? "counts" : "count") +
                    " as older than all others");
  return lines;
}

/// Returns the results file of an input: the file itself, or that of the folder.
fs::path records_of(const fs::path& input) {
  std::error_code error;
  if (fs::is_regular_file(input, error)) return input;
  if (!fs::is_directory(input, error))
    throw io::InputError("there is no folder of results " + input.string());
  const fs::path file = input / "results.jsonl";
  if (!fs::is_regular_file(file, error))
    throw io::InputError("there is no " + file.string() + " (`kbvh run --out " + input.string() +
                         "` makes it)");
  return file;
}

/// The records of the merged folder: those that are there, then those to be added.
class Merger {
 public:
  explicit Merger(MergeOutcome& outcome) : outcome_(outcome) {}

  /// Takes a line of the folder itself.
  void keep(Line line) { take(std::move(line), false); }
  /// Takes a line of an input.
  void add(Line line) { take(std::move(line), true); }

  /// Returns the lines to be appended, in an order in which the record that counts is the last of its key.
  std::vector<const Line*> appended() {
    std::map<std::string, std::vector<std::size_t>> places;  // of new lines, by key
    for (std::size_t i = 0; i < added_.size(); ++i) places[lines_[added_[i]].key()].push_back(i);
    std::vector<const Line*> result(added_.size());
    std::vector<const Line*> again;
    for (const auto& [key, at] : places) {
      std::vector<std::size_t> mine;
      for (const std::size_t i : at) mine.push_back(added_[i]);
      const auto newer = [&](std::size_t a, std::size_t b) { return lines_[a].rank() < lines_[b].rank(); };
      std::stable_sort(mine.begin(), mine.end(), newer);
      for (std::size_t i = 0; i < at.size(); ++i) result[at[i]] = &lines_[mine[i]];
      const auto there = counting_.find(key);
      if (there != counting_.end() && lines_[mine.back()].rank() < lines_[there->second].rank())
        again.push_back(&lines_[there->second]);
    }
    result.insert(result.end(), again.begin(), again.end());
    return result;
  }

  /// Adds sentences on measurements that two machines share.
  void compare_machines() {
    std::map<std::string, std::set<std::string>> machines;  // by key
    for (const Line& line : lines_) machines[line.key()].insert(line.record.at("machine").dump());
    const auto shared = std::count_if(machines.begin(), machines.end(),
                                      [](const auto& one) { return one.second.size() > 1; });
    if (shared > 0)
      outcome_.notes.push_back(
          counted(std::uint64_t(shared), "configuration") + (shared == 1 ? " was" : " were") +
          " measured on several machines with one processor and build, which differ in system or memory; all "
          "records are kept, and a study that is continued counts the newest");
  }

 private:
  void take(Line line, bool adds) {
    std::string run = text_at(line.record, "run");
    if (run.empty()) run = line.text;  // not recorded
    const auto identity = std::tuple(line.key(), run, text_at(line.record, "when"));
    if (const auto known = known_.find(identity); known != known_.end()) {
      const Line& there = lines_[known->second];
      if (there.record != line.record)
        throw io::InputError(line.place + ": is the same measurement as " + there.place + " (key " +
                             io::printable(line.key()) + ", run " +
                             io::printable(text_at(line.record, "run")) +
                             "), but the two differ: one of them was altered or damaged");
      if (adds)
        ++outcome_.repeated;
      else
        counting_.insert_or_assign(line.key(), known->second);
      return;
    }
    known_.emplace(identity, lines_.size());
    outcome_.machines.insert(line.record.at("machine").dump());
    outcome_.commits.insert(text_at(line.record, "commit"));
    if (adds) {
      added_.push_back(lines_.size());
      ++outcome_.added;
    } else {
      // Readers take the last one, whatever its rank.
      counting_.insert_or_assign(line.key(), lines_.size());
    }
    lines_.push_back(std::move(line));
  }

  MergeOutcome& outcome_;
  std::vector<Line> lines_;
  std::vector<std::size_t> added_;               // indices of lines
  std::map<std::string, std::size_t> counting_;  // by key: the line of the folder that counts
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> known_;
};

/// Appends to a file; on failure the file is as before, unless another process has written to it meanwhile.
void append_all(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0644);
  const auto failed = [&](int reason) {
    if (descriptor >= 0) ::close(descriptor);
    throw io::InputError(file.string() + ": cannot be written: " + std::strerror(reason));
  };
  if (descriptor < 0) failed(errno);
  struct stat before {};
  if (::fstat(descriptor, &before) != 0) failed(errno);
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::write(descriptor, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += std::size_t(n);
  }
  if (done == text.size() && ::fsync(descriptor) == 0) {
    ::close(descriptor);
    return;
  }
  const int reason = errno;
  struct stat after {};
  if (::fstat(descriptor, &after) == 0 && after.st_size == before.st_size + off_t(done) &&
      ::ftruncate(descriptor, before.st_size) != 0) {
    // What was written stays: whole records, and one that breaks off, which readers skip.
  }
  failed(reason);
}

}  // namespace

MergeOutcome merge_results(const std::vector<fs::path>& inputs, const fs::path& out) {
  MergeOutcome outcome;
  Merger merger(outcome);
  const fs::path file = out / "results.jsonl";
  std::error_code error;
  std::vector<fs::path> sources, folders;
  for (const fs::path& input : inputs) {
    const fs::path records = records_of(input);
    if (fs::equivalent(records, file, error)) continue;  // adding others to one of the inputs
    sources.push_back(records);
    if (fs::is_directory(input, error)) folders.push_back(input);
  }
  if (sources.empty())
    throw io::InputError("there is nothing to merge: " + out.string() + " is the only input");
  std::vector<std::vector<Line>> contents;
  for (const fs::path& source : sources) contents.push_back(read_lines(source, outcome.notes));

  prepare_folder(out);
  const FolderLock lock(out);
  std::string end;
  if (fs::exists(file, error) && fs::file_size(file, error) > 0) {
    for (Line& line : read_lines(file, outcome.notes)) {
      merger.keep(std::move(line));
      ++outcome.records;
    }
    if (io::read_file(file).back() != '\n') end = "\n";
  }
  for (std::vector<Line>& lines : contents)
    for (Line& line : lines) merger.add(std::move(line));
  merger.compare_machines();
  const std::vector<PlannedFile> files = plan_files(folders, out, outcome.notes);

  std::string text = end;
  const std::vector<const Line*> appended = merger.appended();
  for (const Line* line : appended) text += line->text + "\n";
  outcome.records += appended.size();
  if (!appended.empty()) append_all(file, text);
  write_files(files);
  return outcome;
}

}  // namespace kbvh::experiments
