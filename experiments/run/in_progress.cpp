#include "experiments/run/in_progress.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "experiments/common/machine.hpp"
#include "experiments/common/names.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr const char* measuring_extension = ".measuring";

struct Fault {
  int signal;
  const char* message;  ///< for standard error, before the work
  const char* line;     ///< for the file
};
constexpr std::array<Fault, 5> fault_signals{
    {{SIGABRT, "\nkbvh: aborted (SIGABRT) while ", "{\"fault\":\"by SIGABRT (aborted)\"}\n"},
     {SIGSEGV, "\nkbvh: invalid access to memory (SIGSEGV) while ",
      "{\"fault\":\"by SIGSEGV (invalid access to memory)\"}\n"},
     {SIGBUS, "\nkbvh: bus error (SIGBUS) while ", "{\"fault\":\"by SIGBUS (bus error)\"}\n"},
     {SIGFPE, "\nkbvh: arithmetic fault (SIGFPE) while ", "{\"fault\":\"by SIGFPE (arithmetic fault)\"}\n"},
     {SIGILL, "\nkbvh: illegal instruction (SIGILL) while ",
      "{\"fault\":\"by SIGILL (illegal instruction)\"}\n"}}};

// What the handler reads. It may run in any thread, at any moment.
std::atomic<int> fault_file{-1};
std::atomic<bool> being_measured{false};
char fault_work[1000];  // what is being done while `being_measured`; changed only while it is false
std::array<struct sigaction, fault_signals.size()> former_actions;

void write_all(int file, const char* text) {
  for (std::size_t left = std::strlen(text); left > 0;) {
    const ssize_t written = ::write(file, text, left);
    if (written <= 0) return;
    text += written;
    left -= std::size_t(written);
  }
}

/// Says what was being measured, and lets the former handler end the program.
extern "C" void say_fault(int signal) {
  const bool known = being_measured.exchange(false);
  for (std::size_t i = 0; i < fault_signals.size(); ++i) {
    if (fault_signals[i].signal != signal) continue;
    if (known) {
      write_all(STDERR_FILENO, fault_signals[i].message);
      write_all(STDERR_FILENO, fault_work);
      if (const int file = fault_file; file >= 0) {
        write_all(file, fault_signals[i].line);
        write_all(STDERR_FILENO,
                  "; what this table has measured is lost, and the same command goes on without it\n");
      } else {
        write_all(STDERR_FILENO, "\n");
      }
    }
    ::sigaction(signal, &former_actions[i], nullptr);
  }
  ::raise(signal);
}

bool process_runs(std::uint64_t process) {
  return process > 0x7fffffff || ::kill(pid_t(process), 0) == 0 || errno != ESRCH;
}

std::string text_in(const json& line, const char* name) {
  const auto found = line.find(name);
  return found != line.end() && found->is_string() ? found->get<std::string>() : "";
}

/// A stack for the handler: recursion without end leaves it none.
void give_stack() {
  static const auto stack = std::make_unique<char[]>(1U << 16U);
  stack_t said{};
  if (::sigaltstack(nullptr, &said) == 0 && (said.ss_flags & SS_DISABLE) == 0) return;
  said = {};
  said.ss_sp = stack.get();
  said.ss_size = 1U << 16U;
  ::sigaltstack(&said, nullptr);
}

}  // namespace

InProgress::InProgress(const std::filesystem::path& folder) {
  give_stack();
  for (std::size_t i = 0; i < fault_signals.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = &say_fault;
    action.sa_flags = SA_ONSTACK;
    ::sigaction(fault_signals[i].signal, &action, &former_actions[i]);
  }
  if (folder.empty()) return;
  std::error_code error;
  std::vector<std::filesystem::path> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == measuring_extension && entry.is_regular_file(error))
      left.push_back(entry.path());
  for (const std::filesystem::path& file : left) read(file);
  file_ = folder / (host_name() + "-" + std::to_string(::getpid()) + measuring_extension);
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  fault_file = descriptor_;
}

InProgress::~InProgress() {
  end();
  fault_file = -1;
  for (std::size_t i = 0; i < fault_signals.size(); ++i)
    ::sigaction(fault_signals[i].signal, &former_actions[i], nullptr);
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  std::error_code error;
  std::filesystem::remove(file_, error);
}

void InProgress::read(const std::filesystem::path& file) {
  std::string key, doing, how;
  Earlier::Cause cause = Earlier::Cause::fault;
  std::string all;
  try {
    // A run that was killed between two works has left an empty file.
    if (std::error_code error; std::filesystem::file_size(file, error) > 0) all = io::read_file(file);
  } catch (const io::InputError&) {
    return;
  }
  for (const std::string& text : split(all, '\n')) {
    const json line = json_or_nothing(text);
    if (!line.is_object()) continue;
    if (line.contains("key")) {
      key = text_in(line, "key");
      doing = text_in(line, "doing");
    }
    for (const auto& [word, meaning] :
         {std::pair{"fault", Earlier::Cause::fault}, std::pair{"terminated", Earlier::Cause::terminated}})
      if (how.empty() && line.contains(word)) {
        how = text_in(line, word);
        cause = meaning;
      }
  }
  if (!key.empty() && !how.empty()) {
    Earlier& one = earlier_[key];
    one.cause = cause;
    one.doing = doing;
    one.how = how;
    one.files.push_back(file);
    return;
  }
  // A file of a process that still runs, perhaps on another machine, is in use.
  const std::string name = file.stem().string(), here = host_name() + "-";
  const auto process = name.starts_with(here) ? parse_whole(name.substr(here.size())) : std::nullopt;
  if (!process || (*process != std::uint64_t(::getpid()) && process_runs(*process))) return;
  if (!doing.empty()) killed_.push_back(doing);
  std::error_code error;
  std::filesystem::remove(file, error);
}

void InProgress::begin(const std::string& key, const std::string& doing) {
  being_measured = false;
  const std::string shown = readable(doing).substr(0, sizeof fault_work - 1);
  std::memcpy(fault_work, shown.c_str(), shown.size() + 1);
  being_measured = true;
  if (descriptor_ < 0) return;
  const json line{{"key", key}, {"doing", doing}};
  write_all(descriptor_, (line.dump(-1, ' ', false, json::error_handler_t::replace) + "\n").c_str());
}

void InProgress::end() {
  being_measured = false;
  if (descriptor_ >= 0 && ::ftruncate(descriptor_, 0) != 0) {
    // The file keeps its lines, and is removed in the end.
  }
}

const InProgress::Earlier* InProgress::earlier(const std::string& key) const {
  const auto found = earlier_.find(key);
  return found == earlier_.end() ? nullptr : &found->second;
}

void InProgress::settle(const std::string& key) {
  const auto found = earlier_.find(key);
  if (found == earlier_.end()) return;
  std::error_code error;
  for (const std::filesystem::path& file : found->second.files) std::filesystem::remove(file, error);
  earlier_.erase(found);
}

void InProgress::note_termination() {
  if (!being_measured.exchange(false) || fault_file < 0) return;
  write_all(fault_file, "{\"terminated\":\"by std::terminate, perhaps for want of memory\"}\n");
}

}  // namespace kbvh::experiments
