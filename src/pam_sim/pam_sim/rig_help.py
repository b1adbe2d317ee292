"""The parameters and topics of the simulated rig's node, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_model.plant.default_step import DEFAULT_STEP
from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.program_name import PROGRAM
from pam_sim.boards.protocol import BoardSettings
from pam_sim.boards.sensors import SensorQuality

_Q, _B = SensorQuality(), BoardSettings()
PARAMETERS = (
    Parameter("bus.interface", "socketcan", "-", 0, 0, "python-can's name of the interface"),
    Parameter("bus.channel", "can0", "-", 0, 0, "network interface, multicast group or device"),
    Parameter("bus.port", 43113, "-", 1024, 65535, "UDP port, used by udp_multicast only"),
    Parameter("bus.options", "", "-", 0, 0, "further options of the interface: name=value, ..."),
    Parameter("bus.dbc", "", "-", 0, 0, "DBC file of the boards; empty: the one of the driver"),
    Parameter(
        "firmware",
        "",
        "-",
        0,
        0,
        "host build of firmware/, which then runs as each pam_board; empty: boards in Python",
    ),
    Parameter(
        "true_rig", "", "-", 0, 0, "rig file with the true parameters of the plant; empty: the rig"
    ),
    Parameter(
        "hidden_effects", "", "-", 0, 0, "effects in the plant: [name.]effect.parameter=value ..."
    ),
    Parameter("faults", "", "-", 0, 0, "faults to inject: seconds name value=number; seconds name"),
    Parameter("rate", 1000.0, "Hz", 10.0, 10000.0, "turns of the simulation's thread per second"),
    Parameter(
        "realtime_priority",
        0,
        "-",
        0,
        99,
        "real-time priority (SCHED_FIFO) of that thread, where the system permits it; 0: none",
    ),
    Parameter("step", DEFAULT_STEP, "s", 1e-6, 2e-3, "longest integration step of the plant"),
    Parameter(
        "ground_truth_rate", 100.0, "Hz", 0.1, 1000.0, "how often the true state is published"
    ),
    Parameter(
        "measurement_rate",
        _B.measurement_rate,
        "Hz",
        1.0,
        10000.0,
        "rate of the boards' measurements",
    ),
    Parameter("watchdog", 0.0, "s", 0.0, 10.0, "watchdog time of the boards; 0: from the DBC"),
    Parameter(
        "pressure_noise", _Q.pressure_noise, "Pa", 0.0, 1e5, "standard deviation of the noise"
    ),
    Parameter(
        "position_noise", _Q.position_noise, "rad", 0.0, 0.1, "standard deviation of the noise"
    ),
    Parameter("pressure_quantum", _Q.pressure_quantum, "Pa", 0.0, 1e5, "converter's resolution"),
    Parameter("position_quantum", _Q.position_quantum, "rad", 0.0, 0.1, "encoder's resolution"),
    Parameter("seed", 0, "-", 0, 2**31 - 1, "seed of the noise"),
)
OPTIONS = frozenset(one.name for one in PARAMETERS if one.default != "") - {
    "bus.interface", "bus.channel", "bus.port", "ground_truth_rate",
} | {"faults"}  # fmt: skip
"""Parameters that are also options of `pam sim rig`."""

HELP = NodeHelp(
    program=f"{PROGRAM} sim node",
    purpose="Simulates a rig and its valve boards in real time on a CAN bus. The boards send their "
    "measurements over the bus, and the node publishes the true state on topics.",
    parameters=PARAMETERS,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml -p bus.interface:=udp_multicast "
    "-p bus.channel:=239.74.163.2",
    subscribes=(
        Endpoint("~/inject_fault", "std_msgs/String", "a fault to inject, see docs/simulation.md"),
    ),
    publishes=(
        Endpoint(
            "ground_truth/joint_states",
            "sensor_msgs/JointState",
            "position [rad], velocity [rad/s], effort: torque [N m]",
        ),
        Endpoint(
            "ground_truth/muscle_states",
            "sensor_msgs/JointState",
            "position: length [m], velocity [m/s], effort: force [N]",
        ),
        Endpoint(
            "ground_truth/pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"
        ),
        Endpoint("ground_truth/supply_pressure", "sensor_msgs/FluidPressure", "absolute [Pa]"),
        Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "health, once a second"),
    ),
    serves=(Endpoint("~/mend_faults", "std_srvs/Trigger", "ends every fault"),),
)
