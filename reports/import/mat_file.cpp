#include "reports/import/mat_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#ifdef METASTABLE_MATIO
#include <matio.h>

#include <memory>

#include "reports/import/child_process.h"
#include "reports/import/hdf5_file.h"
#include "reports/import/mat_whole.h"
#endif

namespace metastable::reports {
namespace {

constexpr std::string_view hdf5_begin = "\x89HDF\r\n\x1a\n";

// Version 4 begins with five numbers: MOPT (M the byte order, P the precision, T what it is), rows, columns, whether
// there is an imaginary part, the length of the name, which follows ("MAT-File Format", The MathWorks, ch. 2).
bool is_version_4(std::string_view text) {
  constexpr std::size_t header = 20;
  if (text.size() < header) return false;
  for (const bool big_endian : {false, true}) {
    std::uint32_t word[5];
    for (std::size_t k = 0; k < 5; ++k) {
      word[k] = 0;
      for (std::size_t i = 0; i < 4; ++i)
        word[k] |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[4 * k + i]))
                   << 8 * (big_endian ? 3 - i : i);
    }
    const std::uint32_t order = word[0] / 1000, zero = word[0] / 100 % 10, precision = word[0] / 10 % 10,
                        kind = word[0] % 10, length = word[4];
    if (order != (big_endian ? 1 : 0) || zero != 0 || precision > 5 || kind > 2 || word[3] > 1 || length < 2 ||
        length > 256 || header + length > text.size() || text[header + length - 1] != '\0')
      continue;
    if (std::ranges::all_of(text.substr(header, length - 1),
                            [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }))
      return true;
  }
  return false;
}

}  // namespace

bool is_hdf5_file(std::string_view text) {
  return text.starts_with("MATLAB 7.3 MAT-file") || text.starts_with(hdf5_begin) ||
         (text.size() > 512 && text.substr(512).starts_with(hdf5_begin));
}

bool is_mat_file(std::string_view text) {
  return text.starts_with("MATLAB 5.0 MAT-file") || is_hdf5_file(text) || is_version_4(text);
}

#ifndef METASTABLE_MATIO

std::string mat_library() { return ""; }

std::vector<MatValue> mat_variables(const std::string& file, std::string_view) {
  throw std::invalid_argument(fmt::format(
      "{}: this metastable was built without libmatio, which reads MAT files: install libmatio-dev and build again "
      "(./run install), or save a CSV (writetable, writematrix)",
      file));
}

#else

std::string mat_library() {
  int major = 0, minor = 0, release = 0;
  Mat_GetLibraryVersion(&major, &minor, &release);
  return fmt::format("libmatio {}.{}.{}", major, minor, release);
}

