#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kbvh::experiments {

/// The parts of a text between separators; "" has one empty part.
std::vector<std::string> split(std::string_view text, char separator);

/// "a, b, c".
std::string joined(const std::vector<std::string>& words, std::string_view separator = ", ");

/// "1 frame", "2 frames"; "2 queries", "2 vertices".
std::string counted(std::uint64_t count, const std::string& noun);

/// The plural of an English noun, as far as this program needs them.
std::string plural(const std::string& noun);

/// The finite number that is the whole of the text, or nothing.
std::optional<double> parse_number(std::string_view text);

/// The unsigned whole number that is the whole of the text, or nothing.
std::optional<std::uint64_t> parse_whole(std::string_view text);

/// "key=value" at its first '='; nothing if there is none or the key is empty.
std::optional<std::pair<std::string, std::string>> parse_assignment(std::string_view text);

/// The first of `known` with the fewest edits (a character inserted, deleted, replaced, or two neighbours
/// swapped) from `word`, or nothing if that takes more than a third of the word's characters: then it is no
/// misspelling. Letter case does not count, nor does '-' instead of '_'. A word that is the beginning of
/// exactly one of them (three characters or more) is taken for that one.
std::optional<std::string> nearest_of(std::string_view word, const std::vector<std::string>& known);

/// "there is no scene 'x'; known are a, b; did you mean 'a'?". Where the known names fill more than a line
/// they are left out; without a near one, `otherwise` stands there then ("`kbvh list` shows them").
std::string no_such(const std::string& kind, std::string_view word, const std::vector<std::string>& known,
                    const std::string& otherwise = "");

/// "; did you mean 'sphere'?" if `nearest_of` finds one, else "": the end of a message about an unknown name.
std::string suggestion(std::string_view word, const std::vector<std::string>& known);

/// 64 bits of FNV-1a with a final mix: for keys of configurations, not for secrets.
std::uint64_t hash_of(std::string_view text, std::uint64_t seed = 0);

/// 16 hexadecimal digits.
std::string hexadecimal(std::uint64_t value);

}  // namespace kbvh::experiments
