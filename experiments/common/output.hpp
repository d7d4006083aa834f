#pragma once
#include <string>
#include <string_view>

namespace kbvh::experiments {

/// Makes output safe to write: neither a closed pipe nor a limit on the size of files ends the program, and
/// no file that is opened later takes the place of a standard stream that was closed from the start.
void prepare_output();

/// Prints on standard output, at once. Does not throw, because a table that cannot be shown must not lose
/// running measurements; `output_failure` reports the failure at the end.
void print(std::string_view text);

/// Receives what `print` prints during its lifetime, instead of standard output. There is one at a time.
class PrintedText {
 public:
  PrintedText();
  ~PrintedText();
  PrintedText(const PrintedText&) = delete;
  PrintedText& operator=(const PrintedText&) = delete;
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// Returns why some output was not written, for example "No space left on device". Empty if everything was
/// written, or if the reader closed the pipe deliberately.
std::string output_failure();

}  // namespace kbvh::experiments
