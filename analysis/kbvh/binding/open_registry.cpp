// The registry of a Python process: the strategies of the manifest, and those that are registered at run
// time.

#include "open_registry.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/contract/about.hpp"

namespace kbvh::native {
const std::vector<StrategyEntry>& registry();
std::string_view about(std::string_view id);
}  // namespace kbvh::native

namespace kbvh {

namespace {

std::vector<StrategyEntry>& entries() {
  static std::vector<StrategyEntry> all = [] {
    std::vector<StrategyEntry> copy = native::registry();
    copy.reserve(native::registry().size() + python::most_registered);
    return copy;
  }();
  return all;
}

/// The texts of registered strategies, by slot.
std::vector<std::string>& abouts() {
  static std::vector<std::string> texts(python::most_registered);
  return texts;
}

}  // namespace

const std::vector<StrategyEntry>& registry() {
  return entries();
}

std::string_view about(std::string_view id) {
  const std::size_t slot = python::slot_of(std::string(id));
  return slot == python::most_registered ? native::about(id) : std::string_view(abouts()[slot]);
}

namespace python {

std::size_t slot_of(const std::string& id) {
  const std::size_t natives = native::registry().size();
  for (std::size_t i = natives; i < entries().size(); ++i)
    if (entries()[i].info.id == id) return i - natives;
  return most_registered;
}

std::size_t slot_for(const std::string& id) {
  for (const StrategyEntry& other : native::registry())
    if (other.info.id == id) throw ConfigError("'" + id + "' is a strategy of kbvh; choose another id");
  const std::size_t slot = std::min(slot_of(id), entries().size() - native::registry().size());
  if (slot == most_registered)
    throw std::logic_error(std::to_string(most_registered) + " strategies are registered already");
  return slot;
}

void register_entry(std::size_t slot, StrategyEntry entry, std::string about) {
  const std::size_t place = native::registry().size() + slot;
  if (place < entries().size())
    entries()[place] = std::move(entry);
  else
    entries().push_back(std::move(entry));
  abouts()[slot] = std::move(about);
}

}  // namespace python

}  // namespace kbvh
