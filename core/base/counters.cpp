#include "core/base/counters.hpp"

#include <iterator>
#include <stdexcept>
#include <string>

namespace kbvh {

namespace {
struct CounterText {
  const char *name, *meaning;
};
constexpr CounterText texts[] = {
#define KBVH_COUNTER(name, meaning) {#name, meaning},
    KBVH_COUNTERS(KBVH_COUNTER)
#undef KBVH_COUNTER
};
static_assert(std::size(texts) == std::size_t(Counter::count));
}  // namespace

const char* name(Counter counter) {
  return counter < Counter::count ? texts[std::size_t(counter)].name : "?";
}
const char* meaning(Counter counter) {
  return counter < Counter::count ? texts[std::size_t(counter)].meaning : "?";
}

void Counters::NamedList::push_back(const Named& counter) {
  if (size_ == most)
    throw std::length_error("a strategy has more than " + std::to_string(most) + " counters of its own");
  counters_[size_++] = counter;
}

void Counters::add(std::string_view own_name, std::uint64_t n) {
  for (Named& counter : named)
    if (counter.name == own_name) {
      counter.value += n;
      return;
    }
  for (std::size_t c = 0; c < values.size(); ++c)
    if (own_name == name(Counter(c)))
      throw std::logic_error("a strategy's own counter has the name '" + std::string(own_name) +
                             "' of a shared counter");
  named.push_back({own_name, n});
}

}  // namespace kbvh
