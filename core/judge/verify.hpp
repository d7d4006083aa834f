#pragma once
#include "core/judge/audit.hpp"
#include "core/judge/oracle.hpp"
#include "core/judge/plan_script.hpp"
#include "core/judge/session.hpp"

namespace kbvh {

/// A contestant's bounds at one time, summed over the bodies whose hierarchy can be seen.
struct Quality {
  double t = 0;
  double looseness = 0;  ///< of the bounds that are up to date
  /// `sah_cost` with the areas of its own kind of bound; a bound that no query has brought up to date counts
  /// as a tight box.
  double sah = 0;
  double sah_rebuilt = 0;  ///< the same of SAH trees of boxes built at t, of the same width and leaf size
};

/// What a verified run of one contestant over a clip showed. Recorded with every measurement.
struct Verification {
  std::uint64_t frames = 0;             ///< frames compared with the oracle
  std::uint64_t pairs = 0;              ///< true pairs, summed over frames
  std::uint64_t candidates = 0;         ///< pairs before confirmation, summed
  std::uint64_t missed_candidates = 0;  ///< true pairs that were not even candidates
  std::uint64_t missed = 0, extra = 0;  ///< confirmed pairs against the oracle
  std::uint64_t repeated = 0;           ///< pairs reported more than once in a frame
  std::uint64_t malformed = 0;          ///< ids out of range or not canonical
  Audit audit;                          ///< summed over frames and bodies
  bool audited = false;                 ///< false for hierarchies that cannot be seen
  std::vector<Quality> over_time;       ///< of a sample of the audited frames
  std::string first_violation;  ///< of the declared guarantee or tightness: frame, what, value; or empty

  /// The declared guarantee and tightness held in every frame.
  bool holds() const { return first_violation.empty(); }
};

struct VerifyOptions {
  std::uint64_t every_nth_frame = 1;  ///< compare and audit only these (and the last); the strategy sees all
  std::uint64_t quality_samples = 0;  ///< most entries of `over_time`; each costs a build with SAH
};

/// Runs a contestant over the frames and compares each with the oracle: candidates contain the truth,
/// confirmed pairs equal it, each pair once and canonical, boxes that were read are valid, and tight where
/// that is declared. `session` must be fresh. The script's times must be frames (std::invalid_argument);
/// where geometry changes, the frame is compared before and after. Truth is computed afresh if the oracle was
/// made for another script, or for none.
template <class S>
Verification verify(Session<S>& session, std::span<const double> frames, Oracle<S>& oracle,
                    const PlanScript<S>* script = nullptr, const VerifyOptions& options = {});

}  // namespace kbvh
