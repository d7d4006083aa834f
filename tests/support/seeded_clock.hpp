#pragma once
#include <cstdint>
#include <limits>
#include <optional>

#include "core/families/events/algebraic_clock.hpp"

// Clocks over curves with faults, which tests of kinetic structures must find.

namespace kbvh::test::seeded_clock {

/// Seeded into the search for failures.
enum class Fault : std::uint8_t {
  none,
  lost_event,   ///< one failure in 40 is not found
  later_roots,  ///< roots after the first of a segment are not seen
  end_points,   ///< the rule of lines: a certificate fails only if the loser is ahead at the segment's end
  half_open,    ///< a failure at the very instant is not seen
};

template <Fault fault>
struct Seeded {
  template <class S>
  class Clock : public AlgebraicClock<S> {
    using Base = AlgebraicClock<S>;

   public:
    using Base::Base;
    bool first_failure(Event& event, const typename Base::Now& now, std::optional<Crossing<S>>& crossing,
                       double until = std::numeric_limits<double>::infinity()) const {
      const bool found = Base::first_failure(event, now, crossing, until);
      if (!found || fault == Fault::none || !this->on_curves(event.body)) return found;
      if (fault == Fault::lost_event) return ++searches_ % 40 != 0;
      if (fault == Fault::later_roots) return event.segment >> 30 == 0;
      if (fault == Fault::end_points)
        return this->compare_values(event.body, event.side, event.loser, event.winner, event.end) > 0;
      return event.hint - event.error > now.end || now.exact == nullptr || event.begin > now.begin ||
             compare_moments(this->crossing(event).moment, now.exact->moment) != 0;
    }

   private:
    mutable std::uint32_t searches_ = 0;
  };
};

}  // namespace kbvh::test::seeded_clock
