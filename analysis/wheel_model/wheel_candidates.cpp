#include "analysis/wheel_model/wheel_candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>
#include <utility>

namespace metastable::analysis {
namespace {

using dynamics::Extension;
using Values = std::vector<double>;

constexpr double degree = std::numbers::pi / 180;

// Finds the number that an effect changes.
using Field = std::function<double&(Extension&)>;
template <class Part>
Field in(Part Extension::*part, double Part::*number) {
  return [=](Extension& e) -> double& { return e.*part.*number; };
}

// The plain effect has one free parameter, which goes into one field and is reported under one name.
WheelCandidate simple(std::string id, std::string name, const Field& field, FreeParameter parameter, double unit = 1) {
  WheelCandidate c;
  c.candidate.id = std::move(id);
  c.candidate.parameters = {parameter};
  c.candidate.report = [name = std::move(name)](const Values&, const Values& v) {
    return std::vector<NamedValue>{{name, v[0]}};
  };
  c.apply = [field, unit](Extension& e, const Values&, const Values& v) { field(e) = v[0] * unit; };
  return c;
}

// A standard deviation is fitted as its square: there the likelihood has a slope at nothing.
WheelCandidate spread(std::string id, std::string name, const Field& field, double largest, double try_at) {
  WheelCandidate c =
      simple(std::move(id), "", field, {0, 0, largest * largest, 1e-3 * try_at * try_at, try_at * try_at});
  c.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] * v[0]}}; };
  c.candidate.report = [name = std::move(name)](const Values&, const Values& v) {
    return std::vector<NamedValue>{{name, std::sqrt(std::max(0.0, v[0]))}};
  };
  c.apply = [field](Extension& e, const Values&, const Values& v) { field(e) = std::sqrt(std::max(0.0, v[0])); };
  return c;
}

// An effect between trials, launches or collisions needs some of them, whatever its size.
WheelCandidate needing(std::size_t least, std::size_t here, const char* of_what, WheelCandidate c) {
  if (c.candidate.undecidable.empty() && here < least)
    c.candidate.undecidable =
        fmt::format("it needs {} {}, and there {} {}", least, of_what, here == 1 ? "is" : "are", here);
  return c;
}

WheelCandidate initial_speed(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "initial_speed";
  c.candidate.parameters = {{0, -3, 3, 1e-3}, {0, -1, 1, 1e-3}};
  c.candidate.report = [](const Values&, const Values& v) {
    return std::vector<NamedValue>{{"mean_rad_s", v[0]}, {"sd_rad_s", v[1]}};
  };
  c.apply = [](Extension& e, const Values&, const Values& v) {
    e.sensor.launch_shift = v[0];
    e.sensor.launch_widening = v[1];
  };
  if (!design.launches_stated) c.candidate.undecidable = "no launch speed is stated to compare with";
  return c;
}

// Returns by how much every leg may change [m] so that each lands whatever the others do (dynamics::Wheel).
double most_leg_change(const std::vector<double>& stated) {
  constexpr double largest = 0.02, clear = 0.99;
  double most = largest;
  const double cosine = std::cos(2 * std::numbers::pi / static_cast<double>(stated.size()));
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const auto [shorter, longer] = std::minmax(stated[i], stated[(i + 1) % stated.size()]);
    most = std::min({most, clear * (shorter - longer * cosine) / (1 + cosine), clear * shorter});
  }
  return most;
}

