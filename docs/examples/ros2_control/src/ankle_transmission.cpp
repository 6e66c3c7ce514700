#include "ankle_transmission/ankle_transmission.hpp"

#include <cmath>
#include <limits>

#include "pluginlib/class_list_macros.hpp"
#include "transmission_interface/exception.hpp"

namespace ankle_transmission
{
namespace
{

using transmission_interface::ActuatorHandle;
using transmission_interface::JointHandle;

/// A joint of the robot: its name, its first place in the posture, whether cosine and sine stand there, and
/// the step in which it is followed.
struct Place
{
  const char * name;
  std::size_t at;
  bool turns;
  double step;
};

// Of another robot: the rows of q in the comment of its header, and its home posture.
const std::array<Place, JOINT_COUNT> JOINTS{{
  {"pitch", 6, false, 0.1},
  {"roll", 7, false, 0.1},
}};
const std::array<Place, MOTOR_COUNT> MOTORS{{
  {"motor_left", 0, false, 0.1},
  {"motor_right", 3, false, 0.1},
}};
const std::array<double, POSTURE_SIZE> HOME{{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}};

constexpr double WHOLE_TURN = 6.283185307179586;
/// Steps between two calls, and Newton steps in each, after which the result is NaN.
constexpr int MOST_STEPS = 100, NEWTON_STEPS = 12;

/// Positions, velocities and efforts of one side.
template<std::size_t N>
struct Motion
{
  std::array<double, N> position{}, velocity{}, effort{};
};

/// Close the loops where positions of one side are given, step by step from a posture, which it replaces.
/// `map` makes one Newton step and returns the guard. Returns whether it arrived.
template<std::size_t N, class Map>
bool follow(
  std::array<double, POSTURE_SIZE> & posture, const std::array<Place, N> & places,
  const std::array<double, N> & target, const Map & map)
{
  std::array<double, N> from, way, position;
  double largest = 0.0;
  for (std::size_t i = 0; i < N; i++) {
    const double x = posture[places[i].at];
    from[i] = places[i].turns ? std::atan2(posture[places[i].at + 1], x) : x;
    way[i] = target[i] - from[i];
    if (places[i].turns) {
      way[i] = std::remainder(way[i], WHOLE_TURN);
    }
    if (!std::isfinite(way[i])) {
      return false;
    }
    largest = std::fmax(largest, std::fabs(way[i]) / places[i].step);
  }
  if (largest > MOST_STEPS) {
    return false;
  }
  const int steps = largest > 1.0 ? static_cast<int>(std::ceil(largest)) : 1;
  std::array<double, POSTURE_SIZE> near = posture, next;
  for (int s = 1; s <= steps; s++) {
    for (std::size_t i = 0; i < N; i++) {
      position[i] = s == steps ? from[i] + way[i] : from[i] + way[i] * s / steps;
    }
    bool closed = false;
    for (int n = 0; n < NEWTON_STEPS && !closed; n++) {
      closed = map(near.data(), position.data(), next.data()) <= 1.0;
      near = next;
    }
    if (!closed) {
      return false;
    }
  }
  posture = near;
  return true;
}

/// Select the handles of one quantity by the names of the ports, in their order: all or none.
template<class Handle, std::size_t N>
std::vector<Handle> selected(
  const std::vector<Handle> & handles, const std::array<Port, N> & ports, const std::string & quantity)
{
  std::vector<Handle> out;
  std::string missing;
  for (const auto & port : ports) {
    bool found = false;
    for (const auto & handle : handles) {
      if (!found && handle && handle.get_prefix_name() == port.name &&
        handle.get_interface_name() == quantity)
      {
        out.push_back(handle);
        found = true;
      }
    }
    missing = found ? missing : port.name;
  }
  if (!out.empty() && out.size() != N) {
    throw transmission_interface::Exception("the handle '" + missing + "/" + quantity + "' is missing");
  }
  return out;
}

template<class Handle, std::size_t N>
Handles<Handle> all_handles(const std::vector<Handle> & handles, const std::array<Port, N> & ports)
{
  return {
    selected(handles, ports, "position"), selected(handles, ports, "velocity"),
    selected(handles, ports, "effort")};
}

/// Read one side; what has no handle is zero.
template<class Handle, std::size_t N>
Motion<N> read(const Handles<Handle> & handles, const std::array<Port, N> & ports)
{
  Motion<N> out;
  for (std::size_t i = 0; i < N; i++) {
    const Port & port = ports[i];
    out.position[i] = handles.position[i].get_value() * port.scale + port.shift;
    if (!handles.velocity.empty()) {
      out.velocity[i] = handles.velocity[i].get_value() * port.scale;
    }
    if (!handles.effort.empty()) {
      out.effort[i] = handles.effort[i].get_value() / port.scale;
    }
  }
  return out;
}

/// Set a handle. Releases differ in whether this returns if it was done.
template<class Handle>
void set(Handle & handle, double value)
{
  static_cast<void>(handle.set_value(value));
}

/// Write one side: NaN where the loops are open; only quantities that the other side has handles of.
template<class Handle, std::size_t N, class Read>
void write(
  Handles<Handle> & handles, const std::array<Port, N> & ports, const Motion<N> & motion, bool closed,
  const Read & from)
{
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < N; i++) {
    const Port & port = ports[i];
    if (!handles.position.empty()) {
      set(handles.position[i], closed ? (motion.position[i] - port.shift) / port.scale : none);
    }
    if (!handles.velocity.empty() && !from.velocity.empty()) {
      set(handles.velocity[i], closed ? motion.velocity[i] / port.scale : none);
    }
    if (!handles.effort.empty() && !from.effort.empty()) {
      set(handles.effort[i], closed ? motion.effort[i] * port.scale : none);
    }
  }
}

/// Return the ports of the robot's joints, without gears.
template<std::size_t N>
std::array<Port, N> plain_ports(const std::array<Place, N> & places)
{
  std::array<Port, N> out;
  for (std::size_t i = 0; i < N; i++) {
    out[i].name = places[i].name;
  }
  return out;
}

/// Return the port of a joint or an actuator that the URDF states.
Port port_of(const hardware_interface::JointInfo & info)
{
  return {info.name, info.mechanical_reduction, -info.offset * info.mechanical_reduction};
}

Port port_of(const hardware_interface::ActuatorInfo & info)
{
  return {info.name, 1.0 / info.mechanical_reduction, info.offset};
}

/// Return the ports that the URDF states.
template<std::size_t N, class Info>
std::array<Port, N> ports_of(const std::array<Place, N> & places, const std::vector<Info> & infos)
{
  std::array<Port, N> out;
  for (std::size_t i = 0; i < N; i++) {
    bool found = false;
    for (const auto & info : infos) {
      if (!found && (info.role.empty() ? info.name : info.role) == places[i].name) {
        out[i] = port_of(info);
        found = std::isnormal(info.mechanical_reduction);
      }
    }
    if (!found || infos.size() != N) {
      throw transmission_interface::Exception(
        std::string("the transmission needs '") + places[i].name +
        "' by its name or role, with a reduction that is not zero, and no others on its side");
    }
  }
  return out;
}

}  // namespace

