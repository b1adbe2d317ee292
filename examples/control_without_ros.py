"""Holds a joint at an angle and a stiffness with the suite's control law, in a loop without ROS.

.venv/bin/python examples/control_without_ros.py [RIG.yaml]

Replace the simulated plant by your own hardware: measure, call `step`, send the commands.
"""

import sys

import pam_control
import pam_model

PERIOD = 0.002  # s


def main(rig_file: str, angle: float = 0.4, stiffness: float = 12.0) -> float:
    """Move to an angle [rad] with a stiffness [N m/rad]; returns the angle reached [rad]."""
    rig = pam_model.load_rig(rig_file)
    joint = rig.joint_names[0]
    settings = pam_control.ControlSettings(period=PERIOD)
    controller = pam_control.Controller(rig, settings)
    plant = pam_model.Plant(pam_model.PlantParameters.from_rig(rig))
    position, agonist, antagonist = plant.step((0.0, 0.0), PERIOD)
    for cycle in range(2000):
        now = cycle * PERIOD
        measured = pam_control.Measurement([position], [agonist, antagonist], now, now)
        output = controller.step(now, measured)
        if output.commands is None:
            raise SystemExit(f"the controller sends nothing: {output.reason}")
        if cycle == 250:  # half a second to fill the muscles
            controller.set_stiffness([stiffness])
            point = pam_control.TrajectoryPoint(1.5, [angle], [0.0], [0.0])
            controller.references.follow([joint], [point], start=None, now=now)
        position, agonist, antagonist = plant.step(output.commands, PERIOD)
    print(f"{joint} at {position:.4f} rad; pressures {agonist:.0f} and {antagonist:.0f} Pa")
    return float(position)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "config/elbow.yaml")
