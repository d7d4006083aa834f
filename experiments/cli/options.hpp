#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "experiments/common/ranges.hpp"

/// Options whose values are read once and strictly. CLI11's own conversions read "-1" as a large number and
/// "010" as eight, and drop empty parts of lists. Every message names the option and the value, and values
/// are never empty.
namespace kbvh::experiments {

/// Adds a text option, given once.
CLI::Option* add_text(CLI::App& command, const std::string& name, std::string& target,
                      const std::string& meaning);

/// Adds a text option that may be given several times, or several in a row for positional arguments.
CLI::Option* add_texts(CLI::App& command, const std::string& name, std::vector<std::string>& target,
                       const std::string& meaning);

/// Adds an option of words separated by commas; repeated words count once.
CLI::Option* add_words(CLI::App& command, const std::string& name, std::vector<std::string>& target,
                       const std::string& meaning);

/// Adds an option with a finite number from `least` to `most`, given once.
CLI::Option* add_number(CLI::App& command, const std::string& name, double& target, double least, double most,
                        const std::string& meaning);

/// Parses a whole number; throws CLI::ValidationError with `name` and the text.
std::uint64_t whole_number(const std::string& text, const std::string& name, const WholeRange& range);

/// Parses all comma-separated parts of `given`, each once; throws also for empty parts.
std::vector<std::uint64_t> whole_numbers(const std::vector<std::string>& given, const std::string& name,
                                         const WholeRange& range);

/// Returns the only value of `given`; throws for several, for an empty one and for another option.
std::string only_one(const std::vector<std::string>& given, const std::string& name);

/// No limit on the number of values.
inline constexpr int many_values = CLI::detail::expected_max_vector_size;

/// Adds an option with a whole number, given once.
template <class T>
CLI::Option* add_whole(CLI::App& command, const std::string& name, T& target, const WholeRange& range,
                       const std::string& meaning) {
  const CLI::callback_t read = [&target, name, range](const CLI::results_t& given) {
    target = T(whole_number(only_one(given, name), name, range));
    return true;
  };
  return command.add_option(name, read, meaning)->expected(1)->take_all()->type_name("UINT");
}

/// Adds an option of whole numbers separated by commas; repeated numbers count once.
template <class T>
CLI::Option* add_wholes(CLI::App& command, const std::string& name, std::vector<T>& target,
                        const WholeRange& range, const std::string& meaning) {
  const CLI::callback_t read = [&target, name, range](const CLI::results_t& given) {
    const std::vector<std::uint64_t> numbers = whole_numbers(given, name, range);
    target.assign(numbers.begin(), numbers.end());
    return true;
  };
  return command.add_option(name, read, meaning)
      ->expected(1, many_values)
      ->allow_extra_args()
      ->take_all()
      ->type_name("UINT");
}

}  // namespace kbvh::experiments
