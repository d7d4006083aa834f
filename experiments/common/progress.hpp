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
  /// Replaces the line. Throws Interrupted if the user ends the work (core/base/interruption.hpp).
  void show(const std::string& line);
  /// Removes the line; call it before any other output.
  void clear();
  /// Returns the last shown text that is not cleared, on any standard error; empty if there is none.
  static const std::string& activity();

 private:
  bool terminal_ = false;
  bool shown_ = false;
};

/// Prints "kbvh: TEXT" on standard error.
void say(const std::string& text);

}  // namespace kbvh::experiments