WheelCandidate leg_lengths(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "leg_lengths";
  const double most = most_leg_change(design.leg_lengths);
  FreeParameter change{0, -most, most, 1e-6};
  change.prior_sd = 0.002;  // of each: whoever stated the lengths had a ruler
  c.candidate.parameters.assign(design.leg_lengths.size(), change);
  c.candidate.report = [stated = design.leg_lengths](const Values&, const Values& v) {
    std::vector<NamedValue> named;
    for (std::size_t i = 0; i < v.size(); ++i) named.emplace_back("leg_lengths_m", stated[i] + v[i]);
    return named;
  };
  c.candidate.form_of = [stated = design.leg_lengths](const Values& v) {
    FittedForm form;
    for (std::size_t i = 0; i < v.size(); ++i) form.values.push_back(v[i] - stated.at(i));
    return form;
  };
  c.apply = [](Extension& e, const Values&, const Values& v) { e.geometry.leg_change = v; };
  if (!design.legs_known) c.candidate.undecidable = "which leg landed is not known";
  return c;
}

// A variant is {leg, what}: 0 is the leg's friction, 1 its restitution.
WheelCandidate leg_contact(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "leg_contact";
  c.candidate.parameters = {{1, 0.1, 3, 1e-3}};
  c.candidate.variants.clear();
  for (const double what : {0.0, 1.0})
    for (int leg = 0; leg < design.legs; ++leg) c.candidate.variants.push_back({static_cast<double>(leg), what});
  c.candidate.report = [](const Values& variant, const Values& v) {
    const bool friction = variant[1] == 0;
    return std::vector<NamedValue>{
        {"leg", variant[0]}, {"friction_ratio", friction ? v[0] : 1}, {"restitution_ratio", friction ? 1 : v[0]}};
  };
  c.candidate.form_of = [](const Values& v) {
    const bool friction = v[1] != 1 || v[2] == 1;  // both at once have no fitted form: friction's is taken
    return FittedForm{{v[0], friction ? 0.0 : 1.0}, {friction ? v[1] : v[2]}};
  };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.contact.leg = static_cast<int>(variant[0]);
    (variant[1] == 0 ? e.contact.leg_friction : e.contact.leg_restitution) = v[0];
  };
  c.changes = [](const dynamics::StepContext& at, const Values& variant, std::size_t) {
    const bool friction = variant[1] == 0;
    return AspectChange{friction ? ContactAspect::mean_friction : ContactAspect::mean_restitution,
                        at.leg == static_cast<int>(variant[0]) ? 1.0 : 0.0};
  };
  if (!design.legs_known) c.candidate.undecidable = "which leg landed is not known";
  return c;
}

WheelCandidate hub_eccentricity(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "hub_eccentricity";
  c.candidate.parameters = {{0, -0.05, 0.05, 1e-6}, {0, -0.05, 0.05, 1e-6}};
  c.candidate.report = [](const Values&, const Values& v) {
    return std::vector<NamedValue>{{"offset_m", std::hypot(v[0], v[1])}, {"phase_rad", std::atan2(v[1], v[0])}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] * std::cos(v[1]), v[0] * std::sin(v[1])}}; };
  c.apply = [](Extension& e, const Values&, const Values& v) {
    e.geometry.hub_forward = v[0];
    e.geometry.hub_aside = v[1];
  };
  if (!design.legs_known) c.candidate.undecidable = "which leg landed is not known";
  return c;
}

// A variant is {shape, from, to}; the shape is a parabola, half a sine or a bend in the middle.
WheelCandidate slope_profile(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "slope_profile";
  c.candidate.parameters = {{0, -0.1, 0.1, 1e-6}};
  c.candidate.variants.clear();
  std::vector<double> ends{design.furthest, 1.25 * design.furthest};
  if (design.ramp_length > 1.4 * design.furthest) ends.push_back(design.ramp_length);
  for (const double to : ends)
    for (const double shape : {0.0, 1.0}) c.candidate.variants.push_back({shape, 0, to});
  // A bend anywhere is a step in the slope: these are stretches whose middle lies there.
  for (const double share : {0.25, 0.375, 0.5, 0.625, 0.75})
    c.candidate.variants.push_back({2, 0, 2 * share * design.furthest});
  c.candidate.refine = {0, 0.25 * design.furthest, 0.25 * design.furthest};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"sag_m", v[0]}, {"from_m", std::max(0.0, variant[1])}, {"to_m", variant[2]}};
  };
  c.candidate.form_of = [end = design.ramp_length](const Values& v) {
    return FittedForm{{0, v[1], v[2] > 0 ? v[2] : end}, {v[0]}};
  };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.geometry.sag_shape = static_cast<Extension::Geometry::Shape>(static_cast<int>(variant[0]));
    e.geometry.sag_from = std::max(0.0, variant[1]);  // The ramp begins at the first foot.
    e.geometry.sag_to = variant[2];
    e.geometry.sag = v[0];
  };
  return c;
}

