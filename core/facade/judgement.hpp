#pragma once
// Internal to the façade.
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

#include "core/facade/world.hpp"
#include "core/judge/verify.hpp"

namespace kbvh::facade {

inline WorldAudit plain(const Audit& audit) {
  return {audit.nodes,
          audit.stale,
          audit.invalid,
          audit.not_tight,
          audit.protrusion,
          audit.looseness(),
          audit.topology_error.empty() ? audit.first_fault : audit.topology_error};
}
inline WorldVerdict plain(const Verification& verification) {
  return {verification.holds(),   verification.first_violation, verification.frames,
          verification.pairs,     verification.candidates,      verification.missed_candidates,
          verification.missed,    verification.extra,           verification.repeated,
          verification.malformed, verification.audited,         plain(verification.audit)};
}

/// Throws std::invalid_argument unless the times are finite and do not decrease, and there is one.
inline void check_frames(std::span<const double> frames) {
  if (frames.empty()) throw std::invalid_argument("there is no frame to verify");
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (!std::isfinite(frames[i]) || (i > 0 && frames[i] < frames[i - 1]))
      throw std::invalid_argument("frame " + std::to_string(i) +
                                  " cannot be at t = " + number_text(frames[i]));
}

}  // namespace kbvh::facade
