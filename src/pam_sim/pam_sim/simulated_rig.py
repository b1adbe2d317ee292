"""All joints and boards of a rig in one object that receives and sends frames. No bus, no clock.

The rig file (names, wiring, full scales, limits) and the true plant (the same file with effects, or
another file) may differ; the diagnosis has to find such a difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from zlib import crc32

from pam_driver.boards.protocol import Address, Frame, KindOptions, WiredBoard
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_model.bounds import within
from pam_model.effects import EFFECTS
from pam_model.errors import PamError, RigError
from pam_model.names import unknown
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import vented_state
from pam_model.rig import Rig
from pam_ros.foreign_text import shown
from pam_sim.boards.protocol import BoardSettings, SimulatedBoard, TwinKind
from pam_sim.boards.register import twin_called
from pam_sim.boards.sensors import BoardSensors, SensorQuality
from pam_sim.faults.rig_faults import RigFaults

FULLEST_CATCH_UP = 1.0  # s; after a longer pause of the host, the rest of the time is dropped


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """The true state, in the rig's order."""

    # positions, velocities, torques: by joint [rad], [rad/s], [N m]
    positions: list[float]
    velocities: list[float]
    torques: list[float]
    # pressures, lengths, speeds, forces: by muscle [Pa gauge], [m], [m/s], [N]
    pressures: list[float]
    lengths: list[float]
    speeds: list[float]
    forces: list[float]
    supply_pressure: float  # supply pressure at the valves [Pa absolute]


