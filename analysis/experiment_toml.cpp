#include "analysis/experiment_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <toml++/toml.h>

namespace metastable::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// What a number may be.
struct Range {
  double low = -infinity, high = infinity;
  bool low_open = false, high_open = false;  // an infinite end is always open
  std::string text() const {
    return fmt::format("{}{}, {}{}", low_open || std::isinf(low) ? '(' : '[', low, high,
                       high_open || std::isinf(high) ? ')' : ']');
  }
  bool holds(double value) const {
    return std::isfinite(value) && (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
  }
};
constexpr Range any{};
constexpr Range positive{.low = 0, .low_open = true};
constexpr Range not_negative{.low = 0};

// One table of the file: every key that is read is remembered, finish() reports the others.
class Keys {
 public:
  Keys(const std::string& file, const toml::table& table, std::string name, Defects& defects)
      : file_(file), table_(table), name_(std::move(name)), defects_(defects) {}

  const toml::node* find(std::string_view key, bool required) {
    known_.emplace(key);
    const toml::node* node = table_.get(key);
    if (node == nullptr && required) report(table_, fmt::format("missing key '{}'", path(key)));
    return node;
  }

  std::optional<double> number(std::string_view key, bool required, const Range& range) {
    const toml::node* node = find(key, required);
    return node == nullptr ? std::nullopt : number(*node, path(key), range);
  }

  std::optional<double> number(const toml::node& node, const std::string& name, const Range& range) {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value) {
      report(node, fmt::format("{}: a number is expected", name));
    } else if (!range.holds(*value)) {
      report(node, fmt::format("{}: {} is outside {}", name, *value, range.text()));
    } else {
      return value;
    }
    return std::nullopt;
  }

  std::optional<std::int64_t> whole(std::string_view key, bool required, std::int64_t least, std::int64_t most) {
    const toml::node* node = find(key, required);
    if (node == nullptr) return std::nullopt;
    const auto* value = node->as_integer();
    if (value != nullptr && value->get() >= least && value->get() <= most) return value->get();
    report(*node, fmt::format("{}: a whole number in {}..{} is expected", path(key), least, most));
    return std::nullopt;
  }

  std::optional<std::string> text(std::string_view key, bool required) {
    const toml::node* node = find(key, required);
    if (node == nullptr) return std::nullopt;
    if (const auto* value = node->as_string()) return value->get();
    report(*node, fmt::format("{}: a text in quotes is expected", path(key)));
    return std::nullopt;
  }

  std::optional<Keys> table(std::string_view key, bool required) {
    const toml::node* node = find(key, required);
    if (node == nullptr) return std::nullopt;
    if (const toml::table* value = node->as_table()) return Keys(file_, *value, path(key), defects_);
    report(*node, fmt::format("{}: a table is expected", path(key)));
    return std::nullopt;
  }

  // { mean = , sd = }
  std::optional<Spread> spread(std::string_view key, bool required, const Range& mean_range) {
    const toml::node* node = find(key, required);
    if (node == nullptr) return std::nullopt;
    if (!node->is_table()) {
      report(*node, fmt::format("{}: {{ mean = ..., sd = ... }} is expected", path(key)));
      return std::nullopt;
    }
    Keys keys(file_, *node->as_table(), path(key), defects_);
    const std::optional<double> mean = keys.number("mean", true, mean_range), sd = keys.number("sd", true, not_negative);
    keys.finish();
    if (!mean || !sd) return std::nullopt;
    return Spread{*mean, *sd};
  }

  void finish() {
    for (const auto& [key, node] : table_) {
      if (known_.contains(key.str())) continue;
      std::string names;
      for (const std::string& name : known_) names += (names.empty() ? "" : ", ") + name;
      defects_.add(file_, place(key.source()),
                   fmt::format("unknown key {}{} (known: {})", shown_text(key.str()),
                               name_.empty() ? "" : fmt::format(" in {}", name_), names));
    }
  }

  void report(const toml::node& node, std::string_view what) { defects_.add(file_, place(node.source()), what); }
  std::string path(std::string_view key) const { return name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key); }

 private:
  static Place place(const toml::source_region& source) {
    return {std::max<std::size_t>(source.begin.line, 1), std::max<std::size_t>(source.begin.column, 1)};
  }

  const std::string& file_;
  const toml::table& table_;
  std::string name_;
  Defects& defects_;
  std::set<std::string, std::less<>> known_;
};

