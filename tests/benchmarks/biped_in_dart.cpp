// Holds the biped of five links against DART, an engine of rigid bodies: accelerations, stance phases and strikes from
// drawn states. Ends with 1 where they differ by more than stated.
//   biped_in_dart [states]

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/PlanarJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <random>
#include <string>
#include <vector>

#include "dynamics/walkers/five_link_biped.h"

namespace {

namespace engine = dart::dynamics;
using Eigen::Vector3d;
using Eigen::VectorXd;
using metastable::dynamics::BipedLink;
using metastable::dynamics::BipedMotion;
using metastable::dynamics::BipedOptions;
using metastable::dynamics::BipedTorques;
using metastable::dynamics::FiveLinkBiped;

/// Holds the chain in the engine: x forward, z up, turning about y. Links in the order of metastable::dynamics.
class Chain {
 public:
  Chain(const BipedOptions& o, bool standing) : o_(o), skeleton_(engine::Skeleton::create()) {
    const double l = o.segment_length;
    if (standing) {
      bodies_[0] = hang(nullptr, Vector3d::Zero(), o.shank, l - o.shank.joint_to_mass);
    } else {
      engine::PlanarJoint::Properties plane;
      plane.mPlaneType = engine::PlanarJoint::PlaneType::ZX;
      bodies_[0] = loaded(skeleton_->createJointAndBodyNodePair<engine::PlanarJoint>(nullptr, plane).second, o.shank,
                          l - o.shank.joint_to_mass);
    }
    bodies_[1] = hang(bodies_[0], {0, 0, l}, o.thigh, l - o.thigh.joint_to_mass);
    bodies_[2] = hang(bodies_[1], {0, 0, l}, o.torso, o.torso.joint_to_mass);
    bodies_[3] = hang(bodies_[1], {0, 0, l}, o.thigh, -o.thigh.joint_to_mass);
    bodies_[4] = hang(bodies_[3], {0, 0, -l}, o.shank, -o.shank.joint_to_mass);
  }

  void place(const BipedMotion& m, double slope) {
    skeleton_->resetVelocities();
    skeleton_->setGravity(o_.gravity * Vector3d(std::sin(slope), 0, -std::cos(slope)));
    for (std::size_t i = 0; i < 5; ++i) {
      const std::size_t under = i == 0 ? 0 : i == 3 ? 1 : i - 1;
      auto* joint = bodies_[i]->getParentJoint();
      const std::size_t last = joint->getNumDofs() - 1;
      joint->setPosition(last, m.angles[i] - (i == 0 ? 0 : m.angles[under]));
      joint->setVelocity(last, m.rates[i] - (i == 0 ? 0 : m.rates[under]));
    }
  }

  std::array<double, 5> accelerations(const BipedMotion& m, double slope, const BipedTorques& t) {
    place(m, slope);
    skeleton_->setForces(
        (VectorXd(5) << 0, -t.stance_knee, t.stance_hip - t.swing_hip, t.swing_hip, t.swing_knee).finished());
    skeleton_->computeForwardDynamics();
    std::array<double, 5> told;
    for (std::size_t i = 0; i < 5; ++i) told[i] = bodies_[i]->getAngularAcceleration()[1];
    return told;
  }

  /// Returns rates after the impulse that stops the swing foot, of a chain that does not stand.
  std::array<double, 5> struck(const BipedMotion& m) {
    place(m, 0);
    const Vector3d foot(0, 0, -o_.segment_length);
    const Eigen::MatrixXd whole = skeleton_->getLinearJacobian(bodies_[4], foot);
    Eigen::MatrixXd hold(2, whole.cols());
    hold << whole.row(0), whole.row(2);
    const Eigen::MatrixXd mass = skeleton_->getMassMatrix();
    const VectorXd before = skeleton_->getVelocities();
    const Eigen::MatrixXd spread = mass.ldlt().solve(hold.transpose());
    skeleton_->setVelocities(before - spread * (hold * spread).ldlt().solve(hold * before));
    std::array<double, 5> told;
    for (std::size_t i = 0; i < 5; ++i) told[i] = bodies_[i]->getAngularVelocity()[1];
    return told;
  }

