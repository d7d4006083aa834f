#pragma once
#include <gtest/gtest.h>

#include <string>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// The message of the Error that `work` throws, or "nothing was thrown".
template <class Error = io::InputError, class Work>
std::string complaint(const Work& work) {
  try {
    work();
  } catch (const Error& problem) {
    return problem.what();
  }
  return "nothing was thrown";
}

/// Joins the lines into which a table breaks its sentences: those after the first are indented.
inline std::string unwrapped(const std::string& text) {
  std::string joined;
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '\n' && i + 1 < text.size() && text[i + 1] == ' ')
      i = text.find_first_not_of(' ', i + 1) - 1, joined += ' ';
    else
      joined += text[i];
  return joined;
}

inline testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not contain '" << part << "'";
}

}  // namespace kbvh::experiments
