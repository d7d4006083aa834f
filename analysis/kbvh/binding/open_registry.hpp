#pragma once
#include <cstddef>
#include <string>

#include "core/contract/registry.hpp"

namespace kbvh::python {

/// The number of strategies that one process may register.
inline constexpr std::size_t most_registered = 64;

/// Returns the slot for a strategy: that of the registered one with this id, else the next free one. Throws
/// std::logic_error if every slot is taken, and ConfigError if a native strategy has the id.
std::size_t slot_for(const std::string& id);

/// Adds a strategy to `registry()`, or replaces the one in its slot. Entries keep their addresses.
void register_entry(std::size_t slot, StrategyEntry entry, std::string about);

/// Returns the slot of a registered strategy; `most_registered` for all others.
std::size_t slot_of(const std::string& id);

}  // namespace kbvh::python
