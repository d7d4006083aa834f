#include <algorithm>
#include <cmath>
#include <limits>

#include "experiments/io/bytes.hpp"
#include "experiments/io/gltf_document.hpp"

namespace kbvh::io::gltf {
namespace {

/// Accessors without a buffer view cost no bytes in the file; the limit on their zeros is 2^24 elements.
constexpr std::uint64_t most_zeros = std::uint64_t{1} << 24;

std::size_t bytes_of(Component component) {
  switch (component) {
    case Component::int8:
    case Component::uint8:
      return 1;
    case Component::int16:
    case Component::uint16:
      return 2;
    default:
      return 4;
  }
}

double decode(const char* at, Component component, bool normalized) {
  switch (component) {
    case Component::int8: {
      const auto value = load_little_endian<std::int8_t>(at);
      return normalized ? std::max(value / 127.0, -1.0) : value;
    }
    case Component::uint8: {
      const auto value = load_little_endian<std::uint8_t>(at);
      return normalized ? value / 255.0 : value;
    }
    case Component::int16: {
      const auto value = load_little_endian<std::int16_t>(at);
      return normalized ? std::max(value / 32767.0, -1.0) : value;
    }
    case Component::uint16: {
      const auto value = load_little_endian<std::uint16_t>(at);
      return normalized ? value / 65535.0 : value;
    }
    case Component::uint32:
      return load_little_endian<std::uint32_t>(at);
    case Component::float32:
      break;
  }
  return load_little_endian<float>(at);
}

/// Returns the first byte of `count` elements of `size` bytes in a view, after checking that all of them lie
/// inside it.
const char* checked_range(const Document& document, const std::string& place, std::uint32_t view_id,
                          std::uint64_t offset, std::uint64_t count, std::uint64_t size,
                          std::uint64_t stride) {
  const BufferView& view = document.views[view_id];
  if (stride < size) {
    fail(document.file, place,
         "elements of " + std::to_string(size) + " bytes in bufferViews[" + std::to_string(view_id) +
             "] whose byteStride is " + std::to_string(stride));
  }
  // Cannot overflow in this form: (count - 1) * stride + size <= length - offset.
  const bool fits = count == 0 || (offset <= view.length && size <= view.length - offset &&
                                   count - 1 <= (view.length - offset - size) / stride);
  if (!fits) {
    fail(document.file, place,
         std::to_string(count) + " elements of " + std::to_string(size) + " bytes from byte " +
             std::to_string(offset) + " leave bufferViews[" + std::to_string(view_id) + "], which has " +
             std::to_string(view.length) + " bytes");
  }
  return count == 0 ? nullptr : document.buffers[view.buffer].data() + view.offset + offset;
}

/// Calls use(element, component, number) for every number of the accessor, sparse replacements last.
template <class Use>
void for_each_number(const Document& document, std::uint32_t id, std::uint32_t components, Use use) {
  const Accessor& accessor = document.accessors[id];
  const std::string place = "accessors[" + std::to_string(id) + "]";
  if (accessor.components != components) {
    fail(document.file, place,
         "has " + std::to_string(accessor.components) + " components per element where " +
             std::to_string(components) + " are needed");
  }
  const std::size_t each = bytes_of(accessor.component), size = each * components;
  const auto visit = [&](std::uint64_t element, const char* at) {
    for (std::uint32_t c = 0; c < components; ++c) {
      use(element, c, decode(at + c * each, accessor.component, accessor.normalized));
    }
  };
  if (accessor.view) {
    const std::uint64_t given = document.views[*accessor.view].stride, stride = given == 0 ? size : given;
    const char* at =
        checked_range(document, place, *accessor.view, accessor.offset, accessor.count, size, stride);
    for (std::uint64_t i = 0; i < accessor.count; ++i) visit(i, at + i * stride);
  }
  if (!accessor.sparse) return;
  const Sparse& sparse = *accessor.sparse;
  const std::size_t index_size = bytes_of(sparse.index_type);
  const char* index_at = checked_range(document, place + ".sparse.indices", sparse.index_view,
                                       sparse.index_offset, sparse.count, index_size, index_size);
  const char* value_at = checked_range(document, place + ".sparse.values", sparse.value_view,
                                       sparse.value_offset, sparse.count, size, size);
  for (std::uint64_t i = 0; i < sparse.count; ++i) {
    const auto element =
        static_cast<std::uint64_t>(decode(index_at + i * index_size, sparse.index_type, false));
    if (element >= accessor.count) {
      fail(document.file, place + ".sparse.indices, element " + std::to_string(i),
           "index " + std::to_string(element) + " is out of range (" + std::to_string(accessor.count) +
               " elements)");
    }
    visit(element, value_at + i * size);
  }
}

std::size_t checked_size(const Document& document, std::uint32_t id) {
  const Accessor& accessor = document.accessors[id];
  // With a view, its range bounds the count; the check must precede any allocation.
  const std::uint64_t most = accessor.view ? document.views[*accessor.view].length : most_zeros;
  if (accessor.count > most) {
    fail(document.file, "accessors[" + std::to_string(id) + "]",
         std::to_string(accessor.count) + " elements " +
             (accessor.view
                  ? "leave bufferViews[" + std::to_string(*accessor.view) + "], which has " +
                        std::to_string(most) + " bytes"
                  : "without a bufferView, where at most " + std::to_string(most) + " are accepted"));
  }
  return static_cast<std::size_t>(accessor.count) * accessor.components;
}

}  // namespace

std::string place_in(std::uint32_t accessor, std::uint64_t element) {
  return "accessors[" + std::to_string(accessor) + "], element " + std::to_string(element);
}

std::vector<double> read_numbers(const Document& document, std::uint32_t accessor, std::uint32_t components) {
  std::vector<double> numbers(checked_size(document, accessor));
  for_each_number(document, accessor, components, [&](std::uint64_t element, std::uint32_t c, double value) {
    if (!std::isfinite(value)) {
      fail(document.file, place_in(accessor, element),
           "component " + std::to_string(c) + " is " + text_of(value));
    }
    numbers[element * components + c] = value;
  });
  return numbers;
}

std::vector<std::uint32_t> read_unsigned(const Document& document, std::uint32_t accessor,
                                         std::uint32_t components) {
  const Component type = document.accessors[accessor].component;
  if (type != Component::uint8 && type != Component::uint16 && type != Component::uint32) {
    fail(document.file, "accessors[" + std::to_string(accessor) + "].componentType",
         std::to_string(static_cast<int>(type)) + " is not a type of unsigned integers");
  }
  std::vector<std::uint32_t> numbers(checked_size(document, accessor));
  for_each_number(document, accessor, components, [&](std::uint64_t element, std::uint32_t c, double value) {
    numbers[element * components + c] = static_cast<std::uint32_t>(value);
  });
  return numbers;
}

}  // namespace kbvh::io::gltf
