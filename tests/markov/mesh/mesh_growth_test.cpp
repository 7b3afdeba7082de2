// Grows meshes shared by ranks that are threads of one process: where there is no MPI, this holds what ranks rely on.

#include "markov/mesh/mesh_growth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <barrier>
#include <map>
#include <mutex>
#include <numeric>
#include <thread>

#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

/// Holds what threads show one another.
struct Hub {
  explicit Hub(int ranks)
      : meeting(ranks), values(static_cast<std::size_t>(ranks)), texts(values.size()), notes(values.size()) {}
  std::barrier<> meeting;
  std::vector<double> values;
  std::vector<std::string> texts;
  std::vector<std::vector<std::vector<Exchange::Note>>> notes;
};

class ThreadRank : public Exchange {
 private:
  template <class T, class Read>
  auto show(std::vector<T>& all, const T& own, const Read& read) {
    all[rank_] = own;
    hub_.meeting.arrive_and_wait();
    auto seen = read(all);
    hub_.meeting.arrive_and_wait();
    return seen;
  }

 public:
  ThreadRank(Hub& hub, std::size_t rank) : hub_(hub), rank_(rank) {}
  int rank() const override { return static_cast<int>(rank_); }
  int ranks() const override { return static_cast<int>(hub_.values.size()); }
  double sum(double own) override {
    return show(hub_.values, own, [](const auto& all) { return std::accumulate(all.begin(), all.end(), 0.0); });
  }
  double largest(double own) override {
    return show(hub_.values, own, [](const auto& all) { return *std::max_element(all.begin(), all.end()); });
  }
  std::vector<std::vector<Note>> swap(const std::vector<std::vector<Note>>& to) override {
    return show(hub_.notes, to, [this](const auto& all) {
      std::vector<std::vector<Note>> here;
      for (const auto& sent : all) here.push_back(sent[rank_]);
      return here;
    });
  }
  std::string first_text(const std::string& own) override {
    return show(hub_.texts, own, [](const auto& all) {
      const auto first = std::find_if(all.begin(), all.end(), [](const auto& text) { return !text.empty(); });
      return first == all.end() ? std::string() : *first;
    });
  }

 private:
  Hub& hub_;
  std::size_t rank_;
};

struct GrownRow {
  double kill = 0, leave = 0;
  std::map<std::uint64_t, double> entries;
  bool operator==(const GrownRow&) const = default;
};
using Rows = std::map<std::uint64_t, GrownRow>;

void take_rows(const MeshGrowth& growth, Rows& rows) {
  for (std::size_t r = 0; r < growth.rows(); ++r) {
    GrownRow& row = rows[growth.key(growth.node_of_row(r))];
    row.kill = growth.kill(r);
    row.leave = growth.leave(r);
    for (std::size_t e = 0; e < growth.columns(r).size(); ++e)
      row.entries[growth.key(growth.columns(r)[e])] = growth.values(r)[e];
  }
}

void expect_rows_of_one_process(const BatchMap& map, const std::vector<double>& start, const MeshOptions& options) {
  const NodeLattice lattice = mesh_lattice(map, noise_frames(map, start), options);
  Rows one;
  MeshGrowth alone(map, lattice, options);
  alone.grow_from(start);
  take_rows(alone, one);
  ASSERT_GT(one.size(), 30u);
  for (const int ranks : {2, 3}) {
    Hub hub(ranks);
    Rows shared;
    std::mutex mutex;
    std::vector<std::thread> threads;
    for (int rank = 0; rank < ranks; ++rank)
      threads.emplace_back([&, rank] {
        ThreadRank exchange(hub, static_cast<std::size_t>(rank));
        MeshGrowth growth(map, lattice, options, &exchange);
        growth.grow_from(start);
        const std::lock_guard lock(mutex);
        take_rows(growth, shared);
        EXPECT_EQ(growth.cheapest_failure(), alone.cheapest_failure());
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_TRUE(shared == one) << ranks << " ranks: " << shared.size() << " rows of " << one.size();
  }
}

TEST(MeshGrowth, RanksGrowTheRowsOfOneProcess) {
  expect_rows_of_one_process(linear_batch(0.4), {2}, {.spacing = 0.2});
  expect_rows_of_one_process(two_phase_batch(0.45), {2}, {.spacing = 0.2, .score_spacing = 0.3});
  expect_rows_of_one_process(skew_batch(0.8), {2, -2.0 / 3}, {.spacing = 1.2});
}

TEST(NodeTable, SpreadsTheNodesOfALatticeOfAnyDimension) {
  // 4096 keys in 8192 slots: of 64 x 64 nodes in a plane of each two axes, and of 16^3 in space.
  const auto shared = [](const std::vector<std::uint64_t>& keys) {
    std::vector<int> slot(2 * keys.size());
    for (const std::uint64_t key : keys) ++slot[NodeTable::first_slot(key, slot.size())];
    return *std::max_element(slot.begin(), slot.end());
  };
  for (const auto& [a, b] : {std::pair(0, 1), std::pair(0, 2), std::pair(2, 3)}) {
    std::vector<std::uint64_t> keys;
    for (std::uint64_t i = 0; i < 64; ++i)
      for (std::uint64_t j = 0; j < 64; ++j)
        keys.push_back(i * NodeLattice::axis_key(static_cast<std::size_t>(a)) +
                       j * NodeLattice::axis_key(static_cast<std::size_t>(b)));
    EXPECT_LE(shared(keys), 16) << a << b;
  }
  std::vector<std::uint64_t> keys;
  for (std::uint64_t i = 0; i < 4096; ++i)
    keys.push_back(i % 16 * NodeLattice::axis_key(0) + i / 16 % 16 * NodeLattice::axis_key(1) +
                   i / 256 * NodeLattice::axis_key(2));
  EXPECT_LE(shared(keys), 16);
}

}  // namespace
}  // namespace metastable::markov
