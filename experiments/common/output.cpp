#include "experiments/common/output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace kbvh::experiments {

namespace {

/// The first error of standard output, which belongs to the process, as its stream does. 0: none.
int first_error = 0;

/// Where printed text goes instead of standard output; null: nowhere else.
std::string* receiver = nullptr;

}  // namespace

void prepare_output() {
  std::signal(SIGPIPE, SIG_IGN);
  // Beyond a limit on file sizes, writing fails as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  // A closed stream is replaced by one that cannot be used the wrong way: writing to standard output still
  // fails.
  const int modes[] = {O_WRONLY, O_RDONLY, O_WRONLY};
  for (int stream = 0; stream < 3; ++stream)
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF) ::open("/dev/null", modes[stream]);
}

PrintedText::PrintedText() {
  receiver = &text_;
}
PrintedText::~PrintedText() {
  receiver = nullptr;
}

void print(std::string_view text) {
  if (receiver != nullptr) {
    receiver->append(text);
    return;
  }
  errno = 0;
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size();
  const bool arrived = std::fflush(stdout) == 0 && written;
  if (!arrived && first_error == 0) first_error = errno != 0 ? errno : EIO;
}

std::string output_failure() {
  print("");
  if (first_error == 0 || first_error == EPIPE) return {};
  return std::strerror(first_error);
}

}  // namespace kbvh::experiments
