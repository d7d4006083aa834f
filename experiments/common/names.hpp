#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace kbvh::experiments {

/// The length of the UTF-8 character that begins at `at`, or 0 if the bytes there are none.
std::size_t utf8_length(std::string_view text, std::size_t at);

/// The text with every byte that is not UTF-8, or a control character, spelt out ("caf\xE9"): file names may
/// be any bytes, results are JSON, and names are of one line. Other text stays as it is.
std::string readable(std::string_view bytes);

/// Checks a name that a user gives to a scene or a body; throws io::InputError that begins with `place` if it
/// is not UTF-8, is longer than 1,000 bytes, has control characters in it, or is "." or "..". Anything else
/// is a name: `file_name` makes files of it.
void check_name(const std::string& name, const std::string& place);

/// A name that every file system takes, and that names nothing but an entry of its folder: '/' and other
/// characters that some system forbids become '-', so do leading dots; names of devices and trailing dots and
/// blanks get a '-' behind them, and a long name is cut to 100 bytes with its hash at the end.
std::string file_name(const std::string& name);

/// What a scene is called that has no name: those of its bodies, joined by '+'; of many, the first ones
/// ("sphere-20+sphere-20+18 more").
std::string name_of_bodies(const std::vector<std::string>& names);

}  // namespace kbvh::experiments