Transmission::Transmission()
: joint_ports_(plain_ports(JOINTS)), actuator_ports_(plain_ports(MOTORS)), posture_(HOME), to_joints_(),
  to_motors_()
{
}

Transmission::Transmission(const hardware_interface::TransmissionInfo & info)
: joint_ports_(ports_of(JOINTS, info.joints)), actuator_ports_(ports_of(MOTORS, info.actuators)),
  posture_(HOME), to_joints_(), to_motors_()
{
}

void Transmission::configure(
  const std::vector<JointHandle> & joint_handles, const std::vector<ActuatorHandle> & actuator_handles)
{
  joints_ = all_handles(joint_handles, joint_ports_);
  actuators_ = all_handles(actuator_handles, actuator_ports_);
  if (joints_.position.empty() && actuators_.position.empty()) {
    throw transmission_interface::Exception(
      "no handles of positions: velocities and efforts of closed loops depend on the posture");
  }
}

void Transmission::actuator_to_joint()
{
  if (actuators_.position.empty()) {
    throw transmission_interface::Exception("actuator_to_joint needs the actuators' positions");
  }
  const Motion<MOTOR_COUNT> given = read(actuators_, actuator_ports_);
  Motion<JOINT_COUNT> found;
  std::array<double, JOINT_COUNT * MOTOR_COUNT> rates;
  const bool closed = follow(
    posture_, MOTORS, given.position,
    [&](const double * near, const double * position, double * q) {
      return ankle_map_to_joints(
        near, position, given.velocity.data(), given.effort.data(), q, found.position.data(),
        found.velocity.data(), found.effort.data(), rates.data(), &to_joints_);
    });
  write(joints_, joint_ports_, found, closed, actuators_);
}

void Transmission::joint_to_actuator()
{
  if (joints_.position.empty()) {
    throw transmission_interface::Exception("joint_to_actuator needs the joints' positions");
  }
  const Motion<JOINT_COUNT> given = read(joints_, joint_ports_);
  Motion<MOTOR_COUNT> found;
  std::array<double, JOINT_COUNT * MOTOR_COUNT> rates;
  const bool closed = follow(
    posture_, JOINTS, given.position,
    [&](const double * near, const double * position, double * q) {
      return ankle_map_to_motors(
        near, position, given.velocity.data(), given.effort.data(), q, found.position.data(),
        found.velocity.data(), found.effort.data(), rates.data(), &to_motors_);
    });
  write(actuators_, actuator_ports_, found, closed, joints_);
}

std::shared_ptr<transmission_interface::Transmission> TransmissionLoader::load(
  const hardware_interface::TransmissionInfo & transmission_info)
{
  return std::make_shared<Transmission>(transmission_info);
}

}  // namespace ankle_transmission

PLUGINLIB_EXPORT_CLASS(ankle_transmission::TransmissionLoader, transmission_interface::TransmissionLoader)