WheelCandidate speed_dependent_friction() {
  WheelCandidate c;
  c.candidate.id = "speed_dependent_friction";
  c.candidate.parameters = {{0, -0.9, 5, 1e-3}};
  c.candidate.variants = {{1.0}, {2.0}, {4.0}, {8.0}};
  c.candidate.refine = {0.8};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"amplitude", v[0]}, {"speed_rad_s", variant[0]}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{v[1]}, {v[0]}}; };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.contact.stribeck_speed = variant[0];
    e.contact.stribeck = v[0];
  };
  return c;
}

// Variants are the intervals between twelfths of the stretch that was rolled over. Where every trial has the same
// footholds, a patch that holds one of them is a collision number and no patch: it takes two.
WheelCandidate friction_patch(const WheelDesign& design) {
  const auto is_patch = [footholds = design.footholds](double from, double to) {
    return footholds.empty() || std::count_if(footholds.begin(), footholds.end(),
                                              [&](double foot) { return from <= foot && foot <= to; }) > 1;
  };
  WheelCandidate c;
  c.candidate.id = "friction_patch";
  c.candidate.parameters = {{1, 0.1, 5, 1e-3}};
  c.candidate.variants.clear();
  constexpr int parts = 12;
  const double part = (design.furthest + 0.06) / parts;
  for (int from = 0; from < parts; ++from)
    for (int to = from + 1; to <= std::min(parts, from + 8); ++to)
      if (is_patch(from * part - 0.03, to * part - 0.03))
        c.candidate.variants.push_back({from * part - 0.03, to * part - 0.03});
  if (c.candidate.variants.empty()) {
    c.candidate.variants.push_back({-0.03, parts * part - 0.03});
    c.candidate.undecidable = "no patch holds two footholds";
  }
  c.candidate.refine = {part, part};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{
        {"from_m", std::max(0.0, variant[0])}, {"to_m", variant[1]}, {"friction_ratio", v[0]}};
  };
  c.candidate.form_of = [end = design.ramp_length](const Values& v) {
    return FittedForm{{v[0], v[1] > 0 ? v[1] : end}, {v[2]}};
  };
  c.apply = [is_patch](Extension& e, const Values& variant, const Values& v) {
    if (!is_patch(variant[0], variant[1])) return;  // nothing is gained by such a variant
    e.contact.patch_from = variant[0];
    e.contact.patch_to = variant[1];
    e.contact.patch_friction = v[0];
  };
  c.changes = [](const dynamics::StepContext& at, const Values& variant, std::size_t) {
    return AspectChange{ContactAspect::mean_friction,
                        at.position >= variant[0] && at.position <= variant[1] ? 1.0 : 0.0};
  };
  return c;
}

WheelCandidate contact_outliers() {
  WheelCandidate c;
  c.candidate.id = "contact_outliers";
  c.candidate.parameters = {{0, 0, 0.5, 2e-4, 0.01}};
  c.candidate.variants = {{1.4}, {1.8}, {2.5}};
  c.candidate.refine = {0.3};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"share", v[0]}, {"friction_ratio", variant[0]}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{v[1]}, {v[0]}}; };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.contact.outlier_friction = variant[0];
    e.contact.outlier_share = v[0];
  };
  return c;
}

