#pragma once
#include <string>

namespace kbvh::experiments {

/// A progress line on standard error; silent unless standard error is a terminal. There is one at a time.
class Progress {
 public:
  Progress();
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// Replaces the line.
  void show(const std::string& line);
  /// Removes the line; call it before any other output.
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
