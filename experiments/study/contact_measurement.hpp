#pragma once
#include <nlohmann/json.hpp>
#include <vector>

#include "core/continuous/contacts.hpp"
#include "experiments/study/measure.hpp"

namespace kbvh::experiments {

/// Returns the times between which contacts are found where plans change: the frames, and in between every
/// keyframe of a body and every possible knot of a changed plan.
template <class S>
std::vector<double> contact_times(const Scene<S>& scene, std::vector<double> frames,
                                  const PlanScript<S>& script);

/// A contestant, with its record's data about impacts.
template <class S>
struct ContactEntrant : Entrant<S> {
  ImpactStats impacts;
};

/// Like Measurement, for the contacts of features while vertices move from one time of `knots` to the next.
template <class S>
class ContactMeasurement : public Entrants<ContactEntrant<S>> {
 public:
  /// Finds the true contacts by sort-and-sweep. The script may only change plans, at some of the knots; null:
  /// no script. Throws io::InputError unless all bodies in pairs consist of triangles.
  ContactMeasurement(const Scene<S>& scene, std::vector<double> knots, const PlanScript<S>* script);

  /// Replays a contestant, comparing every n-th interval and the last with the truth.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);
  void play(std::size_t i);
  nlohmann::json extras(std::size_t i) const;

 private:
  const Scene<S>* scene_;
  std::vector<double> knots_;
  const PlanScript<S>* script_;
  std::vector<ContactBuffer> truth_;  ///< [interval], sorted
  ContactBuffer contacts_;
  std::optional<std::size_t> steady_from_;
};

extern template class ContactMeasurement<float>;
extern template class ContactMeasurement<double>;

}  // namespace kbvh::experiments
