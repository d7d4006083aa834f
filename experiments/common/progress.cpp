#include "experiments/common/progress.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>

#include "core/base/interruption.hpp"

namespace kbvh::experiments {

namespace {
std::string current_activity;
}

Progress::Progress() : terminal_(::isatty(STDERR_FILENO) == 1) {}

void Progress::show(const std::string& line) {
  Interruptible::check();
  current_activity = line;
  if (!terminal_) return;
  shown_ = true;
  winsize window{};
  const int width =
      ::ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1 ? window.ws_col - 1 : 99;
  std::fprintf(stderr, "\r\x1b[K%.*s", width, line.c_str());
  std::fflush(stderr);
}

void Progress::clear() {
  current_activity.clear();
  if (!shown_) return;
  shown_ = false;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
}

const std::string& Progress::activity() {
  return current_activity;
}

void say(const std::string& text) {
  std::fprintf(stderr, "kbvh: %s\n", text.c_str());
}

}  // namespace kbvh::experiments
