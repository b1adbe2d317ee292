"""The controller's diagnostics: loop, commands, and one status for each joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pam_control.command_intake import CommandIntake
from pam_control.controller import Controller
from pam_control.driver_follower import DriverFollower
from pam_control.rows.telemetry_rows import Z_ERROR, Z_TORQUE_CUT, Z_TUBES
from pam_control.setting_changes import SettingChanges
from pam_ros import diagnostics as health
from pam_ros.periodic import Loop

REJECTION_SHOWN = 5.0  # s


@dataclass(slots=True)
class JointCounts:
    """Counts of one joint since the last diagnostics."""

    cycles: int = 0
    clipped: int = 0
    limited: int = 0
    squares: float = 0.0
    largest: float = 0.0


class ControllerHealth:
    """Counts what happens in the cycles, and shows it.

    Parameters
    ----------
    name : str
        Of the node.
    driver : DriverFollower
        What the driver has said.
    """

    def __init__(
        self,
        name: str,
        controller: Controller,
        intake: CommandIntake,
        changes: SettingChanges,
        driver: DriverFollower,
    ) -> None:
        self._name = name
        self._controller = controller
        self._intake = intake
        self._changes = changes
        self._counts = [JointCounts() for _ in controller.channels]
        self._oldest = [0.0, 0.0]
        self._driver = driver

    def count(self, ages: Sequence[float]) -> None:
        """Count a control cycle; ages [s] of the joint states and of the pressure states in it."""
        self._oldest = [max(pair) for pair in zip(self._oldest, ages, strict=True)]
        references = self._controller.references
        names = self._controller.rig.joint_names
        rows = self._controller.telemetry_rows
        for counts, name, row in zip(self._counts, names, rows, strict=True):
            off = row[Z_ERROR]
            counts.cycles += 1
            counts.clipped += any(row[Z_TORQUE_CUT:Z_TUBES])
            counts.limited += references.held_back(name)
            counts.squares += off * off
            counts.largest = max(counts.largest, abs(off))

    def statuses(
        self, now: float, reason: str, law: str, loop: Loop, ages: Sequence[float]
    ) -> list[Any]:
        """All statuses since the last call.

        Parameters
        ----------
        now : float
            Present time [s].
        reason : str
            Why no commands are sent; empty if they are.
        law : str
            The control law.
        loop : Loop
            The control loop.
        ages : sequence of float
            Present ages of joint states and pressure states [s].
        """
        statuses = [self._loop(reason, law, loop, ages), self._commands(now)]
        statuses += [self._joint(index) for index in range(len(self._counts))]
        self._oldest = [0.0, 0.0]
        return statuses

    def _loop(self, reason: str, law: str, loop: Loop, ages: Sequence[float]) -> Any:
        controller = self._controller
        values = health.loop_values(loop.statistics)
        for topic, age, oldest in zip(
            ("joint_states", "pressure_states"), ages, self._oldest, strict=True
        ):
            values[f"{topic} age [ms]"] = 1e3 * age
            values[f"{topic} largest age in a cycle [ms]"] = 1e3 * oldest
        values["driver"] = self._driver.said
        values["law"] = law
        values["feedforward"] = controller.settings.feedforward
        values["pressure loop gain [1/s]"] = controller.settings.pressure_gain
        guard = controller.guard
        values["soft gains because"] = guard.softened or "not used"
        values["swings"] = guard.swings or "none"
        values["gains lowered because of swings, times"] = guard.lowered
        values["stopped because"] = guard.stopped or "not stopped"
        values["lowering"] = controller.lowering.phase.value
        changes = self._changes
        values["being designed"] = changes.designing or "nothing"
        values["last change refused"] = changes.refusal or "none"
        level, text = health.OK, "controlling"
        if reason:
            level, text = health.STALE, f"sends no commands: {reason}"
        elif guard.softened:
            level, text = health.WARN, f"controlling with soft gains: {guard.softened}"
        elif guard.swings:
            level, text = health.WARN, f"controlling; {guard.swings}"
        elif changes.refusal:
            level, text = health.WARN, f"controlling; {changes.refusal}"
        elif changes.designing:
            text = f"controlling; being designed: {changes.designing}"
        return health.diagnostic_status(f"{self._name}: loop", level, text, values)

    def _commands(self, now: float) -> Any:
        intake = self._intake
        shown = [
            text
            for text, when in (intake.last_rejection, intake.last_note)
            if now - when < REJECTION_SHOWN
        ]
        return health.diagnostic_status(
            f"{self._name}: commands",
            health.WARN if shown else health.OK,
            "; ".join(shown) or "no message rejected lately",
            {
                "rejected messages": intake.rejected,
                "last rejection": intake.last_rejection[0],
                "trajectories slowed down": intake.slowed,
                "last trajectory slowed down": intake.last_note[0],
            },
        )

    def _joint(self, index: int) -> Any:
        controller = self._controller
        channel, counts = controller.channels[index], self._counts[index]
        self._counts[index] = JointCounts()
        setup, telemetry, name = channel.setup, channel.telemetry, channel.models.name
        worst, gains = setup.margins[0], channel.gains
        cycles = max(counts.cycles, 1)
        low, high = channel.stiffness_range
        values = {
            "following": controller.references.following(name),
            "rms error [rad]": math.sqrt(counts.squares / cycles),
            "largest error [rad]": counts.largest,
            "clipped share [-]": counts.clipped / cycles,
            "clipped last": ", ".join(telemetry.clipped) or "nothing",
            "reference held back share [-]": counts.limited / cycles,
            "stiffness asked [N m/rad]": controller.stiffness_commands[index],
            "stiffness now [N m/rad]": telemetry.law.true_stiffness,
            "least stiffness [N m/rad]": low,
            "greatest stiffness [N m/rad]": high,
            "least share of the pressure loops' gain [-]": min(
                loop.gain_factor for loop in channel.loops
            ),
            "phase margin [rad]": worst.phase_margin,
            "gain margin [-]": worst.gain_margin,
            "modulus margin [-]": worst.modulus_margin,
            "proportional gain [N m/rad]": gains.proportional,
            "integral gain [N m/(rad s)]": gains.integral,
            "derivative gain [N m s/rad]": gains.derivative,
        }
        if setup.adapts:
            values |= setup.law.report(channel.models, channel.law_state, telemetry)
            values["learnt delay of the position [s]"] = channel.late_position
            values["learnt delay of the pressures [s]"] = channel.late_pressures
            values["learnt delay of the commands [s]"] = max(channel.late_commands)
        session = controller.prepared.learning
        if session is not None:
            values["learning"] = session.report(name)
            values["learning file"] = session.problem or "no problem"
        texts = [session.problem] if session is not None and session.problem else []
        if counts.clipped > 0.5 * cycles and telemetry.clipped:
            texts.append(f"cut by {', '.join(telemetry.clipped)}")
        if counts.limited:
            joint = channel.models.joint
            texts.append(
                f"reference held back in {counts.limited / cycles:.0%} of the cycles (max_velocity "
                f"{joint.max_velocity:g} rad/s, max_acceleration {joint.max_acceleration:g} "
                "rad/s^2, or what the valves can drive)"
            )
        return health.diagnostic_status(
            f"{self._name}: {name}",
            health.WARN if texts else health.OK,
            "; ".join(texts) or "in reach",
            values,
        )