namespace {

struct MatClose {
  void operator()(mat_t* file) const { Mat_Close(file); }
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

constexpr std::size_t deepest_struct = 64;  // of structs in structs
constexpr const char* nothing_there =
    "nothing that libmatio reads: it is empty, or compressed in its own way (save('-v6', ...) does without)";

template <typename T>
std::vector<double> as_doubles(const matvar_t& v, std::size_t count) {
  const T* const data = static_cast<const T*>(v.data);
  if (data == nullptr || v.nbytes < count * sizeof(T)) return {};
  return {data, data + count};
}

// Fills in numbers in the order of MATLAB's linear index; false where they are none.
bool read_numbers(const matvar_t& v, MatValue& value) {
  if (v.isComplex) return false;
  const std::size_t count = value.elements();
  switch (v.class_type) {
    case MAT_C_EMPTY:
      break;
    case MAT_C_DOUBLE:
      value.numbers = as_doubles<double>(v, count);
      break;
    case MAT_C_SINGLE:
      value.numbers = as_doubles<float>(v, count);
      break;
    case MAT_C_INT8:
      value.numbers = as_doubles<std::int8_t>(v, count);
      break;
    case MAT_C_UINT8:
      value.numbers = as_doubles<std::uint8_t>(v, count);
      break;
    case MAT_C_INT16:
      value.numbers = as_doubles<std::int16_t>(v, count);
      break;
    case MAT_C_UINT16:
      value.numbers = as_doubles<std::uint16_t>(v, count);
      break;
    case MAT_C_INT32:
      value.numbers = as_doubles<std::int32_t>(v, count);
      break;
    case MAT_C_UINT32:
      value.numbers = as_doubles<std::uint32_t>(v, count);
      break;
    case MAT_C_INT64:
      value.numbers = as_doubles<std::int64_t>(v, count);
      break;
    case MAT_C_UINT64:
      value.numbers = as_doubles<std::uint64_t>(v, count);
      break;
    default:
      return false;
  }
  value.kind = MatValue::Kind::numbers;
  return true;
}

std::string kind(const matvar_t& v) {
  switch (v.class_type) {
    case MAT_C_CHAR:
      return "a text of several rows";
    case MAT_C_SPARSE:
      return "a sparse matrix: save full(...) of it";
    case MAT_C_OBJECT:
    case MAT_C_OPAQUE:
      return object_remedy;
    case MAT_C_FUNCTION:
      return "a function";
    default:
      return v.isComplex ? "complex" : "of an unknown kind";
  }
}

MatValue value_of(matvar_t* v, std::size_t depth) {
  MatValue value;
  if (v == nullptr) {
    value.what = nothing_there;
    return value;
  }
  if (depth > deepest_struct) throw std::invalid_argument("structs lie in structs without end");
  value.dims.assign(v->dims, v->dims + (v->dims == nullptr ? 0 : v->rank));
  if (value.dims.empty()) value.dims = {0, 0};
  const std::size_t count = value.elements();
  if (v->class_type == MAT_C_CHAR && value.dims.size() == 2 && value.dims[0] <= 1) {
    value.kind = MatValue::Kind::text;
    for (std::size_t i = 0;
         v->data != nullptr && i < count && (i + 1) * static_cast<std::size_t>(v->data_size) <= v->nbytes; ++i)
      value.text += v->data_size == 2 ? static_cast<char>(static_cast<const std::uint16_t*>(v->data)[i])
                                      : static_cast<const char*>(v->data)[i];
  } else if (v->class_type == MAT_C_CELL) {
    value.kind = MatValue::Kind::cells;
    for (std::size_t i = 0; i < count; ++i)
      value.parts.push_back(value_of(Mat_VarGetCell(v, static_cast<int>(i)), depth + 1));
  } else if (v->class_type == MAT_C_STRUCT) {
    value.kind = MatValue::Kind::structure;
    char* const* const fields = Mat_VarGetStructFieldnames(v);
    for (unsigned f = 0; fields != nullptr && f < Mat_VarGetNumberOfFields(v); ++f)
      value.fields.emplace_back(fields[f]);
    for (std::size_t e = 0; e < count; ++e)
      for (std::size_t f = 0; f < value.fields.size(); ++f)
        value.parts.push_back(value_of(Mat_VarGetStructFieldByIndex(v, f, e), depth + 1));
  } else if (!read_numbers(*v, value)) {
    value.what = kind(*v);
  }
  return value;
}

std::vector<MatValue> matio_variables(const std::string& path) {
  const std::unique_ptr<mat_t, MatClose> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) throw std::invalid_argument(fmt::format("{}: cannot be read as a MAT file", path));
  std::vector<MatValue> variables;
  while (matvar_t* const read = Mat_VarReadNext(file.get())) {
    const std::unique_ptr<matvar_t, MatClose> variable(read);
    if (variable->name == nullptr) continue;
    variables.push_back(value_of(read, 0));
    variables.back().name = variable->name;
  }
  return variables;
}

}  // namespace

std::vector<MatValue> mat_variables(const std::string& file, std::string_view text) {
  const bool hdf5 = is_hdf5_file(text);
  if (!hdf5) check_mat_whole(file, text);
  return unpacked(in_child_process(
      [&] { return packed(hdf5 ? hdf5_variables(file) : matio_variables(file)); },
      fmt::format("{}: {} cannot read this file and ended; save it anew with MATLAB (save -v6) or SciPy "
                  "(scipy.io.savemat), or as a CSV",
                  file, hdf5 ? "the HDF5 library" : "libmatio")));
}

#endif

}  // namespace metastable::reports
