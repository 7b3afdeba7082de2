#pragma once
// Holds what a MAT file says, whatever library read it.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace metastable::reports {

/// A variable of a MAT file, or a part of one.
struct MatValue {
  enum class Kind { numbers, text, cells, structure, other };
  Kind kind = Kind::other;
  std::string name;               ///< of a variable; of a part: none
  std::string what;               ///< of `other`: what it is, for messages ("a sparse matrix")
  std::vector<std::size_t> dims;  ///< as MATLAB has them
  std::vector<double> numbers;    ///< in the order of MATLAB's linear index
  std::string text;
  std::vector<std::string> fields;  ///< of a structure
  /// Holds the cells, or the fields of a structure's elements: field f of element e at e * fields.size() + f.
  std::vector<MatValue> parts;

  std::size_t elements() const;  ///< the product of the dimensions
  std::string shape() const;     ///< "3 x 2"
};

/// Lie values in one text, as one process hands them to another.
std::string packed(const std::vector<MatValue>& variables);
std::vector<MatValue> unpacked(std::string_view text);

}  // namespace metastable::reports
