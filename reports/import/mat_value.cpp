#include "reports/import/mat_value.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <cstring>
#include <functional>
#include <numeric>
#include <stdexcept>

namespace metastable::reports {
namespace {

// Writes numbers and texts one after the other, each text behind its length.
class Packer {
 public:
  void put(std::uint64_t number) { text_.append(reinterpret_cast<const char*>(&number), sizeof number); }
  void put(const std::string& text) { put(text.size()), text_ += text; }
  void put(const MatValue& value) {
    put(static_cast<std::uint64_t>(value.kind));
    put(value.name), put(value.what), put(value.text);
    put(value.dims.size());
    for (const std::size_t dim : value.dims) put(dim);
    put(value.numbers.size());
    text_.append(reinterpret_cast<const char*>(value.numbers.data()), value.numbers.size() * sizeof(double));
    put(value.fields.size());
    for (const std::string& field : value.fields) put(field);
    put(value.parts.size());
    for (const MatValue& part : value.parts) put(part);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

class Unpacker {
 public:
  explicit Unpacker(std::string_view text) : text_(text) {}
  std::uint64_t number() {
    std::uint64_t number = 0;
    std::memcpy(&number, take(sizeof number).data(), sizeof number);
    return number;
  }
  std::string text() { return std::string(take(number())); }
  MatValue value() {
    MatValue value;
    value.kind = static_cast<MatValue::Kind>(number());
    value.name = text(), value.what = text(), value.text = text();
    value.dims.resize(number());
    for (std::size_t& dim : value.dims) dim = number();
    const std::uint64_t count = number();
    const std::string_view bytes = take(count * sizeof(double));
    value.numbers.resize(count);
    if (count > 0) std::memcpy(value.numbers.data(), bytes.data(), bytes.size());
    value.fields.resize(number());
    for (std::string& field : value.fields) field = text();
    const std::uint64_t parts = number();
    for (std::uint64_t k = 0; k < parts; ++k) value.parts.push_back(this->value());
    return value;
  }

 private:
  std::string_view take(std::size_t size) {
    if (size > text_.size()) throw std::logic_error("MAT values cut short");
    const std::string_view taken = text_.substr(0, size);
    text_.remove_prefix(size);
    return taken;
  }
  std::string_view text_;
};

}  // namespace

std::size_t MatValue::elements() const {
  return std::accumulate(dims.begin(), dims.end(), std::size_t{1}, std::multiplies<>());
}

std::string MatValue::shape() const { return fmt::format("{}", fmt::join(dims, " x ")); }

std::string packed(const std::vector<MatValue>& variables) {
  Packer packer;
  packer.put(variables.size());
  for (const MatValue& variable : variables) packer.put(variable);
  return packer.take();
}

std::vector<MatValue> unpacked(std::string_view text) {
  Unpacker unpacker(text);
  std::vector<MatValue> variables(unpacker.number());
  for (MatValue& variable : variables) variable = unpacker.value();
  return variables;
}

}  // namespace metastable::reports
