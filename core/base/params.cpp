#include "core/base/params.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace kbvh {

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
    if (!parameter->allowed.empty()) {
      if (std::find(parameter->allowed.begin(), parameter->allowed.end(), value) ==
          parameter->allowed.end()) {
        std::string allowed;
        for (const std::string& word : parameter->allowed) allowed += (allowed.empty() ? "" : ", ") + word;
        throw ConfigError("parameter '" + key + "' of '" + owner + "' cannot be '" + value +
                          "'; allowed are " + allowed);
      }
    } else {
      double number = 0;
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
      if (error != std::errc() || end != value.data() + value.size() || !std::isfinite(number) ||
          number < parameter->minimum) {
        char least[32];
        const std::string shortest(least, std::to_chars(least, least + sizeof least, parameter->minimum).ptr);
        throw ConfigError("parameter '" + key + "' of '" + owner + "' cannot be '" + value +
                          "'; it is a finite number of at least " + shortest);
      }
    }
    values_[key] = value;
  }
}

}  // namespace kbvh