void read_wheel(Keys& root, dynamics::Wheel& wheel) {
  std::optional<Keys> keys = root.table("wheel", true);
  if (!keys) return;
  if (const auto mass = keys->number("hub_mass_kg", true, positive)) wheel.hub_mass = *mass;
  if (const toml::node* node = keys->find("leg_lengths_m", true)) {
    const toml::array* list = node->as_array();
    if (list == nullptr || list->size() < 3 || list->size() > 1000) {
      keys->report(*node, "wheel.leg_lengths_m: a list of 3 to 1000 numbers [m] is expected");
    } else {
      std::vector<double> lengths;
      for (std::size_t i = 0; i < list->size(); ++i)
        if (const auto length = keys->number((*list)[i], fmt::format("wheel.leg_lengths_m[{}]", i), positive))
          lengths.push_back(*length);
      if (lengths.size() == list->size()) wheel.leg_length = std::move(lengths);
    }
  }
  wheel.inertia = keys->number("inertia_kg_m2", false, positive);
  wheel.radius_of_gyration = keys->number("radius_of_gyration_m", false, not_negative);
  keys->finish();
}

void read_contact(Keys& root, NominalContact& contact) {
  std::optional<Keys> keys = root.table("contact", true);
  if (!keys) return;
  if (const toml::node* node = keys->find("law", true)) {
    const auto* name = node->as_string();
    try {
      if (name == nullptr) throw std::invalid_argument("a text in quotes is expected");
      contact.law = dynamics::law_from_name(name->get());
    } catch (const std::invalid_argument&) {
      keys->report(*node, "contact.law: \"published\", \"coulomb\" or \"plastic\" is expected");
    }
  }
  const bool required = contact.law != dynamics::Law::plastic;
  contact.restitution = keys->spread("restitution", required, {.low = 0, .high = 1}).value_or(Spread{});
  contact.friction = keys->spread("friction", required, not_negative).value_or(Spread{});
  keys->finish();
}

void read_rotor(Keys& root, Experiment& experiment) {
  if (std::optional<Keys> keys = root.table("rotor", false)) {
    experiment.rotor_inertia = keys->number("inertia_kg_m2", false, positive);
    keys->finish();
  }
  std::optional<Keys> keys = root.table("loss", true);
  if (!keys) return;
  experiment.loss.constant = keys->number("constant", true, any).value_or(0);
  experiment.loss.linear = keys->number("linear", true, any).value_or(0);
  experiment.loss.quadratic = keys->number("quadratic", true, any).value_or(0);
  experiment.loss.noise_sd = keys->number("noise_sd", true, not_negative).value_or(0);
  keys->finish();
}

void read_conditions(const std::string& file, Keys& root, Experiment& experiment, Defects& defects) {
  const bool wheel = experiment.system == System::rimless_wheel;
  const toml::node* node = root.find("condition", wheel);
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty() ||
      !std::all_of(list->begin(), list->end(), [](const toml::node& item) { return item.is_table(); })) {
    root.report(*node, "condition: at least one [[condition]] is expected");
    return;
  }
  for (std::size_t i = 0; i < list->size(); ++i) {
    Keys keys(file, *(*list)[i].as_table(), fmt::format("condition[{}]", i), defects);
    Condition condition;
    if (auto id = keys.text("id", true)) {
      const toml::node& place = *keys.find("id", true);
      if (id->empty()) keys.report(place, "id: the text is empty");
      for (const Condition& other : experiment.conditions)
        if (other.id == *id) keys.report(place, fmt::format("id: a condition {} was there before", shown_text(*id)));
      condition.id = std::move(*id);
    }
    if (wheel) {
      const Range slopes{.low = 0, .high = 180.0 / experiment.wheel.legs(), .low_open = true, .high_open = true};
      condition.slope_deg = keys.number("slope_deg", true, slopes).value_or(0);
      condition.ramp_length = keys.number("ramp_length_m", true, positive).value_or(0);
      condition.first_landing_leg =
          static_cast<int>(keys.whole("first_landing_leg", false, 0, experiment.wheel.legs() - 1).value_or(0));
    }
    condition.initial_speed = keys.spread("initial_speed_rad_s", false, not_negative);
    keys.finish();
    experiment.conditions.push_back(std::move(condition));
  }
}

}  // namespace

void parse_experiment_toml(const std::string& file, std::string_view text, Experiment& experiment, Defects& defects) {
  toml::table table;
  try {
    table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    defects.add(file, {error.source().begin.line, error.source().begin.column}, error.description());
    return;
  }
  Keys root(file, table, "", defects);
  experiment.title = root.text("title", false).value_or("");
  if (const auto system = root.text("system", false)) {
    if (*system == "coast_down")
      experiment.system = System::coast_down;
    else if (*system != "rimless_wheel")
      root.report(*root.find("system", true), "system: \"rimless_wheel\" or \"coast_down\" is expected");
  }
  if (experiment.system == System::rimless_wheel) {
    read_wheel(root, experiment.wheel);
    read_contact(root, experiment.contact);
  } else {
    read_rotor(root, experiment);
  }
  read_conditions(file, root, experiment, defects);
  if (std::optional<Keys> keys = root.table("sensor", false)) {
    experiment.sensor.rate = keys->number("rate_hz", false, positive);
    experiment.sensor.noise_sd = keys->number("noise_sd_rad_s", false, not_negative);
    keys->finish();
  }
  root.finish();
}

}  // namespace metastable::analysis
