#pragma once
#include <string>
#include <string_view>

namespace kbvh::experiments {

/// Makes output safe to write: neither a closed pipe nor a limit on the size of files ends the program, and
/// no file that is opened later takes the place of a standard stream that was closed from the start.
void prepare_output();

/// Prints on standard output, at once. Does not throw, because a table that cannot be shown must not lose
/// what is still being measured; `output_failure` tells of it at the end.
void print(std::string_view text);

/// Why something that was printed did not arrive, as "No space left on device". Empty if everything arrived,
/// or if the reader closed the pipe: it has what it wanted.
std::string output_failure();

}  // namespace kbvh::experiments
