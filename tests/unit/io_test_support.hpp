#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "experiments/io/load.hpp"

namespace kbvh::io::test {

namespace fs = std::filesystem;

/// A separate folder for each test, removed afterwards.
class IoTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "kbvh_io_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& bytes) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    fs::remove(file);  // some file systems flush a file that is truncated and rewritten: far slower
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
  }

  fs::path folder_;
};

/// Loads an input that must be refused; returns the message.
inline std::string error_of(const LoadRequest& request) {
  try {
    load_animated_mesh(request);
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << request.mesh << " was accepted";
  return "";
}

inline std::string error_of(const fs::path& mesh, const fs::path& motion = {}) {
  return error_of(LoadRequest{mesh, motion, "", 0});
}

/// Every word must occur: file, place, value.
inline void expect_words(const std::string& message, const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    EXPECT_NE(message.find(word), std::string::npos) << "'" << word << "' is not in: " << message;
  }
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

/// The shared data folder, empty if absent.
inline fs::path data_folder() {
  const char* given = std::getenv("KBVH_DATA");
#ifdef KBVH_SOURCE_DIR
  const fs::path folder = given != nullptr ? fs::path(given) : fs::path(KBVH_SOURCE_DIR) / "../shared/data";
#else
  const fs::path folder = given != nullptr ? given : "../shared/data";
#endif
  return fs::exists(folder / "sequences") ? folder : fs::path();
}

#define KBVH_NEED_DATA()                                                                \
  if (::kbvh::io::test::data_folder().empty()) {                                        \
    GTEST_SKIP() << "the shared data folder is absent; set KBVH_DATA to run this test"; \
  }

/// Returns the bytes of numbers, in the byte order of this machine (little-endian).
template <class T>
std::string bytes_of(const std::vector<T>& numbers) {
  std::string out(numbers.size() * sizeof(T), '\0');
  if (!numbers.empty()) std::memcpy(out.data(), numbers.data(), out.size());
  return out;
}

inline std::string pc2_of(std::int32_t vertices, std::int32_t samples, const std::vector<float>& numbers,
                          float start = 0, float rate = 1, std::int32_t version = 1) {
  return std::string("POINTCACHE2\0", 12) + bytes_of<std::int32_t>({version, vertices}) +
         bytes_of<float>({start, rate}) + bytes_of<std::int32_t>({samples}) + bytes_of(numbers);
}

inline const char* const triangle_obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

}  // namespace kbvh::io::test
