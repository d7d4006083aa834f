#pragma once
#include <string_view>

namespace kbvh {

/// Returns what a strategy is and when it wins: the comment at the top of its source file. Lines are
/// paragraphs or items of a list ("- "); an empty line ends a paragraph. Empty for an unknown id. Defined by
/// the manifest, like `registry`.
std::string_view about(std::string_view id);

}  // namespace kbvh
