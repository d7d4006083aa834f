#include "experiments/common/json_reader.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/common/text.hpp"
#include "experiments/io/json_text.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {
std::string shown(const json& value) {
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  if (text.size() > 40) text = text.substr(0, 40) + "...";
  return text;
}
}  // namespace

JsonReader::JsonReader(const json& value, std::string place) : value_(&value), place_(std::move(place)) {
  if (!value.is_object())
    throw io::InputError(place_ + ": expected an object with named members, got " + shown(value));
}

const json* JsonReader::find(const std::string& key) {
  known_.insert(key);
  const auto member = value_->find(key);
  return member == value_->end() ? nullptr : &*member;
}

std::optional<std::string> JsonReader::word(const std::string& key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_string()) fail(key, "expected a text, got " + shown(*value));
  return value->get<std::string>();
}

std::optional<double> JsonReader::number(const std::string& key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_number() || !std::isfinite(value->get<double>()))
    fail(key, "expected a finite number, got " + shown(*value));
  return value->get<double>();
}

std::uint64_t JsonReader::whole_of(const json& value, const std::string& key, std::uint64_t least,
                                   std::uint64_t most) const {
  const auto wrong = [&] {
    fail(key, "expected a whole number from " + std::to_string(least) + " to " + std::to_string(most) +
                  ", got " + shown(value));
  };
  if (!value.is_number_integer() || (!value.is_number_unsigned() && value.get<std::int64_t>() < 0)) wrong();
  const auto number = value.get<std::uint64_t>();
  if (number < least || number > most) wrong();
  return number;
}

std::optional<std::uint64_t> JsonReader::whole(const std::string& key, std::uint64_t least,
                                               std::uint64_t most) {
  const json* value = find(key);
  if (value == nullptr) return {};
  return whole_of(*value, key, least, most);
}

std::optional<bool> JsonReader::truth(const std::string& key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_boolean()) fail(key, "expected true or false, got " + shown(*value));
  return value->get<bool>();
}

std::vector<json> JsonReader::list(const std::string& key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_array()) return {*value};
  if (value->empty()) fail(key, "the list is empty");
  return value->get<std::vector<json>>();
}

std::vector<std::string> JsonReader::words(const std::string& key) {
  std::vector<std::string> words;
  for (const json& value : list(key)) {
    if (!value.is_string()) fail(key, "expected texts, got " + shown(value));
    words.push_back(value.get<std::string>());
  }
  return words;
}

std::vector<std::uint64_t> JsonReader::wholes(const std::string& key, std::uint64_t least,
                                              std::uint64_t most) {
  std::vector<std::uint64_t> numbers;
  for (const json& value : list(key)) numbers.push_back(whole_of(value, key, least, most));
  return numbers;
}

std::optional<std::vector<double>> JsonReader::numbers(const std::string& key, std::size_t size) {
  const json* value = find(key);
  if (value == nullptr) return {};
  const bool right = value->is_array() && value->size() == size &&
                     std::all_of(value->begin(), value->end(), [](const json& number) {
                       return number.is_number() && std::isfinite(number.get<double>());
                     });
  if (!right)
    fail(key, "expected a list of " + std::to_string(size) + " finite numbers, got " + shown(*value));
  return value->get<std::vector<double>>();
}

void JsonReader::finish() const {
  for (const auto& [key, value] : value_->items())
    if (!known_.contains(key)) {
      const std::vector<std::string> known(known_.begin(), known_.end());
      throw io::InputError(place_ + ": there is no key '" + key + "'; known are " + joined(known) +
                           suggestion(key, known));
    }
}

void JsonReader::fail(const std::string& key, const std::string& what) const {
  throw io::InputError(place_ + ": " + key + ": " + what);
}

json parse_json(const std::string& text, const std::string& name) {
  return io::parse_json_text(text, name);
}

}  // namespace kbvh::experiments
