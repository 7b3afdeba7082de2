#include "markov/passage/chain_files.h"

#include <charconv>
#include <stdexcept>
#include <vector>

namespace metastable::markov {
namespace {

struct Entry {
  std::size_t from, to;
  double probability;
};

std::vector<Entry> entries(const Chain& chain, const Launch& launch) {
  const std::size_t n = chain.size(), rest = n + 1;
  std::vector<Entry> all;
  const auto add = [&](std::size_t from, std::size_t to, double p) {
    if (p > 0) all.push_back({from, to, p});
  };
  for (std::size_t j = 0; j < n; ++j) add(0, j + 1, launch.after[j]);
  add(0, rest, launch.rest);
  for (std::size_t i = 0; i < n; ++i) {
    const auto columns = chain.columns(i);
    const auto values = chain.values(i);
    bool stayed = false;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (!stayed && columns[k] > i) {
        add(i + 1, i + 1, chain.stay(i));
        stayed = true;
      }
      add(i + 1, columns[k] + std::size_t{1}, values[k]);
    }
    if (!stayed) add(i + 1, i + 1, chain.stay(i));
    add(i + 1, rest, chain.kill(i));
  }
  add(rest, rest, 1);
  return all;
}

// Returns the shortest text that reads back as the same number, whatever the locale.
std::string text(double number) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, number).ptr;
  return {buffer, end};
}

std::string line(std::size_t first, const Entry& e) {
  return std::to_string(e.from + first) + ' ' + std::to_string(e.to + first) + ' ' + text(e.probability) + '\n';
}

}  // namespace

ChainFiles chain_files(const Chain& chain, const Launch& launch) {
  if (launch.after.size() != chain.size())
    throw std::invalid_argument("chain files: the launch is not of the chain's size");
  const std::vector<Entry> all = entries(chain, launch);
  const std::string states = std::to_string(chain.size() + 2), count = std::to_string(all.size());
  ChainFiles files;
  files.transitions = states + ' ' + count + '\n';
  files.matrix_market = "%%MatrixMarket matrix coordinate real general\n% state 1: launch, last state: rest\n" +
                        states + ' ' + states + ' ' + count + '\n';
  for (const Entry& e : all) {
    files.transitions += line(0, e);
    files.matrix_market += line(1, e);
  }
  files.labels = "0=\"init\" 1=\"deadlock\" 2=\"rest\"\n0: 0\n" + std::to_string(chain.size() + 1) + ": 2\n";
  files.rewards = states + ' ' + std::to_string(chain.size() + 1) + '\n';
  for (std::size_t i = 0; i <= chain.size(); ++i) files.rewards += std::to_string(i) + " 1\n";
  return files;
}

}  // namespace metastable::markov