class SimulatedRig:
    """A simulated rig that receives and sends frames.

    Parameters
    ----------
    rig : Rig
        The rig file that driver and controller read as well.
    truth : Rig, optional
        The true rig; by default the same, with the effects that its file names.
    effects : mapping of str to float, optional
        Further effects, see `apply_effects`.
    options : mapping of str to str, optional
        Options for the kinds of board in addition to the rig file, such as `dbc`.
    board : BoardSettings, optional
        Rates and watchdog; limits come from the rig.
    quality : SensorQuality, optional
        Noise and resolution of the sensors.
    rate : float, optional
        Rate at which plant and boards are updated [Hz].
    step : float, optional
        Longest RK4 step [s].
    seed : int, optional
        Seed of the noise.
    now : float, optional
        Time of power-up [s].

    Attributes
    ----------
    faults : RigFaults
        The present faults; none at first.
    wired : mapping of address to WiredBoard
        The muscles and joints of each board.
    wiring : RigWiring
        The boards with their buses.

    Raises
    ------
    PamError
        If the rig cannot be simulated on boards; the text says why.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        truth: Rig | None = None,
        effects: Mapping[str, float] | None = None,
        options: KindOptions | None = None,
        board: BoardSettings | None = None,
        quality: SensorQuality | None = None,
        rate: float = 1000.0,
        step: float = DEFAULT_STEP,
        seed: int = 0,
        now: float = 0.0,
    ) -> None:
        self.faults = RigFaults()
        within("rate", rate, 10.0, 10_000.0, "Hz")
        within("step", step, high=0.002, unit="s", above=0.0)
        _check_same(rig, truth)
        self.rig = rig
        wiring = RigWiring(rig, options)
        self.wired: Mapping[Address, WiredBoard] = wiring.boards
        self.wiring = wiring
        self.parameters = apply_effects(rig, truth or rig, effects or {})
        self._plant = RobotPlant(self.parameters, step, [vented_state(p) for p in self.parameters])
        self._plants = self._plant.joints
        self._period = 1.0 / rate
        self._now = now
        self.lost_time = 0.0
        self._boards: dict[Address, SimulatedBoard] = {}
        self._sensors: dict[Address, BoardSensors] = {}
        twins: dict[str, TwinKind] = {}
        for address, wired in self.wired.items():
            kind = kind_name(wired)
            if kind not in twins:
                twins[kind] = twin_called(kind)(options or {})
            self._boards[address] = twins[kind].make(wired, board or BoardSettings(), now)
            self._sensors[address] = BoardSensors(
                quality or SensorQuality(), (seed, _seed_of(address))
            )
        # By joint: its two muscles' places in the rig's order.
        order = {name: index for index, name in enumerate(rig.muscle_names)}
        self._muscles_of = [[order[name] for name in joint.muscles] for joint in rig.joints]
        self._positions = [plant.output["position"] for plant in self._plants]
        self._pressures = [0.0] * len(rig.muscles)

    @property
    def boards(self) -> Mapping[Address, SimulatedBoard]:
        """The boards, by the addresses that the rig file uses."""
        return self._boards

    def on_frame(
        self, frame_id: int, data: bytes, now: float, age: float = 0.0, bus: str | None = None
    ) -> None:
        """Pass a frame to every board of a bus; a board processes the frames addressed to it.

        The plant moves by the previous commands until the frame arrived, to the nearest step.

        Parameters
        ----------
        frame_id : int
        data : bytes
        now : float
            Time [s], not before that of the last call.
        age : float
            How long ago the frame arrived [s].
        bus : str, optional
            The bus that brought it; by default all of them.
        """
        whole = self._whole_steps(now)
        self._go_on(min(round((now - age - self._now) / self._period), whole))
        faults = self.faults
        for address, board in self._boards.items():
            if address in faults.frozen or address in faults.unplugged:
                continue
            if bus in {None, self.wired[address].bus}:
                board.on_frame(frame_id, data, now)

    def begin(self, now: float) -> None:
        """Set the time to `now` [s] with one step, so that steps end at the caller's turns.

        The very first step loads the compiled plant, which takes as long as hundreds of steps.
        """
        self._now = now - self._period
        self._go_on(1)

    def restart_board(self, address: Address, now: float) -> None:
        """Restart a board at `now` [s], as after a brown-out."""
        self._boards[address] = self._boards[address].restarted(now)

    def open_leak(self, muscle: int, conductance: float) -> None:
        """Let a muscle leak through the conductance C [m^3/(s Pa)]; 0 closes the leak."""
        for joint, muscles in enumerate(self._muscles_of):
            if muscle in muscles:
                side = SIDES[muscles.index(muscle)]
                self._plants[joint].change({f"{side}.leakage.conductance": conductance})

    def set_brake(self, torque: float) -> None:
        """Let brakes add a torque [N m] to the friction of the joints; 0 releases them."""
        name = "coulomb_friction.torque"
        for plant, without in zip(self._plants, self.parameters, strict=True):
            plant.change({name: without[name] + torque})

    def set_supply_pressure(self, pressure: float) -> None:
        """Set the supply pressure [Pa absolute]."""
        for plant in self._plants:
            plant.change({"supply_pressure": pressure})

    def advance(self, now: float) -> list[Frame]:
        """As `advance_buses`, with the frames of all buses in one list."""
        return [frame for _, frame in self.advance_buses(now)]

    def advance_buses(self, now: float) -> list[tuple[str, Frame]]:
        """Advance plant and boards to `now` [s]; return the frames that the boards send, by bus.

        The plant is at the nearest whole step. If the caller is late, the missing steps are
        computed at once. If it is late by more than a second, the rest of the time is dropped and
        added to `lost_time`.
        """
        self._go_on(self._whole_steps(now))
        for address in self.faults.reset_by_watchdog(now):
            self.restart_board(address, now)
        frames: list[tuple[str, Frame]] = []
        for address, board in self._boards.items():
            if address in self.faults.frozen:
                continue
            sensors, wired = self._sensors[address], self.wired[address]
            pressures = [sensors.pressure(self._pressures[w.place]) for w in wired.pressures]
            angles = [sensors.position(self._positions[w.place]) for w in wired.angles]
            if self.faults.sensors or self.faults.swapped:
                pressures, angles = self.faults.readings(address, pressures, angles, now)
            polled = board.poll(now, pressures, angles, self._supply(wired))
            if address not in self.faults.unplugged:
                frames += [(wired.bus, frame) for frame in polled]
        return frames

    def ground_truth(self) -> GroundTruth:
        """The true state, without sensor errors."""
        count = len(self.rig.muscles)
        supply = self._plant.reservoir_pressure
        zeros = [[0.0] * count for _ in range(4)]
        result = GroundTruth([], [], [], zeros[0], zeros[1], zeros[2], zeros[3], supply)
        for joint, plant in enumerate(self._plants):
            output = plant.output
            result.positions.append(output["position"])
            result.velocities.append(output["velocity"])
            result.torques.append(output["torque"])
            places = self._muscles_of[joint]
            for side, index, speed in zip(SIDES, places, plant.path_speeds, strict=True):
                result.pressures[index] = output[f"{side}.pressure"]
                result.lengths[index] = output[f"{side}.length"]
                result.forces[index] = output[f"{side}.force"]
                result.speeds[index] = speed
        return result

    def _whole_steps(self, now: float) -> int:
        behind = now - self._now
        if behind > FULLEST_CATCH_UP:
            self.lost_time += behind - FULLEST_CATCH_UP
            self._now = now - FULLEST_CATCH_UP
        return round((now - self._now) / self._period)

    def _go_on(self, steps: int) -> None:
        if steps > 0:
            self._now += steps * self._period
            self._move(steps)

    def _move(self, steps: int) -> None:
        commands = [0.0] * len(self.rig.muscles)
        for address, board in self._boards.items():
            valves = board.valve_commands
            if self.faults.move_valves:
                valves = self.faults.spools(address, valves, board.valves)
            for wire, command in zip(self.wired[address].valves, valves, strict=True):
                commands[wire.place] = command
        pairs = [[commands[place] for place in muscles] for muscles in self._muscles_of]
        for _ in range(steps):
            readings = self._plant.step(pairs, self._period)
        for joint, (position, *pressures) in enumerate(readings):
            self._positions[joint] = position
            for place, pressure in zip(self._muscles_of[joint], pressures, strict=True):
                self._pressures[place] = pressure

    def _supply(self, wired: WiredBoard) -> float:
        return self._plant.reservoir_pressure if wired.valves else self.rig.supply_pressure


def apply_effects(rig: Rig, truth: Rig, effects: Mapping[str, float]) -> list[PlantParameters]:
    """The plants of a rig's joints: the parameters of `truth`, with parameters of effects set.

    Parameters
    ----------
    rig : Rig
        The rig whose names `effects` may use.
    truth : Rig
        The true rig.
    effects : mapping of str to float
        `<effect>.<parameter>` for all joints or muscles, or `<name>.<effect>.<parameter>` for one
        joint or muscle.

    Raises
    ------
    PamError
        For an unknown name or a value outside the bounds of its parameter.
    """
    plants = [PlantParameters.from_rig(truth, joint) for joint in range(len(truth.joints))]
    for name, value in effects.items():
        parts = name.split(".")
        owner, key = (parts[0], parts[1:]) if len(parts) == 3 else ("", parts)
        effect = EFFECTS.get(key[0])
        if len(key) != 2:
            raise PamError(
                f"effect {shown(name)}: expected <effect>.<parameter> or "
                "<name>.<effect>.<parameter>"
            )
        if effect is None:
            raise PamError(f"effect {shown(name)}: {unknown('effect', key[0], EFFECTS)}")
        if key[1] not in effect.parameters:
            raise PamError(
                f"effect {shown(name)}: {unknown('parameter', key[1], effect.parameters)}"
            )
        entry = effect.parameters[key[1]]
        if not entry.low <= value <= entry.high:
            raise PamError(
                f"effect {name} = {value:g} {entry.unit} is outside "
                f"[{entry.low:g}, {entry.high:g}] {entry.unit}"
            )
        if owner and effect.scope == "rig":
            raise PamError(
                f"effect {name}: {effect.name} is an effect of the whole rig; expected "
                f"{key[0]}.{key[1]} without {owner}"
            )
        hit = False
        for index, joint in enumerate(rig.joints):
            plain = f"{key[0]}.{key[1]}"
            if not owner or owner == joint.name:
                changes = {plain: value}
            elif effect.scope == "muscle" and owner in joint.muscles:
                changes = {f"{SIDES[joint.muscles.index(owner)]}.{plain}": value}
            else:
                continue
            plants[index] = plants[index].replaced(changes)
            hit = True
        if not hit:
            kind = "joint or muscle" if effect.scope == "muscle" else "joint"
            known = [*rig.joint_names, *(rig.muscle_names if effect.scope == "muscle" else ())]
            raise PamError(f"effect {name}: {unknown(kind, owner, known)}")
    return plants


def _check_same(rig: Rig, truth: Rig | None) -> None:
    if truth is not None:
        mine = [(joint.name, joint.muscles) for joint in rig.joints]
        if mine != [(joint.name, joint.muscles) for joint in truth.joints]:
            raise RigError("the true rig must have the joints and muscles of the rig file")
    loose = [m.name for m in rig.muscles if rig.joint_of(m.name) is None]
    if loose or not rig.joints:
        raise RigError(
            f"only muscles at a joint can be simulated on a bus: {', '.join(loose) or 'no joint'}"
        )


def _seed_of(address: Address) -> int:
    """A seed for the noise of one board."""
    return address if isinstance(address, int) else crc32(address.encode())
