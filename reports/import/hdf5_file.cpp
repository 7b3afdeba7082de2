#include "reports/import/hdf5_file.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <utility>

namespace metastable::reports {
namespace {

constexpr std::size_t deepest_group = 32;     // of structs in structs
constexpr std::size_t most_parts = 10000000;  // of cells and fields
constexpr hsize_t most_elements = hsize_t{1} << 28;

// Closes what the library opened.
class Handle {
 public:
  explicit Handle(hid_t id) : id_(id) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() {
    if (id_ < 0) return;
    switch (H5Iget_type(id_)) {
      case H5I_FILE:
        H5Fclose(id_);
        break;
      case H5I_ATTR:
        H5Aclose(id_);
        break;
      case H5I_DATASPACE:
        H5Sclose(id_);
        break;
      case H5I_DATATYPE:
        H5Tclose(id_);
        break;
      default:
        H5Oclose(id_);
    }
  }
  operator hid_t() const { return id_; }  // NOLINT: it stands for the number

 private:
  hid_t id_;
};

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT)) {
    if (file_ < 0)
      throw std::invalid_argument(fmt::format(
          "{}: cannot be read as a MAT file of version 7.3: the HDF5 library finds it cut short or damaged", path));
  }

  std::vector<MatValue> variables() {
    std::vector<MatValue> all;
    for (const std::string& name : links(file_)) {
      if (name.starts_with('#')) continue;  // what others refer to
      all.push_back(object(Handle(H5Oopen(file_, name.c_str(), H5P_DEFAULT)), name, 0));
      all.back().name = name;
    }
    return all;
  }

 private:
  [[noreturn]] void refuse(const std::string& place, const char* what) const {
    throw std::invalid_argument(fmt::format("{}: {}: {}", path_, place, what));
  }

  static std::vector<std::string> links(hid_t group) {
    std::vector<std::string> names;
    hsize_t at = 0;
    H5Literate(
        group, H5_INDEX_NAME, H5_ITER_INC, &at,
        [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
          static_cast<std::vector<std::string>*>(list)->emplace_back(name);
          return 0;
        },
        &names);
    return names;
  }

  // Returns a short text that an attribute holds, "" where it is not there.
  static std::string attribute(hid_t object, const char* name) {
    if (H5Aexists(object, name) <= 0) return "";
    const Handle attribute(H5Aopen(object, name, H5P_DEFAULT));
    if (attribute < 0) return "";
    const Handle type(H5Aget_type(attribute));
    const std::size_t size = H5Tget_size(type);
    if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0 || size == 0 || size > 1000) return "";
    std::string text(size, '\0');
    if (H5Aread(attribute, type, text.data()) < 0) return "";
    return text.substr(0, text.find('\0'));
  }

  MatValue object(const Handle& object, const std::string& place, std::size_t depth) {
    if (object < 0) refuse(place, "cannot be opened");
    if (depth > deepest_group) refuse(place, "lies in more structs than are followed");
    if (++parts_ > most_parts) refuse(place, "has more parts than are read");
    MatValue value;
    const std::string kind = attribute(object, "MATLAB_class");
    if (H5Aexists(object, "MATLAB_object_decode") > 0 || kind == "function_handle" || kind == "table") {
      value.what = kind == "function_handle" ? "a function" : object_remedy;
      return value;
    }
    if (H5Aexists(object, "MATLAB_sparse") > 0) {
      value.what = "a sparse matrix: save full(...) of it";
      return value;
    }
    switch (H5Iget_type(object)) {
      case H5I_GROUP:
        structure(object, place, depth, value);
        break;
      case H5I_DATASET:
        dataset(object, kind, place, depth, value);
        break;
      default:
        value.what = "no variable";
    }
    return value;
  }

  // A struct array has a dataset of references a field, all of one size; in a struct each member is a field.
  void structure(hid_t group, const std::string& place, std::size_t depth, MatValue& value) {
    value.kind = MatValue::Kind::structure;
    value.fields = links(group);
    std::vector<MatValue> members;
    bool array = !value.fields.empty();
    for (const std::string& field : value.fields) {
      const Handle member(H5Oopen(group, field.c_str(), H5P_DEFAULT));
      array = array && member >= 0 && H5Iget_type(member) == H5I_DATASET && attribute(member, "MATLAB_class").empty() &&
              H5Aexists(member, "MATLAB_empty") <= 0 && H5Tget_class(Handle(H5Dget_type(member))) == H5T_REFERENCE;
      members.push_back(object(member, place + "." + field, depth + 1));
    }
    for (const MatValue& member : members) array = array && member.dims == members.front().dims;
    if (!array) {
      value.dims = {1, 1};
      value.parts = std::move(members);
      return;
    }
    value.dims = members.front().dims;
    for (std::size_t e = 0; e < members.front().parts.size(); ++e)
      for (MatValue& member : members) value.parts.push_back(std::move(member.parts[e]));
  }

  void dataset(hid_t data, const std::string& kind, const std::string& place, std::size_t depth, MatValue& value) {
    const Handle space(H5Dget_space(data)), type(H5Dget_type(data));
    const int rank = H5Sget_simple_extent_ndims(space);
    if (space < 0 || type < 0 || rank < 0) refuse(place, "cannot be read");
    std::vector<hsize_t> sizes(static_cast<std::size_t>(rank));
    H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
    hsize_t count = 1;
    for (const hsize_t size : sizes) {
      if (size > 0 && count > most_elements / size) refuse(place, "has more elements than are read");
      count *= size;
    }
    value.dims.assign(sizes.rbegin(), sizes.rend());
    while (value.dims.size() < 2) value.dims.insert(value.dims.begin(), 1);
    const bool empty =
        H5Aexists(data, "MATLAB_empty") > 0 || count == 0 || H5Sget_simple_extent_type(space) == H5S_NULL;
    if (empty) {
      value.kind = kind == "char"   ? MatValue::Kind::text
                   : kind == "cell" ? MatValue::Kind::cells
                                    : MatValue::Kind::numbers;
      value.dims = {0, 0};
      return;
    }
    switch (H5Tget_class(type)) {
      case H5T_REFERENCE:
        references(data, type, count, place, depth, value);
        break;
      case H5T_STRING:
        string(data, type, count, place, value);
        break;
      case H5T_ENUM: {  // NumPy's truth values
        std::vector<std::int8_t> truths(count);
        if (H5Tget_size(type) != 1 || H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, truths.data()) < 0)
          refuse(place, "cannot be read");
        value.kind = MatValue::Kind::numbers;
        value.numbers.assign(truths.begin(), truths.end());
        break;
      }
      case H5T_INTEGER:
      case H5T_FLOAT:
        numbers(data, kind, count, place, value);
        break;
      case H5T_COMPOUND:
        value.what = "complex, or a table of its own: save its columns as arrays";
        break;
      default:
        value.what = "of an unknown kind";
    }
  }

  void numbers(hid_t data, const std::string& kind, hsize_t count, const std::string& place, MatValue& value) {
    value.numbers.resize(count);
    if (H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.numbers.data()) < 0)
      refuse(place, "cannot be read: it is damaged, or compressed in a way that the HDF5 library does not know");
    value.kind = MatValue::Kind::numbers;
    if (kind != "char") return;
    if (value.dims.size() != 2 || value.dims[0] > 1) {
      value.kind = MatValue::Kind::other;
      value.what = "a text of several rows";
      return;
    }
    value.kind = MatValue::Kind::text;
    for (const double letter : value.numbers)
      value.text += letter >= 0 && letter < 256 ? static_cast<char>(static_cast<unsigned char>(letter)) : '?';
    value.numbers.clear();
  }

  // Reads texts as HDF5 itself has them: one, or one a cell.
  void string(hid_t data, hid_t type, hsize_t count, const std::string& place, MatValue& value) {
    std::vector<std::string> texts;
    if (H5Tis_variable_str(type) > 0) {
      std::vector<char*> read(count, nullptr);
      const Handle space(H5Dget_space(data));
      if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, read.data()) < 0) refuse(place, "cannot be read");
      for (const char* text : read) texts.emplace_back(text == nullptr ? "" : text);
      H5Dvlen_reclaim(type, space, H5P_DEFAULT, read.data());
    } else {
      const std::size_t size = H5Tget_size(type);
      if (size == 0 || size > most_elements / count) refuse(place, "has more letters than are read");
      std::string all(size * count, '\0');
      if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()) < 0) refuse(place, "cannot be read");
      for (hsize_t k = 0; k < count; ++k) {
        const std::string text = all.substr(k * size, size);
        texts.push_back(text.substr(0, text.find('\0')));
      }
    }
    const auto as_text = [](std::string text) {
      MatValue one;
      one.kind = MatValue::Kind::text;
      one.dims = {1, text.size()};
      one.text = std::move(text);
      return one;
    };
    if (texts.size() == 1) {
      value = as_text(std::move(texts.front()));
      return;
    }
    value.kind = MatValue::Kind::cells;
    for (std::string& text : texts) value.parts.push_back(as_text(std::move(text)));
  }

  void references(hid_t data, hid_t type, hsize_t count, const std::string& place, std::size_t depth, MatValue& value) {
    value.kind = MatValue::Kind::cells;
    if (H5Tequal(type, H5T_STD_REF_OBJ) <= 0) refuse(place, "refers to a part of an array, which is not read");
    std::vector<hobj_ref_t> all(count);
    if (H5Dread(data, H5T_STD_REF_OBJ, H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()) < 0) refuse(place, "cannot be read");
    for (std::size_t k = 0; k < all.size(); ++k)
      value.parts.push_back(object(Handle(H5Rdereference2(data, H5P_DEFAULT, H5R_OBJECT, &all[k])),
                                   fmt::format("{}{{{}}}", place, k + 1), depth + 1));
  }

  const std::string& path_;
  Handle file_;
  std::size_t parts_ = 0;
};

}  // namespace

std::vector<MatValue> hdf5_variables(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // it would print its own account of what it cannot read
  return Reader(path).variables();
}

}  // namespace metastable::reports
