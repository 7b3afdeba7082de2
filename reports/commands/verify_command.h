#pragma once
// metastable verify measures how accurate the program is.

#include <string>

namespace metastable::reports {

struct VerifyRequest {
  int seeds = 0;            ///< sampled studies a benchmark to count coverage over; 0: none
  std::size_t nodes = 512;  ///< per phase, where doubling stops
  int threads = 0;
  std::string out;        ///< folder for the tables as CSV, Markdown, LaTeX; "" for none
  std::string export_to;  ///< folder for one chain as PRISM and MatrixMarket files; "" for none
  std::string json;       ///< file, "-" for standard output, "" for none
  std::string command;
};

/// Prints the tables as Markdown. @throws OutputError; markov::ConvergenceError if the primary solver fails
void run_verify(const VerifyRequest& request);

}  // namespace metastable::reports
