#include "experiments/cli/options.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

namespace {

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw CLI::ValidationError(name, what);
}

/// Rejects an empty value, and a value that is the next option because the value was forgotten.
const std::string& present(const std::string& value, const std::string& name) {
  if (value.empty()) fail(name, "is empty, but needs a value");
  if (value.starts_with("--")) fail(name, "needs a value, got the option " + io::printable(value));
  return value;
}

/// Returns the comma-separated parts of all values.
std::vector<std::string> parts_of(const std::vector<std::string>& given, const std::string& name) {
  std::vector<std::string> parts;
  for (const std::string& text : given)
    for (const std::string& part : split(present(text, name), ',')) {
      if (part.empty()) fail(name, "has an empty part between commas in " + io::printable(text));
      parts.push_back(part);
    }
  if (parts.empty()) fail(name, "is empty, but needs a value");
  return parts;
}

std::string described(const WholeRange& range) {
  const bool unlimited = range.most == WholeRange().most;
  return fmt::format("a whole number from {} to {}", range.least,
                     unlimited ? "2^64 - 1" : std::to_string(range.most));
}

/// As in plans: repeated values count once, at their first place.
template <class T>
void add_once(std::vector<T>& list, T value) {
  if (std::find(list.begin(), list.end(), value) == list.end()) list.push_back(std::move(value));
}

}  // namespace

std::uint64_t whole_number(const std::string& text, const std::string& name, const WholeRange& range) {
  const auto value = parse_whole(text);
  if (!value || *value < range.least || *value > range.most)
    fail(name, "expected " + described(range) + ", got " + io::printable(text));
  return *value;
}

std::vector<std::uint64_t> whole_numbers(const std::vector<std::string>& given, const std::string& name,
                                         const WholeRange& range) {
  std::vector<std::uint64_t> numbers;
  for (const std::string& part : parts_of(given, name)) add_once(numbers, whole_number(part, name, range));
  return numbers;
}

std::string only_one(const std::vector<std::string>& given, const std::string& name) {
  // CLI11 adds "%%" to "{}", its notation for an empty list.
  if (given == std::vector<std::string>{"{}", "%%"}) return given[0];
  if (given.empty()) fail(name, "needs a value");
  if (given.size() > 1)
    fail(name, "is given twice, as " + io::printable(given[0]) + " and as " + io::printable(given[1]));
  return present(given[0], name);
}

CLI::Option* add_text(CLI::App& command, const std::string& name, std::string& target,
                      const std::string& meaning) {
  const CLI::callback_t read = [&target, name](const CLI::results_t& given) {
    target = only_one(given, name);
    return true;
  };
  return command.add_option(name, read, meaning)->expected(1)->take_all()->type_name("TEXT");
}

CLI::Option* add_texts(CLI::App& command, const std::string& name, std::vector<std::string>& target,
                       const std::string& meaning) {
  const CLI::callback_t read = [&target, name](const CLI::results_t& given) {
    for (const std::string& text : given) present(text, name);
    target = given;
    return true;
  };
  CLI::Option* option = command.add_option(name, read, meaning)->take_all()->type_name("TEXT");
  // An option takes one value each time; a positional argument has no prefix that begins the next.
  if (name.starts_with("-")) return option->expected(1);
  return option->expected(1, many_values)->allow_extra_args();
}

CLI::Option* add_words(CLI::App& command, const std::string& name, std::vector<std::string>& target,
                       const std::string& meaning) {
  const CLI::callback_t read = [&target, name](const CLI::results_t& given) {
    target.clear();
    for (const std::string& word : parts_of(given, name)) add_once(target, word);
    return true;
  };
  return command.add_option(name, read, meaning)
      ->expected(1, many_values)
      ->allow_extra_args()
      ->take_all()
      ->type_name("TEXT");
}

CLI::Option* add_number(CLI::App& command, const std::string& name, double& target, double least, double most,
                        const std::string& meaning) {
  const CLI::callback_t read = [&target, name, least, most](const CLI::results_t& given) {
    const std::string text = only_one(given, name);
    const auto value = parse_number(text);
    if (!value || *value < least || *value > most)
      fail(name,
           fmt::format("expected a number from {:g} to {:g}, got {}", least, most, io::printable(text)));
    target = *value;
    return true;
  };
  return command.add_option(name, read, meaning)->expected(1)->take_all()->type_name("FLOAT");
}

}  // namespace kbvh::experiments