 private:
  static engine::BodyNode* loaded(engine::BodyNode* body, const BipedLink& link, double up) {
    body->setInertia({link.mass, Vector3d(0, 0, up), link.inertia * Eigen::Matrix3d::Identity()});
    return body;
  }
  engine::BodyNode* hang(engine::BodyNode* parent, const Vector3d& at, const BipedLink& link, double up) {
    engine::RevoluteJoint::Properties hinge;
    hinge.mAxis = Vector3d::UnitY();
    hinge.mT_ParentBodyToJoint.translation() = at;
    const std::string number = std::to_string(skeleton_->getNumBodyNodes());
    hinge.mName = "joint " + number;
    return loaded(skeleton_
                      ->createJointAndBodyNodePair<engine::RevoluteJoint>(
                          parent, hinge, engine::BodyNode::AspectProperties("link " + number))
                      .second,
                  link, up);
  }

  BipedOptions o_;
  engine::SkeletonPtr skeleton_;
  std::array<engine::BodyNode*, 5> bodies_{};
};

/// Follows the engine's accelerations by Runge and Kutta's method.
BipedMotion moved(Chain& chain, const FiveLinkBiped& biped, BipedMotion m, double slope, double time, int pieces) {
  const double h = time / pieces;
  const auto rate = [&](const BipedMotion& at) { return chain.accelerations(at, slope, biped.torques(at, slope)); };
  const auto ahead = [&](const BipedMotion& by, const std::array<double, 5>& a, double dt) {
    BipedMotion next = m;
    for (std::size_t i = 0; i < 5; ++i) next.angles[i] += dt * by.rates[i], next.rates[i] += dt * a[i];
    return next;
  };
  for (int k = 0; k < pieces; ++k) {
    const auto a1 = rate(m);
    const BipedMotion m2 = ahead(m, a1, h / 2);
    const auto a2 = rate(m2);
    const BipedMotion m3 = ahead(m2, a2, h / 2);
    const auto a3 = rate(m3);
    const BipedMotion m4 = ahead(m3, a3, h);
    const auto a4 = rate(m4);
    for (std::size_t i = 0; i < 5; ++i) {
      m.angles[i] += h / 6 * (m.rates[i] + 2 * m2.rates[i] + 2 * m3.rates[i] + m4.rates[i]);
      m.rates[i] += h / 6 * (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i]);
    }
  }
  return m;
}

double apart(const std::array<double, 5>& one, const std::array<double, 5>& other) {
  double most = 0;
  for (std::size_t i = 0; i < 5; ++i) most = std::max(most, std::abs(one[i] - other[i]));
  return most;
}

}  // namespace

int main(int argc, char** argv) {
  const int states = argc > 1 ? std::atoi(argv[1]) : 40;
  constexpr double degree = 0.017453292519943295;
  const FiveLinkBiped biped;
  Chain standing(biped.options(), true), loose(biped.options(), false);
  const std::vector<double> gait = biped.gait(degree);
  std::mt19937_64 words(1);
  std::normal_distribution<double> normal;
  double phases = 0, strikes = 0, steps = 0;
  int walked = 0;
  for (int n = 0; n < states; ++n) {
    std::vector<double> state = gait;
    for (std::size_t i = 0; i < 9; ++i) state[i] += (i < 4 ? 0.03 : 0.15) * normal(words);
    const double slope = degree * (1 + normal(words));
    const auto before = biped.before_strike(state, slope);
    if (!before) continue;
    ++walked;
    const BipedMotion start = biped.motion(state);
    const BipedMotion held = moved(standing, biped, start, slope, before->time, 600);
    const BipedMotion fine = biped.moved(start, slope, before->time, before->time / 599.5);
    phases = std::max({phases, apart(fine.angles, held.angles), apart(fine.rates, held.rates)});
    steps = std::max({steps, apart(before->angles, held.angles), apart(before->rates, held.rates)});
    auto struck = loose.struck(*before);
    std::ranges::reverse(struck);  // the legs change their names
    strikes = std::max(strikes, apart(biped.strike(*before).rates, struck));
  }
  fmt::print(
      "{} of {} drawn states reach a strike. Largest differences [rad, rad/s]: {:.1e} in a stance phase, {:.1e} in "
      "that of the map's own pieces, {:.1e} after a strike.\n",
      walked, states, phases, steps, strikes);
  return walked > 0 && phases < 1e-9 && steps < 1e-3 && strikes < 1e-9 ? 0 : 1;
}
