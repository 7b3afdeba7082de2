#include "analysis/sensitivity/setting_labels.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>

#include "analysis/sensitivity/parameter.h"

namespace metastable::analysis {
namespace {

using Settings = std::vector<Setting>;
using Text = std::function<std::string(const Setting&)>;

bool differ(const Settings& settings, const Text& text) {
  return std::any_of(settings.begin(), settings.end(),
                     [&](const Setting& one) { return text(one) != text(settings.front()); });
}

// Names mean and sd of a coefficient: what of it differs, or both.
Text spread_text(const Settings& settings, const char* name, Spread Setting::*which) {
  const Text mean = [=](const Setting& s) { return fmt::format("{} {}", name, (s.*which).mean); };
  const Text sd = [=](const Setting& s) { return fmt::format("sd of {} {}", name, (s.*which).sd); };
  const Text both = [=](const Setting& s) { return fmt::format("{} {} sd {}", name, (s.*which).mean, (s.*which).sd); };
  if (!differ(settings, sd)) return mean;
  return differ(settings, mean) ? both : sd;
}

Text legs_text(const Settings& settings) {
  const bool count = differ(settings, [](const Setting& s) { return fmt::format("{}", s.wheel.legs()); });
  const bool length =
      differ(settings, [](const Setting& s) { return fmt::format("{}", fmt::join(s.wheel.leg_length, " ")); });
  return [=](const Setting& s) -> std::string {
    const dynamics::Wheel paper;
    if (!length) return "";
    if (s.wheel.leg_length == paper.leg_length) return "the paper's legs";
    if (!s.wheel.equal_legs()) return fmt::format("legs {} m", fmt::join(s.wheel.leg_length, ", "));
    return count ? fmt::format("{} legs of {} m", s.wheel.legs(), s.wheel.leg_length.front())
                 : fmt::format("legs of {} m", s.wheel.leg_length.front());
  };
}

std::vector<Text> texts(const Settings& settings) {
  const bool papers_launch = std::all_of(settings.begin(), settings.end(), [](const Setting& s) {
    const std::optional<Spread> paper = paper_launch(s.slope_deg);
    return paper && paper->mean == s.initial_speed.mean && paper->sd == s.initial_speed.sd;
  });
  const auto given = [&](std::optional<double> dynamics::Wheel::*which) {
    return std::any_of(settings.begin(), settings.end(),
                       [&](const Setting& s) { return (s.wheel.*which).has_value(); });
  };
  const bool lists = std::any_of(settings.begin(), settings.end(), [](const Setting& s) { return !s.pairs.empty(); });
  std::vector<Text> all{[](const Setting& s) { return fmt::format("{} deg", s.slope_deg); },
                        [](const Setting& s) { return fmt::format("law {}", dynamics::law_name(s.law)); },
                        legs_text(settings),
                        [](const Setting& s) { return fmt::format("M {} kg", s.wheel.hub_mass); },
                        [](const Setting& s) { return fmt::format("tips of {} m", s.wheel.tip_radius); },
                        [](const Setting& s) { return fmt::format("K_r {} N/m", s.wheel.ramp_stiffness); },
                        [](const Setting& s) { return fmt::format("g {} m/s^2", s.wheel.gravity); },
                        spread_text(settings, "eta", &Setting::restitution),
                        spread_text(settings, "mu", &Setting::friction),
                        [](const Setting& s) { return fmt::format("correlation {}", s.correlation); },
                        [](const Setting& s) { return fmt::format("rebound lost {}", s.rebound_lost); },
                        [](const Setting& s) { return fmt::format("ramp {} m", s.ramp_length); },
                        [](const Setting& s) { return fmt::format("leg {} first", s.first_landing_leg); }};
  if (given(&dynamics::Wheel::inertia))
    all.push_back(
        [](const Setting& s) { return fmt::format("I {:.6g} kg m^2", parameter_value(s, Parameter::inertia)); });
  if (given(&dynamics::Wheel::radius_of_gyration))
    all.push_back([](const Setting& s) {
      return fmt::format("r_g {:.6g} m", parameter_value(s, Parameter::radius_of_gyration));
    });
  if (given(&dynamics::Wheel::contact_mass))
    all.push_back(
        [](const Setting& s) { return fmt::format("m_c {:.6g} kg", parameter_value(s, Parameter::contact_mass)); });
  if (lists)
    all.push_back([](const Setting& s) {
      return s.pairs.empty() ? std::string("normals") : fmt::format("a list of {} pairs", s.pairs.size());
    });
  if (!papers_launch) all.push_back(spread_text(settings, "omega_0", &Setting::initial_speed));
  return all;
}

}  // namespace

std::vector<std::string> setting_labels(const std::vector<Setting>& settings) {
  std::vector<std::string> labels(settings.size());
  for (const Text& text : texts(settings)) {
    if (!differ(settings, text)) continue;
    for (std::size_t i = 0; i < settings.size(); ++i)
      if (const std::string said = text(settings[i]); !said.empty())
        labels[i] += (labels[i].empty() ? "" : ", ") + said;
  }
  const std::vector<std::string> before = labels;
  for (std::size_t i = 0; i < labels.size(); ++i)
    if (labels[i].empty() || std::count(before.begin(), before.end(), labels[i]) > 1)
      labels[i] += fmt::format("{}setting {}", labels[i].empty() ? "" : ", ", i + 1);
  return labels;
}

}  // namespace metastable::analysis
