#pragma once
// Holds the options of one command, as texts; CLI11 stays in the .cpp.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/study/setting.h"
#include "dynamics/wheel/ranges.h"

namespace CLI {
class App;
}

namespace metastable::reports {

/// Lists what options are grouped under in --help and on manual pages, in that order; the first is of those without.
inline constexpr std::string_view option_groups[] = {"Options",
                                                     "Question",
                                                     "Trials",
                                                     "The file",
                                                     "What the file does not tell",
                                                     "The virtual laboratory (--reality)",
                                                     "Ramp and launch",
                                                     "Wheel",
                                                     "Contacts and their law",
                                                     "Method and accuracy",
                                                     "Standard errors of what was measured",
                                                     "Walkers on two legs (--walker)",
                                                     "Files and help"};

/// Says why a text cannot be an option's value: it is an option itself ("--how-it-fails", "-h"), so that the value was
/// left out. "" for all others, such as negative numbers. @param value  what stands for it in the help
std::string value_objection(const std::string& text, const std::string& value);

/// Holds what was given on the command line or in a --config file, or is left at its default. What a text means is
/// checked when it is read; messages name the option (std::invalid_argument).
class Options {
 public:
  explicit Options(CLI::App& command) : command_(command) {}

  /// Puts the options that are added from now on into one of option_groups.
  void group(std::string_view name);
  void add(const std::string& name, const std::string& value, const std::string& fallback, const std::string& help);
  /// Its number, its mean and sd, or each number of its list must lie in the range, which the help states.
  void add(const std::string& name, const std::string& value, const std::string& fallback, const std::string& help,
           const dynamics::Range& range);
  /// Adds an option without a value; `true` or `false` in a file.
  void add_flag(const std::string& name, const std::string& help);
  /// Add the options of what draws random numbers (default 1) and of what runs in parallel (default 0: all cores).
  void add_seed();
  void add_threads();
  /// Adds the option of what can be written as JSON, which is every command.
  void add_json();
  /// Takes the default off an option that was added: what it says must be given, or is not said.
  void drop_default(const std::string& name);
  /// Lets options that were added hold several values, with commas between them: values().
  void take_several(const std::vector<std::string>& names) { several_.insert(names.begin(), names.end()); }
  /// Adds what the command is about, given by its place on the command line, which is required. `words` are all it may
  /// be, "a|b", or "" for anything.
  void add_place(const std::string& name, const std::string& help, const std::string& words = "");
  /// Adds it likewise, and it may be left out.
  void add_optional_place(const std::string& name, const std::string& help);
  /// Adds one or more of those.
  void add_places(const std::string& name, const std::string& help);
  /// Reads the keys of the file that the command line did not give.
  void read(const std::string& file);
  /// Returns a message about an option with the file and line before it that the option was read from, if it was.
  std::string placed(const std::string& message) const;
  /// Says of an option what a command line would say, once for each time it would be given; nothing forgets.
  void give(const std::string& name, std::vector<std::string> values) { texts_.at(name) = std::move(values); }
  /// Nothing that was given may be empty; where the value is one of some words ("fresh|facets"), it is one of these.
  /// @throws std::invalid_argument with the nearest word
  void check_given() const;

  std::vector<std::string> names() const;  ///< all of them, without dashes
  bool has(const std::string& name) const { return texts_.contains(name); }
  bool given(const std::string& name) const { return !texts_.at(name).empty(); }
  const std::vector<std::string>& all(const std::string& name) const { return texts_.at(name); }
  /// Returns what stands for an option's or a place's value in the help ("FILE"); "" for flags.
  std::string value(const std::string& name) const;
  /// Returns the one value of an option: given once, or its default ("" if it has none).
  std::string text(const std::string& name) const;
  /// Returns all values of an option: as often as it was given, and each with commas in it where it may hold several;
  /// its default where it was not given.
  std::vector<std::string> values(const std::string& name) const;
  bool flag(const std::string& name) const;
  double number(const std::string& name) const;
  std::uint64_t whole(const std::string& name, std::uint64_t least, std::uint64_t most) const;
  /// Returns a whole number that is an int; 0 <= least, most <= INT_MAX.
  int count(const std::string& name, int least, int most) const;
  std::uint64_t seed() const;
  int threads() const;
  analysis::Spread spread(const std::string& name) const;
  /// Returns the range an option was added with; any number for others.
  const dynamics::Range& range(const std::string& name) const;

 private:
  CLI::App& command_;
  std::map<std::string, std::vector<std::string>> texts_;
  std::map<std::string, std::string> fallback_;
  std::map<std::string, std::string> places_;  ///< "file:line: " of what a file gave
  std::map<std::string, dynamics::Range> ranges_;
  std::set<std::string> several_;
  std::string group_{option_groups[0]};
};

/// Options that give() gives, and no command line.
class LooseOptions {
 public:
  explicit LooseOptions(const std::function<void(Options&)>& declare);
  LooseOptions(LooseOptions&&) noexcept;
  ~LooseOptions();
  Options& operator*() { return options_; }
  Options* operator->() { return &options_; }
  const Options& operator*() const { return options_; }

 private:
  std::unique_ptr<CLI::App> holder_;
  Options options_;
};

}  // namespace metastable::reports
