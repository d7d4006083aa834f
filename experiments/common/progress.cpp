#include "experiments/common/progress.hpp"

#include <unistd.h>

#include <cstdio>

namespace kbvh::experiments {

Progress::Progress() : terminal_(::isatty(STDERR_FILENO) == 1) {}

void Progress::show(const std::string& line) {
  if (!terminal_) return;
  shown_ = true;
  std::fprintf(stderr, "\r\x1b[K%.110s", line.c_str());
  std::fflush(stderr);
}

void Progress::clear() {
  if (!shown_) return;
  shown_ = false;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
}

void say(const std::string& text) {
  std::fprintf(stderr, "kbvh: %s\n", text.c_str());
}

}  // namespace kbvh::experiments
