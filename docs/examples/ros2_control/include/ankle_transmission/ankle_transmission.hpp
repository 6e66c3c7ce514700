// A transmission of ros2_control between the motors and the output joints of closed loops.
#ifndef ANKLE_TRANSMISSION_HPP_
#define ANKLE_TRANSMISSION_HPP_

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "hardware_interface/hardware_info.hpp"
#include "transmission_interface/handle.hpp"
#include "transmission_interface/transmission.hpp"
#include "transmission_interface/transmission_loader.hpp"

#include "ankle.h"

namespace ankle_transmission
{

/// Sizes of the robot, as `ankle.h` lists them.
constexpr std::size_t JOINT_COUNT = 2, MOTOR_COUNT = 2, POSTURE_SIZE = 8;

/// What a joint or motor is called outside, and the gear between it and that handle:
/// position = handle * scale + shift, velocity = handle * scale, effort = handle / scale.
struct Port
{
  std::string name;
  double scale = 1.0;
  double shift = 0.0;
};

/// Handles of one side, in the robot's order; each list is whole or empty.
template<class Handle>
struct Handles
{
  std::vector<Handle> position, velocity, effort;
};

/// Relates the joints pitch, roll to the motors motor_left, motor_right.
///
/// Velocities and efforts depend on the posture: handles of the positions on the side that is read are needed
/// for them, also where commands are efforts alone (give the measured positions then). Positions are followed
/// from the last ones, at first from home. Where the loops cannot be closed, near singular postures and where
/// a number is not finite, every result is NaN, and the last posture stays. No memory is allocated after
/// `configure`.
class Transmission : public transmission_interface::Transmission
{
public:
  /// Joints and motors with the names that the robot's file gives them, without gears.
  Transmission();

  /// Joints and actuators of the URDF, by `role` the names in the robot's file. As in ros2_control's own
  /// transmissions, value in the robot = actuator / reduction + offset, joint = that / reduction + offset.
  explicit Transmission(const hardware_interface::TransmissionInfo & info);

  void configure(
    const std::vector<transmission_interface::JointHandle> & joint_handles,
    const std::vector<transmission_interface::ActuatorHandle> & actuator_handles) override;

  void actuator_to_joint() override;
  void joint_to_actuator() override;

  std::size_t num_actuators() const override {return MOTOR_COUNT;}
  std::size_t num_joints() const override {return JOINT_COUNT;}

private:
  std::array<Port, JOINT_COUNT> joint_ports_;
  std::array<Port, MOTOR_COUNT> actuator_ports_;
  Handles<transmission_interface::JointHandle> joints_;
  Handles<transmission_interface::ActuatorHandle> actuators_;
  std::array<double, POSTURE_SIZE> posture_;
  ankle_map_to_joints_work to_joints_;
  ankle_map_to_motors_work to_motors_;
};

class TransmissionLoader : public transmission_interface::TransmissionLoader
{
public:
  std::shared_ptr<transmission_interface::Transmission> load(
    const hardware_interface::TransmissionInfo & transmission_info) override;
};

}  // namespace ankle_transmission

#endif  // ANKLE_TRANSMISSION_HPP_
