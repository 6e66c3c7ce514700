# ruff: noqa: E501
"""A minimal stand-in for the headers of ros2_control that an exported transmission includes, written for tests.

It has the names, signatures and namespaces of hardware_interface, transmission_interface and pluginlib that
the package uses, and nothing else, as read in the sources of github.com/ros-controls/ros2_control. Handles
differ between releases (`HANDLES`).
"""

_NAMED = """#pragma once
#include <stdexcept>
#include <string>
namespace %s {
class %s {
public:
  %s(const std::string & prefix, const std::string & name, double * value = nullptr)
  : prefix_(prefix), name_(name), value_(value) {}
  virtual ~%s() = default;
  operator bool() const {return value_ != nullptr;}
  const std::string get_name() const {return prefix_ + "/" + name_;}
  const std::string & get_interface_name() const {return name_;}
  const std::string & get_prefix_name() const {return prefix_;}
  %s
protected:
  double & value() const {if (!value_) {throw std::runtime_error("null");} return *value_;}
  std::string prefix_, name_;
  double * value_;
};
}
"""
_HANDLES = """
namespace transmission_interface {
class ActuatorHandle : public %s {public: using %s::%s;};
class JointHandle : public %s {public: using %s::%s;};
}
"""


def _handles(space: str, name: str, values: str) -> str:
    """Return the header of handles whose base class has some name and methods for its value."""
    base = f"{space}::{name}"
    return _NAMED % (space, name, name, name, values) + _HANDLES % (base, base, name, base, base, name)


#: transmission_interface/handle.hpp: "own" since May 2025 (#2223: rolling, jazzy), "hardware" before (commit
#: b22a7a0), "read_write" in humble and iron.
HANDLES = {
    "own": _handles(
        "transmission_interface", "Handle",
        "double get_value() const {return value();} bool set_value(double x) {value() = x; return true;}",
    ),
    "hardware": _handles(
        "hardware_interface", "Handle",
        "[[deprecated]] double get_value() const {return value();}"
        "template<typename T> [[nodiscard]] bool set_value(const T & x) {value() = x; return true;}",
    ),
    "read_write": _handles(
        "hardware_interface", "ReadWriteHandle",
        "double get_value() const {return value();} void set_value(double x) {value() = x;}",
    ),
}  # fmt: skip

HEADERS = {
    "transmission_interface/exception.hpp": """#pragma once
#include <exception>
#include <string>
namespace transmission_interface {
class Exception : public std::exception {
public:
  explicit Exception(const char * message) : message_(message) {}
  explicit Exception(const std::string & message) : message_(message) {}
  const char * what() const noexcept override {return message_.c_str();}
private:
  std::string message_;
};
}
""",
    "transmission_interface/transmission.hpp": """#pragma once
#include <cstddef>
#include <memory>
#include <vector>
#include "transmission_interface/handle.hpp"
namespace transmission_interface {
class Transmission {
public:
  virtual ~Transmission() = default;
  virtual void configure(const std::vector<JointHandle> &, const std::vector<ActuatorHandle> &) = 0;
  virtual void actuator_to_joint() = 0;
  virtual void joint_to_actuator() = 0;
  virtual std::size_t num_actuators() const = 0;
  virtual std::size_t num_joints() const = 0;
};
}
""",
    "hardware_interface/hardware_info.hpp": """#pragma once
#include <string>
#include <unordered_map>
#include <vector>
namespace hardware_interface {
struct JointInfo {
  std::string name;
  std::vector<std::string> state_interfaces, command_interfaces;
  std::string role;
  double mechanical_reduction = 1.0, offset = 0.0;
};
struct ActuatorInfo {
  std::string name;
  std::vector<std::string> state_interfaces, command_interfaces;
  std::string role;
  double mechanical_reduction = 1.0, offset = 0.0;
};
struct TransmissionInfo {
  std::string name, type;
  std::vector<JointInfo> joints;
  std::vector<ActuatorInfo> actuators;
  std::unordered_map<std::string, std::string> parameters;
};
}
""",
    "transmission_interface/transmission_loader.hpp": """#pragma once
#include <memory>
#include "hardware_interface/hardware_info.hpp"
#include "transmission_interface/transmission.hpp"
namespace transmission_interface {
class TransmissionLoader {
public:
  virtual ~TransmissionLoader() = default;
  virtual std::shared_ptr<Transmission> load(const hardware_interface::TransmissionInfo &) = 0;
};
}
""",
    "pluginlib/class_list_macros.hpp": """#pragma once
#include <memory>
#define PLUGINLIB_EXPORT_CLASS(type, base) std::shared_ptr<base> exported() {return std::make_shared<type>();}
""",
}

#: Reads the words of a plan and prints what the transmission makes of it. Words: `actuator NAME ROLE REDUCTION
#: OFFSET`, `joint ...` the same; `handles QUANTITIES`; `configure`; `to_joints` or `to_actuators` with the values of that side,
#: quantity by quantity.
PROGRAM = """#include <cstdio>
#include <iostream>
#include <map>
#include <sstream>
#include "transmission_interface/exception.hpp"
#include "transmission_interface/transmission_loader.hpp"
using namespace transmission_interface;
std::shared_ptr<TransmissionLoader> exported();
int main() {
  hardware_interface::TransmissionInfo info;
  std::vector<std::string> quantities;
  std::map<std::string, double> values[2];
  std::shared_ptr<Transmission> transmission;
  std::string line, word;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    words >> word;
    try {
      if (word == "actuator" || word == "joint") {
        const auto read = [&words](auto one) {
          words >> one.name >> one.role >> one.mechanical_reduction >> one.offset;
          return one;
        };
        if (word == "joint") {info.joints.push_back(read(hardware_interface::JointInfo{}));}
        else {info.actuators.push_back(read(hardware_interface::ActuatorInfo{}));}
      } else if (word == "handles") {
        quantities.clear();
        while (words >> word) {quantities.push_back(word);}
      } else if (word == "configure") {
        transmission = exported()->load(info);
        std::vector<JointHandle> joints;
        std::vector<ActuatorHandle> actuators;
        for (const auto & q : quantities) {
          for (const auto & one : info.joints) {joints.emplace_back(one.name, q, &values[0][one.name + q]);}
          for (const auto & one : info.actuators) {actuators.emplace_back(one.name, q, &values[1][one.name + q]);}
        }
        transmission->configure(joints, actuators);
        std::printf("%zu %zu\\n", transmission->num_joints(), transmission->num_actuators());
      } else {
        const bool forth = word == "to_joints";
        for (const auto & q : quantities) {
          if (forth) {for (const auto & one : info.actuators) {words >> values[1][one.name + q];}}
          else {for (const auto & one : info.joints) {words >> values[0][one.name + q];}}
        }
        if (forth) {transmission->actuator_to_joint();} else {transmission->joint_to_actuator();}
        for (const auto & q : quantities) {
          if (forth) {for (const auto & one : info.joints) {std::printf("%.17g ", values[0][one.name + q]);}}
          else {for (const auto & one : info.actuators) {std::printf("%.17g ", values[1][one.name + q]);}}
        }
        std::printf("\\n");
      }
    } catch (const Exception & error) {
      std::printf("%s\\n", error.what());
    }
  }
}
"""
