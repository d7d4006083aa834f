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

void Counters::add(std::string_view own, std::uint64_t n) {
  for (Named& counter : named)
    if (counter.name == own) {
      counter.value += n;
      return;
    }
  for (std::size_t c = 0; c < values.size(); ++c)
    if (own == name(Counter(c)))
      throw std::logic_error("a strategy's own counter has the name '" + std::string(own) +
                             "' of a shared counter");
  named.push_back({own, n});
}

}  // namespace kbvh
