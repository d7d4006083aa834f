// Damaged files: for any bytes, a reader either returns a mesh or throws InputError, and nothing else. Run
// under address and undefined-behaviour sanitisers, too. Seeded, so that a failure can be repeated.
#include <random>

#include "experiments/io/validate.hpp"
#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_mutation_test {
namespace {

/// Returns the number of rounds; KBVH_MUTATIONS=10 makes ten times as many.
int rounds(int usual) {
  const char* factor = std::getenv("KBVH_MUTATIONS");
  return factor == nullptr ? usual : usual * std::max(1, std::atoi(factor));
}

std::string damaged(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random()) % n; };
  const std::size_t times = 1 + below(3);
  for (std::size_t i = 0; i < times && !bytes.empty(); ++i) {
    // Half of the changes hit the start, where headers and JSON lie.
    const std::size_t at =
        below(2) == 0 ? below(std::min<std::size_t>(bytes.size(), 4096)) : below(bytes.size());
    switch (below(7)) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 2:
        bytes.resize(at);
        break;
      case 3:
        bytes.erase(at, 1 + below(16));
        break;
      case 4:
        bytes.insert(at, bytes.substr(below(bytes.size()), 1 + below(16)));
        break;
      case 5: {  // another digit in place of a digit: the text stays valid, but indices change
        const std::size_t digit = bytes.find_first_of("0123456789", at);
        if (digit != std::string::npos) bytes[digit] = "0123456789-"[below(11)];
        break;
      }
      default:
        for (std::size_t k = at; k < std::min(at + 4, bytes.size()); ++k) bytes[k] = static_cast<char>(0xFF);
        break;
    }
  }
  return bytes;
}

class IoMutation : public IoTest {
 protected:
  /// Loads `bytes` damaged in `tries` ways, saved as `name`, with an optional motion or mesh file that stays
  /// intact.
  void attack(const std::string& name, const std::string& bytes, int tries, const fs::path& mesh = {}) {
    int refused = 0;
    for (int seed = 0; seed < tries; ++seed) {
      SCOPED_TRACE(name + ", seed " + std::to_string(seed));
      std::mt19937 random(static_cast<unsigned>(seed));
      const fs::path file = write(name, damaged(bytes, random));
      try {
        const bool is_gltf = name.find(".gl") != std::string::npos;
        const LoadRequest request{mesh.empty() ? file : mesh, mesh.empty() ? fs::path() : file,
                                  is_gltf ? "0" : "", 0};
        AnimatedMesh result = load_animated_mesh(request);
        ASSERT_GE(result.keyframe_times.size(), 1u);
        finish(result, file);  // every accepted mesh keeps all promises
      } catch (const InputError& error) {
        ++refused;
        const std::string message = error.what();
        ASSERT_EQ(message.find('\n'), std::string::npos) << message;
        ASSERT_LT(message.size(), 600u) << message;
      }
    }
    EXPECT_GT(refused, tries / 20);
  }
};

TEST_F(IoMutation, Obj) {
  attack("m.obj",
         "# cube\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvn 0 0 1\n"
         "f 1 2 3 4\nf -1 -2 -3 -4\nf 1/1/1 2/2/2 6//6\nf 2 3 \\\n 7\n",
         rounds(300));
}

TEST_F(IoMutation, Pc2) {
  std::vector<float> numbers(9 * 20);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<float>(i % 7);
  attack("m.pc2", pc2_of(3, 20, numbers), rounds(300), write("good.obj", triangle_obj));
}

TEST_F(IoMutation, Ply) {
  const std::string head =
      "ply\nformat FORMAT 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "property list uchar short w\nelement face 2\nproperty list uchar int vertex_indices\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
  const auto with_format = [&](const std::string& format) {
    return std::string(head).replace(head.find("FORMAT"), 6, format);
  };
  attack(
      "a.ply",
      with_format("ascii") + "0 0 0 1 7\n1 1 0 0\n2 4 0 0\n3 9 0 2 7 7\n3 0 1 2\n4 0 1 2 3\n5 0 1 2 -1 3\n",
      rounds(300));
  std::string little, big;
  const auto put = [&](auto value) {
    const std::string raw = bytes_of(std::vector<decltype(value)>{value});
    little += raw;
    big.append(raw.rbegin(), raw.rend());
  };
  for (int i = 0; i < 4; ++i) {
    for (int x : {i, i * i, 0}) put(static_cast<float>(x));
    put(std::uint8_t{1});
    put(std::int16_t{7});
  }
  for (const auto& list : {std::vector<std::int32_t>{0, 1, 2}, {0, 1, 2, 3}}) {
    put(static_cast<std::uint8_t>(list.size()));
    for (std::int32_t v : list) put(v);
  }
  for (std::int32_t v : {5, 0, 1, 2, -1, 3}) put(v);
  attack("l.ply", with_format("binary_little_endian") + little, rounds(300));
  attack("b.ply", with_format("binary_big_endian") + big, rounds(300));
}

TEST_F(IoMutation, Gltf) {
  for (const char* interpolation : {"LINEAR", "CUBICSPLINE"}) {
    const BendingStrip strip(interpolation);
    attack("m.gltf", strip.builder.json(strip.body), rounds(300));
    attack("m.glb", strip.builder.glb(strip.body), rounds(300));
  }
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int which = b.add_view(bytes_of<std::uint8_t>({1, 2})),
            what = b.add_view(bytes_of<float>({5, 5, 5, 6, 6, 6}));
  b.add_accessor(
      R"({"componentType":5126,"type":"VEC3","count":3,"sparse":{"count":2,"indices":{"bufferView":)" +
      std::to_string(which) + R"(,"componentType":5121},"values":{"bufferView":)" + std::to_string(what) +
      "}}}");
  b.add<float>("SCALAR", {0, 1});
  b.add<float>("SCALAR", {0, 1});
  attack("s.gltf",
         b.json(R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":5,
"targets":[{"POSITION":1}]}]}],"animations":[{"samplers":[{"input":2,"output":3}],
"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}])"),
         rounds(300));
}

TEST_F(IoMutation, RealGltf) {
  KBVH_NEED_DATA();
  for (const char* name : {"AnimatedMorphSphere.glb", "Fox.glb"}) {
    std::ifstream in(data_folder() / "gltf" / name, std::ios::binary);
    attack(name, std::string{std::istreambuf_iterator<char>(in), {}}, rounds(40));
  }
}

}  // namespace
}  // namespace kbvh::io::test::io_mutation_test
