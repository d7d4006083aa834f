#pragma once
#include <string>

namespace kbvh::experiments {

/// One line on standard error that says what long work is doing; silent unless that is a terminal. There is
/// one at a time.
class Progress {
 public:
  Progress();
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// Replaces the line.
  void show(const std::string& line);
  /// Removes the line, before anything else is printed.
  void clear();
  /// The text that was shown last and is not cleared, on any standard error; empty if there is none.
  static const std::string& activity();

 private:
  bool terminal_ = false;
  bool shown_ = false;
};

/// Prints "kbvh: TEXT" on standard error.
void say(const std::string& text);

}  // namespace kbvh::experiments
