#pragma once
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/contract/queries.hpp"
#include "core/kernels/kernel_set.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/study/probe_sets.hpp"

namespace kbvh::experiments {

/// What a study asks every contestant, at every frame of every scene: pairs, unless one of the members says
/// something else. Plans, keys of results, commands and ids of jobs pass it on as a value; only the
/// measurement looks inside.
struct Question {
  bool continuous = false;           ///< contacts between keyframes instead of pairs at frames
  std::optional<Answer> changes;     ///< the changes of this answer instead of pairs at frames
  std::optional<ProbeStudy> probes;  ///< rays or points at frames instead of pairs
  std::optional<KernelSet> kernels;  ///< holds everything that kbvh computes to this instruction set

  /// Returns whether the truth is that of pairs at frames.
  bool of_pairs() const { return !continuous && !probes; }
};

/// Reads the keys of a plan that belong to a question over its current content. Throws io::InputError.
void read_question(JsonReader& keys, Question& question);

/// Returns the question as keys of a plan, as far as it differs from pairs at frames with the widest kernels.
/// In this form it is part of keys of results, of `again`, and of ids of jobs.
nlohmann::json asked_of(const Question& question);
/// Returns a word for what is asked, and for the kernels: parts of a job's id. Both begin with a hyphen or
/// are empty.
std::string job_words(const Question& question);
/// Returns the suffix that tables add to a scene's name: " (coherent rays)", " (sse kernels)", " (changes of
/// pairs)", " (contacts)".
std::string suffix_of(const Question& question);
/// Returns the part of it that targets name with a scene: without changes, which they name apart.
std::string target_suffix(const Question& question);

/// Names an answer in plans and results.
const char* answer_word(Answer answer);
/// Returns the name of a scene in the tables of a study with `changes`.
std::string name_with_changes(const std::string& scene, const std::string& changes);

}  // namespace kbvh::experiments