// A variant says how the biases before and after a collision stand: {1, 1}, {1, 0}, {1, -1}.
WheelCandidate sensor_bias(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "sensor_bias";
  c.candidate.parameters = {{0, -2, 2, 1e-4}};
  c.candidate.variants = {{1, 1}};
  if (design.speeds_after) c.candidate.variants = {{1, 1}, {1, 0}, {1, -1}};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"bias_rad_s", v[0]}, {"share_after_collision", variant[1]}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{1, 1}, {v[0]}}; };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.sensor.bias_before = v[0] * variant[0];
    e.sensor.bias_after = v[0] * variant[1];
  };
  return c;
}

WheelCandidate ramp_vibration() {
  WheelCandidate c;
  c.candidate.id = "ramp_vibration";
  c.candidate.parameters = {{0, -1, 1, 1e-3}, {0, -1, 1, 1e-3}};
  c.candidate.variants.clear();
  for (double f = 2; f <= 60; f *= 1.06) c.candidate.variants.push_back({f});
  c.candidate.refine = {0.6};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{
        {"amplitude", std::hypot(v[0], v[1])}, {"frequency_hz", variant[0]}, {"phase_rad", std::atan2(-v[1], v[0])}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{v[1]}, {v[0], 0}}; };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.contact.ring_frequency = variant[0];
    e.contact.ring_cosine = v[0];
    e.contact.ring_sine = v[1];
  };
  c.changes = [](const dynamics::StepContext& at, const Values& variant, std::size_t parameter) {
    const double angle = 2 * std::numbers::pi * variant[0] * at.since_previous.value_or(0);
    const double wave = parameter == 0 ? std::cos(angle) : std::sin(angle);
    return AspectChange{ContactAspect::loss, at.since_previous ? wave : 0};
  };
  return c;
}

WheelCandidate sensor_noise(const WheelDesign& design) {
  WheelCandidate c = spread("sensor_noise", "sd_rad_s", in(&Extension::sensor, &Extension::Sensor::noise_sd), 1, 0.01);
  c.candidate.exact = true;
  FreeParameter& variance = c.candidate.parameters[0];
  variance.step = std::min(variance.step, 0.01 * design.noise * design.noise);  // slopes are those at what is stated
  if (design.noise_seen > 2 * design.noise) variance.likely = design.noise_seen * design.noise_seen;
  if (!design.noise_stated)
    c.candidate.undecidable = "the sensor noise is not the stated one: it was assumed or taken from the data";
  return c;
}

// Variants are the speeds at which feet begin to hop: 0, and some between those that were seen.
WheelCandidate bounce(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "bounce";
  c.candidate.parameters = {{0, 0, 1, 1e-3, 0.05}};
  c.candidate.variants = {{0.0}};
  for (const double speed : design.speeds) c.candidate.variants.push_back({speed});
  if (design.speeds.size() > 1)
    c.candidate.refine = {0.5 * (design.speeds.back() - design.speeds.front()) /
                          static_cast<double>(design.speeds.size() - 1)};
  c.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"rebound_lost", v[0]}, {"onset_rad_s", variant[0]}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{v[1]}, {v[0]}}; };
  c.apply = [](Extension& e, const Values& variant, const Values& v) {
    e.contact.rebound_lost = v[0];
    e.contact.hops_from = variant[0];
  };
  if (design.law == dynamics::Law::settled) c.candidate.undecidable = "`settled` follows the hops itself";
  return c;
}

// The root of the compliance is fitted: an impact lasts in proportion to it.
WheelCandidate soft_contact(const WheelDesign& design) {
  WheelCandidate c = simple("soft_contact", "", in(&Extension::contact, &Extension::ContactChange::softness),
                            {0, 0, std::sqrt(1e-5), 1e-5, 3e-4});
  c.candidate.report = [](const Values&, const Values& v) {
    constexpr double least = 1e-12;  // [m/N]: as good as rigid
    return std::vector<NamedValue>{{"compliance_m_n", v[0] * v[0]},
                                   {"stiffness_n_m", 1 / std::max(least, v[0] * v[0])}};
  };
  c.candidate.form_of = [](const Values& v) { return FittedForm{{}, {std::sqrt(v[0])}}; };
  if (design.law != dynamics::Law::settled) c.candidate.undecidable = "no impact lasts but under `settled`";
  return c;
}

