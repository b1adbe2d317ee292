"""Sends spoilt bytes to every subscription of a running chain, while the arm moves.

`pam check fuzz-topics --seconds 600` starts the nodes of a simulated rig as processes,
and finds their subscriptions by looking at the ROS graph: a new topic is attacked by itself. Rounds
take turns. In one half only malformed messages are sent, which must not disturb the motion; in the
other half any message of the topic's type is sent as well, and the driver may stop.

No process may end or write a traceback, and the arm must stay within the bounds of its rig file.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

from pam_check.endurance.process_use import use_of
from pam_check.faults.process_campaign import OpenOperator, Operator, start_nodes
from pam_check.faults.rig_bounds import bounds_of
from pam_check.fuzz.messages import Messages
from pam_check.programs import DIAGNOSIS
from pam_demo.chain import Chain, multicast_bus, private_domain
from pam_demo.processes import NodeProcess, ProcessError
from pam_driver.can_bus.bus import open_bus
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_ros.errors import MalformedMessageError
from pam_ros.joint_state_bytes import JointStateReader
from pam_ros.message_decoder import decode
from pam_ros.message_types import message_type
from pam_ros.node_end import end_node
from pam_ros.polled_topic import PolledTopic

PATIENCE: Final = 60.0  # s
MOVE_WITHIN: Final = 6.0  # s
ROUND: Final = 3.0  # s of attack, before the arm is made to move again
BURST: Final = 20  # messages between two looks at the arm
PAUSE: Final = 0.01  # s between two bursts
# Messages that are kept for each topic, and the share of new ones: to draw one takes longer than
# to send it.
KEPT: Final = 100
NEW: Final = 0.1
# What the first asks for really happens in the simulated rig, and by the others the arm is watched.
_MALFORMED_ALONE: Final = ("/inject_fault", "/ground_truth/")
_WORD: Final = 4  # bytes; RTPS aligns what it sends to them
_NOT_ATTACKED: Final = ("/rosout", "/parameter_events")
# The greatest speed and angle are those of the rig file; the driver needs time to stop the arm.
_MARGIN: Final = 1.1


@dataclass(slots=True)
class Attack:
    """What an attack has done.

    Attributes
    ----------
    sent : Counter
        Messages by topic.
    malformed : int
        Those that were certainly malformed.
    rounds, disturbed, still : int
        Rounds with malformed messages alone in which the arm moved at first, those of them at whose
        end it had stopped, and all rounds in which it did not move, because the host was too busy.
    pressure, speed : float
        Largest true pressure [Pa gauge] and speed [rad/s].
    outputs : dict of str to str
        What each process has written.
    memory : dict of str to (float, float)
        Memory of each process before the attack and after it [MiB].
    problems : list of str
        What must not happen, one line each.
    """

    sent: Counter[str] = field(default_factory=Counter)
    malformed: int = 0
    rounds: int = 0
    disturbed: int = 0
    still: int = 0
    pressure: float = 0.0
    speed: float = 0.0
    outputs: dict[str, str] = field(default_factory=dict)
    memory: dict[str, tuple[float, float]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


class TopicAttacker(Node):  # type: ignore[misc]
    """Publishes on every topic that another node hears, and looks at the true state of the arm."""

    def __init__(self, rig: Rig, seed: int, attack: Attack) -> None:
        super().__init__("attacker")
        self._draw = random.Random(seed)
        self._messages = Messages(rig, self._draw)
        self._attack = attack
        self._aimed: dict[str, tuple[Any, Any]] = {}
        self._drawn: dict[tuple[str, bool], list[tuple[bytes, bool]]] = {}
        self.polled_topics = [
            PolledTopic(
                self, JointState, f"ground_truth/{name}", take, read=JointStateReader().read
            )
            for name, take in (
                ("joint_states", self._on_joints),
                ("pressure_states", self._on_pressures),
            )
        ]

    def _on_joints(self, message: Any) -> None:
        speeds = [abs(speed) for speed in message.velocity]
        self._attack.speed = max([self._attack.speed, *speeds])

    def _on_pressures(self, message: Any) -> None:
        self._attack.pressure = max([self._attack.pressure, *message.effort])

    def watch(self) -> None:
        """Take what was published about the true state."""
        for topic in self.polled_topics:
            topic.poll()
        rclpy.spin_once(self, timeout_sec=0.0)

    def look(self) -> int:
        """Find the subscriptions of the other nodes; returns the number of topics."""
        for name, namespace in self.get_node_names_and_namespaces():
            if name == self.get_name():
                continue
            try:
                heard = self.get_subscriber_names_and_types_by_node(name, namespace)
            except RuntimeError:  # the node has just ended
                continue
            for topic, (kind, *_) in heard:
                if topic in self._aimed or topic in _NOT_ATTACKED or "/_" in topic:
                    continue
                found = message_type(kind)
                # latched: nodes that start later hear the last one as well
                qos = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
                self._aimed[topic] = found, self.create_publisher(found, topic, qos)
        return len(self._aimed)

    def send(self, *, malformed_alone: bool) -> None:
        """Publish one message on one topic."""
        topic = self._draw.choice(sorted(self._aimed))
        kind, publisher = self._aimed[topic]
        spared = any(part in topic for part in _MALFORMED_ALONE)
        data, bad = self._data(topic, kind, malformed_alone=malformed_alone or spared)
        try:
            publisher.publish(data)
        except RCLError:  # longer than any message of this type: the middleware does not send it
            return
        self._attack.sent[topic] += 1
        self._attack.malformed += bad

    def _data(self, topic: str, kind: Any, *, malformed_alone: bool) -> tuple[bytes, bool]:
        """The bytes of a message, and whether they are malformed; most were sent before."""
        kept = self._drawn.setdefault((topic, malformed_alone), [])
        if len(kept) >= KEPT and self._draw.random() > NEW:
            return self._draw.choice(kept)
        while True:
            data = self._messages.data(kind)
            bad = is_malformed(data, kind)
            if bad or not malformed_alone:
                break
        if len(kept) >= KEPT:
            kept.pop(self._draw.randrange(KEPT))
        kept.append((data, bad))
        return data, bad


def is_malformed(data: bytes, kind: Any) -> bool:
    """Whether every receiver must refuse it; the transport fills a message up to whole words."""
    try:
        decode(data + bytes(-len(data) % _WORD), kind)
    except MalformedMessageError:
        return True
    return False


def attack_chain(
    rig_path: Path,
    seconds: float,
    seed: int,
    open_operator: OpenOperator,
    others: Mapping[str, tuple[str, Sequence[str]]] | None = None,
    *,
    one_process: bool = False,
) -> Attack:
    """Start a chain, attack it and end it.

    Parameters
    ----------
    rig_path : Path
        Rig file.
    seconds : float
        How long [s].
    seed : int
        Seed of the messages.
    open_operator : callable
        Makes the operator who moves the arm.
    others : mapping, optional
        Further processes: name -> module and arguments.
    one_process : bool, optional
        Driver, model and controller are one program.

    Raises
    ------
    PamError
        If the chain does not start.
    """
    environment, bus, rig = private_domain(), multicast_bus(), load_rig(rig_path)
    attack = Attack()
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    try:
        with (
            open_operator(rig, port, environment) as operator,
            Chain([rig_path], bus, environment) as chain,
        ):
            start_nodes(chain, one_process=one_process)
            for name, (module, arguments) in (others or {}).items():
                chain.processes[name] = NodeProcess(
                    module, environment=environment, arguments=arguments
                )
            attacker = TopicAttacker(rig, seed, attack)
            try:
                _attack(chain, operator, attacker, attack, time.monotonic() + seconds)
            finally:
                end_node(attacker)
    finally:
        port.close()
    _judge(attack, chain, rig)
    return attack


def _attack(
    chain: Chain, operator: Operator, attacker: TopicAttacker, attack: Attack, end: float
) -> None:
    if not operator.run(PATIENCE, operator.ready):
        raise PamError(f"no chain within {PATIENCE:g} s")
    _until(lambda: attacker.look() >= len(chain.processes), chain)
    before = _memory(chain)
    try:
        malformed_alone = True
        while time.monotonic() < end:
            moves = _makes_move(operator)
            attack.still += not moves
            attacker.look()
            until = min(end, time.monotonic() + ROUND)
            while time.monotonic() < until:
                for _ in range(BURST):
                    attacker.send(malformed_alone=malformed_alone)
                attacker.watch()
                operator.run(PAUSE)
                chain.check()
            if malformed_alone and moves:
                attack.rounds += 1
                operator.run(0.1)
                attack.disturbed += not operator.moves_air
            malformed_alone = not malformed_alone
        after = _memory(chain)
        attack.memory = {name: (before[name], after[name]) for name in before}
    except ProcessError as error:
        attack.problems.append(str(error))


def _makes_move(operator: Operator) -> bool:
    """Make the arm move; on a host with other work the driver may refuse, or vent soon."""
    try:
        operator.make_move(MOVE_WITHIN)
    except PamError:
        return False
    return True


def _until(condition: Callable[[], bool], chain: Chain) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        chain.check()
        if time.monotonic() > end:
            raise PamError(f"not all nodes are there within {PATIENCE:g} s")
        time.sleep(0.1)


def _memory(chain: Chain) -> dict[str, float]:
    return {name: use_of(one.pid).memory / 2**20 for name, one in chain.processes.items()}


def _judge(attack: Attack, chain: Chain, rig: Rig) -> None:
    """Add what the outputs and the bounds of the arm say."""
    bounds = bounds_of(rig)
    attack.outputs = chain.outputs
    for name, output in chain.outputs.items():
        lines = output.splitlines()
        if "Traceback" in output:
            attack.problems.append(f"{name}: a traceback:\n{output[output.index('Traceback') :]}")
        if not lines or lines[-1] != "exit code 0":
            attack.problems.append(f"{name}: ended with {lines[-1] if lines else 'nothing'}")
    if attack.pressure > bounds.pressure:
        attack.problems.append(f"{attack.pressure:.0f} Pa, at most {bounds.pressure:.0f} Pa")
    if attack.speed > _MARGIN * bounds.speed:
        attack.problems.append(f"{attack.speed:.2f} rad/s, at most {bounds.speed:.2f} rad/s")


def run(given: Arguments, open_operator: OpenOperator) -> Outcome:
    """Attack and print the figures; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        If the chain does not start.
    """
    rig = chosen_rig(given)
    with tempfile.TemporaryDirectory() as folder:
        bag = str(Path(folder) / "bag")
        others = {
            "monitor": (DIAGNOSIS, ("monitor", "--ros-args", "--params-file", str(rig))),
            "record": (DIAGNOSIS, ("record", "--rig", str(rig), "--out", bag)),
        }
        attack = attack_chain(
            rig, given.seconds, given.seed, open_operator, others, one_process=given.one_process
        )
    for line in figures(attack):
        print(line)
    return Outcome({"sent": attack.sent.total(), "malformed": attack.malformed}, attack.problems)


def figures(attack: Attack) -> list[str]:
    """The figures of an attack, for people."""
    grown = (f"{name} {a:.0f} to {b:.0f}" for name, (a, b) in attack.memory.items())
    written = (f"{name} {text.count(chr(10))}" for name, text in attack.outputs.items())
    sent, topics = attack.sent.total(), len(attack.sent)
    return [
        f"{sent} messages on {topics} topics, {attack.malformed} of them malformed",
        *(f"  {topic}: {count}" for topic, count in sorted(attack.sent.items())),
        f"malformed messages alone: {attack.rounds} rounds with motion, stopped in "
        f"{attack.disturbed}; rounds without motion, of all: {attack.still}",
        f"largest pressure {1e-3 * attack.pressure:.0f} kPa, speed {attack.speed:.2f} rad/s",
        f"lines written: {', '.join(written)}",
        f"memory [MiB]: {', '.join(grown)}",
    ]
