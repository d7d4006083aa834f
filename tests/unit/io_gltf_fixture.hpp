#pragma once
#include <string>
#include <vector>

#include "io_test_support.hpp"

namespace kbvh::io::test {

inline std::string base64_of(const std::string& bytes) {
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      word = word << 8 | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0u);
    }
    for (std::size_t j = 0; j < 4; ++j)
      out += i + j <= bytes.size() ? alphabet[word >> (18 - 6 * j) & 63] : '=';
  }
  return out;
}

/// A glTF file composed by hand: each accessor gets its own buffer view.
class GltfBuilder {
 public:
  template <class T>
  int add(const std::string& type, const std::vector<T>& numbers, const std::string& extra = "") {
    const int code = std::is_same_v<T, float>           ? 5126
                     : std::is_same_v<T, std::int8_t>   ? 5120
                     : std::is_same_v<T, std::uint8_t>  ? 5121
                     : std::is_same_v<T, std::int16_t>  ? 5122
                     : std::is_same_v<T, std::uint16_t> ? 5123
                                                        : 5125;
    const std::size_t components = type == "SCALAR" ? 1
                                   : type == "MAT4" ? 16
                                                    : static_cast<std::size_t>(type[3] - '0');
    const int view = add_view(bytes_of(numbers));
    return add_accessor("{\"bufferView\":" + std::to_string(view) +
                        ",\"componentType\":" + std::to_string(code) + ",\"type\":\"" + type +
                        "\",\"count\":" + std::to_string(numbers.size() / components) + extra + "}");
  }

  int add_view(const std::string& bytes, const std::string& extra = "") {
    while (buffer_.size() % 4 != 0) buffer_ += '\0';
    views_ += (views_.empty() ? "" : ",") + std::string("{\"buffer\":0,\"byteOffset\":") +
              std::to_string(buffer_.size()) + ",\"byteLength\":" + std::to_string(bytes.size()) + extra +
              "}";
    buffer_ += bytes;
    return view_count_++;
  }

  int add_accessor(const std::string& json) {
    accessors_ += (accessors_.empty() ? "" : ",") + json;
    return accessor_count_++;
  }

  /// `body`: the members in addition to asset, buffers, bufferViews and accessors. `uri`: empty for a binary
  /// chunk.
  std::string json(const std::string& body, const std::string& uri) const {
    return "{\"asset\":{\"version\":\"2.0\"}," + body +
           ",\"buffers\":[{\"byteLength\":" + std::to_string(buffer_.size()) +
           (uri.empty() ? "" : ",\"uri\":\"" + uri + "\"") + "}],\"bufferViews\":[" + views_ +
           "],\"accessors\":[" + accessors_ + "]}";
  }

  std::string json(const std::string& body) const {
    return json(body, "data:application/octet-stream;base64," + base64_of(buffer_));
  }

  static std::string glb(std::string json, const std::string& binary) {
    while (json.size() % 4 != 0) json += ' ';
    const auto u32 = [](std::size_t n) { return bytes_of<std::uint32_t>({static_cast<std::uint32_t>(n)}); };
    return "glTF" + u32(2) + u32(28 + json.size() + binary.size()) + u32(json.size()) + "JSON" + json +
           u32(binary.size()) + std::string("BIN\0", 4) + binary;
  }

  std::string glb(const std::string& body) const { return glb(json(body, ""), buffer_); }

  const std::string& buffer() const { return buffer_; }

 private:
  std::string buffer_, views_, accessors_;
  int view_count_ = 0, accessor_count_ = 0;
};

/// Two triangles with a seam (6 vertices, 4 after welding), on two joints. The upper joint, at (0, 1, 0),
/// turns by 90 degrees about z between 0.5 s and 1.5 s, while the lower one moves along x in three keys (0.5,
/// 1, 1.5 s).
struct BendingStrip {
  GltfBuilder builder;
  std::string body;

  explicit BendingStrip(const std::string& interpolation = "LINEAR") {
    const float h = 0.70710678f;
    builder.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 2, 0, 1, 0, 0, 1, 2, 0, 0, 2, 0});  // 0 POSITION
    builder.add<std::uint8_t>("VEC4",
                              {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});  // 1
    builder.add<float>("VEC4",
                       {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});  // 2
    builder.add<std::uint16_t>("SCALAR", {0, 1, 2, 3, 4, 5});  // 3 indices
    builder.add<float>("MAT4", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1});  // 4 inverse binds
    builder.add<float>("SCALAR", {0.5f, 1.5f});                                     // 5 times
    if (interpolation == "CUBICSPLINE") {
      builder.add<float>("VEC4",
                         {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, h, h, 0, 0, 0, 0});  // 6
    } else {
      builder.add<float>("VEC4", {0, 0, 0, 1, 0, 0, h, h});  // 6
    }
    builder.add<float>("SCALAR", {0.5f, 1.0f, 1.5f});          // 7
    builder.add<float>("VEC3", {0, 0, 0, 0, 0, 0, 10, 0, 0});  // 8
    body = R"("scene":0,"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0,"skin":0,"translation":[99,0,0]},{"children":[2]},{"translation":[0,1,0]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2},"indices":3}]}],
"skins":[{"joints":[1,2],"inverseBindMatrices":4}],
"animations":[{"name":"bend","samplers":[{"input":5,"output":6,"interpolation":")" +
           interpolation + R"("},{"input":7,"output":8}],
"channels":[{"sampler":0,"target":{"node":2,"path":"rotation"}},{"sampler":1,"target":{"node":1,"path":"translation"}}]}])";
  }
};

}  // namespace kbvh::io::test
