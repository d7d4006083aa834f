#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace kbvh::experiments {

/// Keeps on disk which configuration a run is measuring, so that a contestant that ends the program is known
/// afterwards: the next run with the same folder reports it, leaves it out, and measures the others.
///
/// The folder has a file *.measuring while a run measures: a line of JSON at each begin of some work, and, if
/// a signal of a fault (SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL) or std::terminate ends the program, a last
/// line that says so. There is one object at a time; signals have their former handlers again after its
/// lifetime.
class InProgress {
 public:
  /// What was being measured when an earlier run ended.
  struct Earlier {
    enum class Cause : unsigned char {
      fault,       ///< a signal of a fault
      terminated,  ///< std::terminate: perhaps memory ran out
    } cause;
    std::string doing;  ///< "verifying bottom_up on tablecloth"
    std::string how;    ///< "by SIGABRT (aborted)"
    std::vector<std::filesystem::path> files;
  };

  /// Reads what earlier runs on this machine left in the folder, and begins a file there. Without a folder
  /// nothing is kept, but a fault still names the work on standard error.
  explicit InProgress(const std::filesystem::path& folder);
  ~InProgress();
  InProgress(const InProgress&) = delete;
  InProgress& operator=(const InProgress&) = delete;

  /// Says what is being done with the configuration of this key. One write; nothing is flushed to disk.
  void begin(const std::string& key, const std::string& doing);
  /// Says that nothing is being measured.
  void end();

  /// Returns what ended an earlier run in this configuration; nullptr for most.
  const Earlier* earlier(const std::string& key) const;
  /// Forgets it: its record is written.
  void settle(const std::string& key);
  /// Returns what earlier runs were doing when they ended without a word (killed, or the machine stopped).
  const std::vector<std::string>& killed() const { return killed_; }

  /// Notes that std::terminate ends the program; for its handler.
  static void note_termination();

 private:
  void read(const std::filesystem::path& file);

  std::filesystem::path file_;
  int descriptor_ = -1;
  std::map<std::string, Earlier> earlier_;  // by key
  std::vector<std::string> killed_;
};

}  // namespace kbvh::experiments
