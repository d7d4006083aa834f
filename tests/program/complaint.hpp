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

inline testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not contain '" << part << "'";
}

}  // namespace kbvh::experiments
