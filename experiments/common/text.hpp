#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kbvh::experiments {

/// Returns the parts of a text between separators; "" has one empty part.
std::vector<std::string> split(std::string_view text, char separator);

/// Joins words: "a, b, c".
std::string joined(const std::vector<std::string>& words, std::string_view separator = ", ");

/// Composes "1 frame", "2 frames"; "2 queries", "2 vertices".
std::string counted(std::uint64_t count, const std::string& noun);

/// Returns the plural of an English noun, as far as this program needs it.
std::string plural(const std::string& noun);

/// Parses the whole text as a finite number, or returns nothing.
std::optional<double> parse_number(std::string_view text);

/// Parses the whole text as an unsigned whole number, or returns nothing.
std::optional<std::uint64_t> parse_whole(std::string_view text);

/// Splits "key=value" at its first '='; nothing if there is none or the key is empty.
std::optional<std::pair<std::string, std::string>> parse_assignment(std::string_view text);

/// Returns the first of `known` with the fewest edits from `word` (a character inserted, deleted, replaced,
/// or two neighbours swapped), or nothing if that takes more than a third of the word's characters, because
/// the word is then no misspelling. Letter case does not count, nor does '-' instead of '_'. A word of three
/// or more characters that is the beginning of exactly one of them matches that one.
std::optional<std::string> nearest_of(std::string_view word, const std::vector<std::string>& known);

/// Composes "there is no scene 'x'; known are a, b; did you mean 'a'?". Known names that fill more than a
/// line are left out; if there is no similar name either, `otherwise` takes their place ("`kbvh list` shows
/// them").
std::string no_such(const std::string& kind, std::string_view word, const std::vector<std::string>& known,
                    const std::string& otherwise = "");

/// Composes "; did you mean 'sphere'?" if `nearest_of` finds a name, else "": the end of a message about an
/// unknown name.
std::string suggestion(std::string_view word, const std::vector<std::string>& known);

/// Computes 64 bits of FNV-1a with a final mix: for keys of configurations, not for secrets.
std::uint64_t hash_of(std::string_view text, std::uint64_t seed = 0);

/// Formats 16 hexadecimal digits.
std::string hexadecimal(std::uint64_t value);

}  // namespace kbvh::experiments
