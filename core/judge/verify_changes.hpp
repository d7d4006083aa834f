#pragma once
#include "core/judge/oracle.hpp"
#include "core/judge/plan_script.hpp"
#include "core/judge/session.hpp"

namespace kbvh {

/// Adds up answers as changes.
class ChangeReplay {
 public:
  /// Adds an answer. Returns the first fault, else an empty text. Faults: a pair that begins twice or while
  /// it lasts, and a pair that ends without having begun.
  std::string add(PairBuffer begun, PairBuffer ended);
  /// Returns the pairs that last, sorted.
  const PairBuffer& pairs() const { return pairs_; }
  void clear() { pairs_.clear(); }

 private:
  PairBuffer pairs_, kept_;
};

/// The result of a clip whose answers were requested as changes.
struct ChangesVerification {
  std::uint64_t begun = 0, ended = 0;  ///< changes of pairs, summed over all answers after the first
  std::string first_violation;         ///< or empty
};

struct VerifyChangesOptions {
  /// At these frames and the last one the added changes are compared with the oracle, and with the full
  /// answers of the strategy.
  std::uint64_t every_nth_frame = 1;
  /// Whether to skip some frames, different ones for candidates and for pairs, and to request full answers in
  /// between, sometimes before and sometimes after the changes.
  enum class Calls : std::uint8_t { every_frame, mixed } calls = Calls::mixed;
};

/// Plays the frames and adds up the contestant's changes, of candidates and of pairs. The sums must equal its
/// full answers. Added pairs must equal the oracle's, and added candidates must contain them, unless the
/// contestant is approximate. Starts with a reset. Uses script and oracle as `verify` does.
template <class S>
ChangesVerification verify_changes(Session<S>& session, std::span<const double> frames, Oracle<S>& oracle,
                                   const PlanScript<S>* script = nullptr,
                                   const VerifyChangesOptions& options = {});

}  // namespace kbvh