WheelCandidate slip_reversal(const WheelDesign& design) {
  WheelCandidate c;
  c.candidate.id = "slip_reversal";
  c.candidate.report = [](const Values&, const Values&) { return std::vector<NamedValue>{}; };
  c.apply = [](Extension& e, const Values&, const Values&) { e.contact.law = dynamics::Law::coulomb; };
  if (design.law != dynamics::Law::published) c.candidate.undecidable = "the nominal law is not `published`";
  return c;
}

}  // namespace

std::vector<WheelCandidate> wheel_candidates(const WheelDesign& design) {
  constexpr std::string_view of_contacts[] = {"leg_contact",
                                              "speed_dependent_restitution",
                                              "speed_dependent_friction",
                                              "contact_memory",
                                              "friction_patch",
                                              "trial_drift",
                                              "trial_spread",
                                              "contact_outliers",
                                              "bounce"};
  constexpr const char* after_another = "collisions with one before them in their trial";
  constexpr const char* away = "collisions away from the start";
  // It needs a mean and a spread, or a trend, and as many again to judge them by.
  std::vector<WheelCandidate> all{
      needing(5, design.launches, "launches where a launch speed is stated", initial_speed(design)),
      leg_lengths(design),
      leg_contact(design),
      hub_eccentricity(design),
      simple("inertia", "ratio", in(&Extension::geometry, &Extension::Geometry::inertia_ratio), {1, 0.5, 2, 1e-4}),
      simple("slope_offset", "offset_deg", in(&Extension::geometry, &Extension::Geometry::slope_offset_rad),
             {0, -3, 3, 1e-3}, degree),
      needing(2, design.away, away, slope_profile(design)),
      simple("axle_drag_viscous", "n_m_s", in(&Extension::torques, &Extension::Torques::viscous), {0, -0.1, 0.1, 1e-6}),
      simple("rolling_resistance", "torque_n_m", in(&Extension::torques, &Extension::Torques::rolling),
             {0, -0.3, 0.3, 1e-5}),
      simple("air_drag", "n_m_s2", in(&Extension::torques, &Extension::Torques::air), {0, -0.02, 0.02, 1e-7}),
      simple("speed_dependent_restitution", "exponent",
             in(&Extension::contact, &Extension::ContactChange::restitution_exponent), {0, -2, 2, 1e-3}),
      speed_dependent_friction(),
      needing(2, design.successive, after_another,
              simple("contact_memory", "correlation", in(&Extension::contact, &Extension::ContactChange::memory),
                     {0, -0.95, 0.95, 1e-3})),
      needing(2, design.away, away, friction_patch(design)),
      needing(3, design.trials, "trials",
              simple("trial_drift", "relative_change", in(&Extension::contact, &Extension::ContactChange::drift),
                     {0, -0.9, 5, 1e-3})),
      needing(5, design.trials, "trials",
              spread("trial_spread", "friction_sd",
                     in(&Extension::contact, &Extension::ContactChange::trial_friction_sd), 0.3, 0.01)),
      contact_outliers(),
      sensor_noise(design),
      sensor_bias(design),
      bounce(design),
      soft_contact(design),
      needing(2, design.successive, after_another, ramp_vibration()),
      slip_reversal(design),
  };
  if (design.law == dynamics::Law::plastic)
    for (WheelCandidate& effect : all)
      if (std::ranges::find(of_contacts, effect.candidate.id) != std::end(of_contacts))
        effect.candidate.undecidable = "under `plastic` nothing depends on restitution or friction";
  return all;
}

}  // namespace metastable::analysis
