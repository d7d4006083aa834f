#include "core/base/params.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/library_gaps.hpp"

namespace kbvh {

namespace {

/// Parses a number, subnormal ones included; returns NaN if the text is not a number.
double number_of(const std::string& text) {
  double number = 0;
  const auto [end, error] = parse_floating(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? number : std::numeric_limits<double>::quiet_NaN();
}

bool takes(const Parameter& parameter, const std::string& value) {
  if (!parameter.allowed.empty())
    return std::find(parameter.allowed.begin(), parameter.allowed.end(), value) != parameter.allowed.end();
  const double number = number_of(value);
  return std::isfinite(number) && number >= parameter.least && number <= parameter.most &&
         (parameter.numbers == Numbers::any || number == std::floor(number));
}

}  // namespace

std::string admissible(const Parameter& parameter) {
  if (!parameter.allowed.empty()) {
    std::string words;
    for (const std::string& word : parameter.allowed) words += (words.empty() ? "" : " | ") + word;
    return words;
  }
  const std::string number = parameter.numbers == Numbers::whole ? "a whole number" : "a number";
  if (std::isinf(parameter.most)) return number + " of at least " + shortest_text(parameter.least);
  return number + " from " + shortest_text(parameter.least) + " to " + shortest_text(parameter.most);
}

Params::Params(const std::string& owner, const std::vector<Parameter>& declared,
               const std::map<std::string, std::string>& given) {
  for (const Parameter& parameter : declared) values_[parameter.name] = parameter.default_value;
  for (const auto& [key, value] : given) {
    const auto parameter = std::find_if(declared.begin(), declared.end(),
                                        [&key = key](const Parameter& p) { return p.name == key; });
    if (parameter == declared.end()) {
      std::string known;
      for (const Parameter& p : declared) known += (known.empty() ? "" : ", ") + p.name;
      throw ConfigError("'" + owner + "' has no parameter '" + key + "'; it has " +
                        (known.empty() ? "none" : known));
    }
    if (!takes(*parameter, value))
      throw ConfigError("parameter '" + key + "' of '" + owner + "' cannot be '" + value + "': it is " +
                        admissible(*parameter));
    values_[key] = value;
  }
}

double Params::number(const std::string& key) const {
  return number_of(values_.at(key));
}

}  // namespace kbvh
