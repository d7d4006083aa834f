#pragma once
#include <optional>

#include "core/judge/audit.hpp"
#include "core/judge/oracle.hpp"
#include "core/judge/penetration.hpp"
#include "core/judge/plan_script.hpp"
#include "core/judge/session.hpp"

namespace kbvh {

/// The quality of a contestant's bounds at one time, summed over the bodies with a visible hierarchy.
struct Quality {
  double t = 0;
  double looseness = 0;  ///< of the bounds that are current
  /// `sah_cost` with the areas of the strategy's own kind of bound; a bound that no query has updated counts
  /// as a tight box.
  double sah = 0;
  double sah_rebuilt = 0;  ///< the same for SAH trees of boxes built at t, with the same width and leaf size
};

/// The result of a verified run of one contestant over a clip. Recorded with every measurement.
struct Verification {
  std::uint64_t frames = 0;             ///< frames compared with the oracle
  std::uint64_t pairs = 0;              ///< true pairs, summed over frames
  std::uint64_t candidates = 0;         ///< pairs before confirmation, summed
  std::uint64_t missed_candidates = 0;  ///< true pairs that were not candidates
  std::uint64_t missed = 0, extra = 0;  ///< confirmed pairs against the oracle
  std::uint64_t wrong_frames = 0;       ///< compared frames with a missed or an extra pair
  /// The number of frames before the first compared frame with a missed pair; nothing if there is none.
  std::optional<std::uint64_t> first_missed;
  Penetration missed_deepest;      ///< the largest of all missed pairs, of depth and of depth in edges
  double missed_depth_sum = 0;     ///< of their depths
  std::uint64_t repeated = 0;      ///< pairs reported more than once in a frame
  std::uint64_t malformed = 0;     ///< ids out of range or not canonical
  Audit audit;                     ///< summed over frames and bodies
  bool audited = false;            ///< false for invisible hierarchies
  std::vector<Quality> over_time;  ///< of a sample of the audited frames
  std::string
      first_violation;  ///< violation of the declared guarantee or tightness: frame, kind, value; or empty

  /// Returns whether the declared guarantee and tightness held in every frame.
  bool holds() const { return first_violation.empty(); }
};

struct VerifyOptions {
  std::uint64_t every_nth_frame =
      1;  ///< only these frames (and the last) are compared and audited; the strategy plays all
  std::uint64_t quality_samples = 0;  ///< maximum number of entries of `over_time`; each costs an SAH build
  Areas areas = Areas::summed;        ///< left out: looseness is not measured
};

/// Names a pair in messages: "(body:primitive, body:primitive)".
std::string text(const PrimitivePair& pair);

/// Runs a contestant over the frames and compares each frame with the oracle: candidates contain the truth;
/// confirmed pairs equal it, each once and canonical; boxes that were read are valid, and tight if declared.
/// `session` must be fresh. The script's times must be frames (std::invalid_argument); where geometry
/// changes, the frame is compared before and after the change. If the oracle was made for another script or
/// for none, the truth is recomputed.
template <class S>
Verification verify(Session<S>& session, std::span<const double> frames, Oracle<S>& oracle,
                    const PlanScript<S>* script = nullptr, const VerifyOptions& options = {});

}  // namespace kbvh
