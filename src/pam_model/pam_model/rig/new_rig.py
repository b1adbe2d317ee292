"""Writes a commented rig file from a handful of numbers that a builder knows.

All joints are equal: two equal muscles on a pulley, both valves and the encoder on one board. The
user changes the file afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

from pam_model.errors import PamError
from pam_model.rig.from_datasheet import BraidFromDatasheet
from pam_ros.program_name import PROGRAM

STROKE_SHARE = 0.9
"""Largest part of a muscle's contraction that the range of a joint may use."""


@dataclass(frozen=True, slots=True)
class NewRig:
    """The numbers of a new rig."""

    joints: tuple[str, ...]  # names of the joints
    # CAN interfaces; the boards are spread over them evenly. The only one of a robot is not
    # written: the parameters of the nodes name it.
    buses: tuple[str, ...]
    braid: BraidFromDatasheet  # every muscle
    pulley_radius: float  # [m]
    largest_angle: float  # the joints turn from minus this angle to this angle [rad]
    inertia: float  # [kg m^2]
    gravity_torque: float  # torque of gravity with the joint at 90 degrees from hanging [N m]
    viscous_friction: float  # [N m s/rad]
    # max_pressure, supply_pressure: largest pressure of the muscles, and that before the valves [Pa
    # gauge]
    max_pressure: float
    supply_pressure: float
    valve: str  # "flow" or "pressure_regulator"
    sonic_conductance: float  # ISO 6358 C of the valves [m^3/(s Pa)]

    @property
    def neutral_length(self) -> float:
        """Length of the muscles at joint position 0, so that the range ends at rest length [m]."""
        return self.braid.rest_length - self.pulley_radius * self.largest_angle

    def check(self) -> None:
        """Refuse a range that the muscles cannot move.

        Raises
        ------
        PamError
            If the stroke is longer than the muscles contract, the supply is below the muscles'
            largest pressure, or a bus would be without a board.
        """
        stroke = 2.0 * self.pulley_radius * self.largest_angle
        most = STROKE_SHARE * self.braid.largest_contraction * self.braid.rest_length
        if stroke > most:
            raise PamError(
                f"pulley_radius = {self.pulley_radius:g} m: the range of +-{self.largest_angle:g} "
                f"rad takes {1e3 * stroke:.3g} mm of stroke, expected {1e3 * most:.3g} mm at most "
                f"({STROKE_SHARE:.0%} of the muscle's contraction); use a pulley of "
                f"{0.5 * most / self.largest_angle:.3g} m or less, or longer muscles"
            )
        if len(self.buses) > len(self.joints):
            raise PamError(
                f"buses = {', '.join(self.buses)}: a bus for each board at most, and there are "
                f"{len(self.joints)}"
            )
        if self.supply_pressure < self.max_pressure:
            raise PamError(
                f"supply_pressure = {self.supply_pressure:g} Pa gauge is below max_pressure = "
                f"{self.max_pressure:g} Pa gauge"
            )

    def text(self) -> str:
        """The rig file.

        Raises
        ------
        PamError
            As `check`.
        """
        self.check()
        lines = [
            "# Change every number to that of your robot; docs/rig_file.md explains the keys.",
            "# Units: SI; pressures gauge unless named absolute.",
            "# Numbers that you did not state are usual values, not those of your robot. Delete",
            "# the line of an inertia, friction, volume or valve number that you do not know:",
            f"# {PROGRAM} demo commission and {PROGRAM} gap calibrate find them.",
            f"# Check it with: {PROGRAM} driver check-rig THIS_FILE",
            "/**:",
            "  ros__parameters:",
            "    gas:",
            "      temperature: 293.15           # K, gas and ambient",
            "      ambient_pressure: 101325.0    # Pa absolute",
            "      polytropic_exponent: 1.0      # -, 1.0 isothermal .. 1.4 adiabatic",
            f"    supply_pressure: {101325.0 + self.supply_pressure:.1f}       # Pa absolute",
            "    parameter_tolerance: 0.05       # -, how far the numbers below may be wrong",
            *self._buses(),
            f"    joints: [{', '.join(self.joints)}]",
        ]
        for number, joint in enumerate(self.joints):
            board = f"{joint}_board" if len(self.buses) > 1 else str(number)
            lines += self._joint(joint, board)
            for channel, muscle in enumerate(self.muscles(joint)):
                lines += self._muscle(muscle, board, channel)
        return "\n".join(lines) + "\n"

    @staticmethod
    def muscles(joint: str) -> tuple[str, str]:
        """Names of a joint's muscles; the first turns it in the positive direction."""
        return f"{joint}_flexor", f"{joint}_extensor"

    def _buses(self) -> list[str]:
        """The sections of buses and boards; none for a robot with one bus."""
        if len(self.buses) < 2:
            return []
        place = [k * len(self.buses) // len(self.joints) for k in range(len(self.joints))]
        return [
            "    buses:",
            *(
                f"      {bus}: {{interface: socketcan, channel: {bus}, bitrate: 1000000}}"
                for bus in self.buses
            ),
            "    boards:",
            *(
                f"      {joint}_board: {{kind: pam_board, number: {place[:k].count(place[k])}, "
                f"bus: {self.buses[place[k]]}}}"
                for k, joint in enumerate(self.joints)
            ),
        ]

    def _joint(self, joint: str, board: str) -> list[str]:
        first, second = self.muscles(joint)
        angle = self.largest_angle
        return [
            f"    {joint}:",
            f"      muscles: [{first}, {second}]   # the first gives positive torque",
            f"      pulley_radius: {self.pulley_radius:<14.6g} # m",
            f"      inertia: {self.inertia:<20.6g} # kg m^2, with everything that it carries",
            f"      viscous_friction: {self.viscous_friction:<11.6g} # N m s/rad",
            f"      gravity_torque: {self.gravity_torque:<13.6g} # N m, at 90 degrees from hanging",
            "      gravity_angle: 0.0            # rad, position at which the joint hangs down",
            f"      position_limits: [{-angle:.6g}, {angle:.6g}]   # rad",
            f"      encoder: {{board: {board}, channel: 0}}",
        ]

    def _muscle(self, muscle: str, board: str, channel: int) -> list[str]:
        return [
            *self.braid.section(muscle).splitlines(),
            f"      neutral_length: {self.neutral_length:<13.6g} # m, at joint position 0",
            "      dead_volume: 2.0e-05          # m^3, fittings and tube; a usual value",
            f"      max_pressure: {self.max_pressure:<15.1f} # Pa gauge, the driver vents above it",
            f"      board: {board}",
            f"      channel: {channel}",
            "      valve:",
            f"        kind: {self.valve}",
            f"        sonic_conductance: {self.sonic_conductance:.2e} # m^3/(s Pa), fully open",
            "        critical_ratio: 0.3         # -, ISO 6358 b; a usual value",
            "        time_constant: 0.005        # s; a usual value",
        ]
