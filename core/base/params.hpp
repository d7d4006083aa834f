#pragma once
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace kbvh {

/// The numbers that a parameter accepts.
enum class Numbers : std::uint8_t { any, whole };

/// A parameter of a strategy as data. `allowed` lists the admissible words; if it is empty, the parameter
/// accepts numbers from `least` to `most`, both included.
struct Parameter {
  std::string name;
  std::string default_value;
  std::vector<std::string> allowed;
  std::string meaning;
  double least = 0;
  double most = std::numeric_limits<double>::infinity();  ///< infinite: any finite number from `least` on
  Numbers numbers = Numbers::any;
};

/// Returns the admissible values in words: "avl | binary_heap", "a whole number from 1 to 64", "a number of
/// at least 0".
std::string admissible(const Parameter& parameter);

/// Reports an invalid configuration: the message names the offending key and value and the admissible values.
struct ConfigError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// The checked parameter values of a strategy. Every declared parameter is present.
class Params {
 public:
  Params() = default;
  /// Throws ConfigError on an undeclared key or an inadmissible value.
  Params(const std::string& owner, const std::vector<Parameter>& declared,
         const std::map<std::string, std::string>& given);
  const std::string& word(const std::string& key) const { return values_.at(key); }
  double number(const std::string& key) const;
  const std::map<std::string, std::string>& values() const { return values_; }

 private:
  std::map<std::string, std::string> values_;
};

}  // namespace kbvh
