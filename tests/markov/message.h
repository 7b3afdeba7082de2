#pragma once
// Says what an illegal input is told.

#include <string>

namespace metastable::markov::testing {

/// Returns the message of the Error that `call` throws; empty when it throws none.
template <typename Error, typename Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace metastable::markov::testing
