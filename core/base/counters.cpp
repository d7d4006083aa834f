#include "core/base/counters.hpp"

#include <stdexcept>
#include <string>

namespace kbvh {

const char* name(Counter counter) {
  switch (counter) {
    case Counter::nodes_visited:
      return "nodes_visited";
    case Counter::values_written:
      return "values_written";
    case Counter::vertex_reads:
      return "vertex_reads";
    case Counter::positions_fetched:
      return "positions_fetched";
    case Counter::certificates_made:
      return "certificates_made";
    case Counter::certificates_failed:
      return "certificates_failed";
    case Counter::certificates_discarded:
      return "certificates_discarded";
    case Counter::internal_events:
      return "internal_events";
    case Counter::overlap_events:
      return "overlap_events";
    case Counter::fathers_apart_events:
      return "fathers_apart_events";
    case Counter::leaves_apart_events:
      return "leaves_apart_events";
    case Counter::bound_change_events:
      return "bound_change_events";
    case Counter::list_peak:
      return "list_peak";
    case Counter::queue_operations:
      return "queue_operations";
    case Counter::queue_steps:
      return "queue_steps";
    case Counter::queue_peak:
      return "queue_peak";
    case Counter::box_tests:
      return "box_tests";
    case Counter::triangle_tests:
      return "triangle_tests";
    case Counter::triangle_tests_exact:
      return "triangle_tests_exact";
    case Counter::span_tests:
      return "span_tests";
    case Counter::span_verdicts:
      return "span_verdicts";
    case Counter::bodies_skipped:
      return "bodies_skipped";
    case Counter::nodes_skipped:
      return "nodes_skipped";
    case Counter::bodies_translated:
      return "bodies_translated";
    case Counter::bodies_remembered:
      return "bodies_remembered";
    case Counter::bytes:
      return "bytes";
    case Counter::count:
      break;
  }
  return "?";
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
