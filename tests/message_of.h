#pragma once
// Says what an illegal input is told.

#include <stdexcept>
#include <string>

namespace metastable {

/// Returns the message of the Error that `call` throws; a note if it throws none.
template <typename Error = std::invalid_argument, typename Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace metastable
