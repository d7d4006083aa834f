#include "experiments/study/question.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Reads which answer's changes are requested; "none" overrides the level above.
std::optional<Answer> read_answer(const JsonReader& keys, const std::string& text) {
  if (text == "none") return {};
  for (const Answer answer : {Answer::candidates, Answer::pairs})
    if (text == answer_word(answer)) return answer;
  keys.fail("changes", "expected candidates, pairs or none, got '" + text + "'");
}

/// Reads the text of a key by `parse`, whose std::invalid_argument names the wrong part.
template <class T, class Parse>
bool read_text(JsonReader& keys, const char* key, std::optional<T>& value, const Parse& parse) {
  const auto text = keys.word(key);
  if (!text) return false;
  try {
    value = parse(*text);
  } catch (const std::invalid_argument& problem) {
    keys.fail(key, problem.what());
  }
  return true;
}

}  // namespace

void read_question(JsonReader& keys, Question& question) {
  if (const auto continuous = keys.truth("continuous")) question.continuous = *continuous;
  if (const auto answer = keys.word("changes")) question.changes = read_answer(keys, *answer);
  if (question.changes && question.continuous) keys.fail("changes", "contacts between keyframes have none");
  const bool rays = read_text(keys, "rays", question.probes, ray_study);
  const bool within = read_text(keys, "within", question.probes, within_study);
  if (rays && within) keys.fail("within", "a study asks for one of rays and points");
  read_text(keys, "kernels", question.kernels, [](const std::string& text) { return kernel_set(text); });
  if (question.probes && (question.continuous || question.changes))
    keys.fail(key_of(*question.probes),
              std::string("a study asks for one of ") + key_of(*question.probes) + ", contacts and changes");
}

const char* answer_word(Answer answer) {
  return answer == Answer::candidates ? "candidates" : "pairs";
}

json asked_of(const Question& question) {
  json asked = json::object();
  if (question.continuous) asked["continuous"] = true;
  if (question.changes) asked["changes"] = answer_word(*question.changes);
  if (question.probes) asked[key_of(*question.probes)] = text_of(*question.probes);
  if (question.kernels) asked["kernels"] = name(*question.kernels);
  return asked;
}

std::string job_words(const Question& question) {
  return (question.changes  ? "-changes"
          : question.probes ? std::string("-") + key_of(*question.probes)
                            : "") +
         (question.kernels ? "-" + std::string(name(*question.kernels)) : "");
}

std::string target_suffix(const Question& question) {
  return (question.probes ? suffix_of(*question.probes) : "") +
         (question.kernels ? " (" + std::string(name(*question.kernels)) + " kernels)" : "");
}

std::string suffix_of(const Question& question) {
  return name_with_changes(target_suffix(question), question.changes ? answer_word(*question.changes) : "") +
         (question.continuous ? " (contacts)" : "");
}

std::string name_with_changes(const std::string& scene, const std::string& changes) {
  return changes.empty() ? scene : scene + " (changes of " + changes + ")";
}

}  // namespace kbvh::experiments
