"""Which board and channel each muscle and joint of a rig is wired to."""

from __future__ import annotations

from pam_driver.boards.pam_board.codec import CHANNELS
from pam_model.errors import RigError
from pam_model.rig import Rig


class RigWiring:
    """The rig's wiring, checked against what the boards have.

    Attributes
    ----------
    muscles : tuple of (int, int)
        Board and channel by muscle, in the rig's order.
    joints : tuple of int
        Board of the encoder by joint, in the rig's order.
    boards : dict
        By board: pairs of channel and index of the muscle.
    joint_of_board : dict
        By board: index of the joint whose angle it measures.

    Raises
    ------
    RigError
        With one line for everything that is not wired, out of range or wired twice.
    """

    def __init__(self, rig: Rig, board_count: int) -> None:
        problems = []
        muscles: list[tuple[int, int]] = []
        self.boards: dict[int, list[tuple[int, int]]] = {}
        self.joint_of_board: dict[int, int] = {}
        taken: dict[tuple[int, int], str] = {}
        for index, muscle in enumerate(rig.muscles):
            board, channel = muscle.board, muscle.channel
            if board is None or channel is None:
                problems.append(f"{muscle.name}: board and channel are missing")
                continue
            if not (0 <= board < board_count and 0 <= channel < CHANNELS):
                problems.append(
                    f"{muscle.name}: board {board} channel {channel}, expected board 0 to "
                    f"{board_count - 1} and channel 0 to {CHANNELS - 1}"
                )
                continue
            other = taken.setdefault((board, channel), muscle.name)
            if other != muscle.name:
                problems.append(
                    f"{muscle.name}: board {board} channel {channel} is {other}'s already"
                )
            muscles.append((board, channel))
            self.boards.setdefault(board, []).append((channel, index))
        joints: list[int] = []
        for index, joint in enumerate(rig.joints):
            encoder = joint.encoder
            if encoder is None:
                problems.append(f"{joint.name}.encoder: board and channel are missing")
                continue
            if not 0 <= encoder.board < board_count or encoder.channel != 0:
                problems.append(
                    f"{joint.name}.encoder: board {encoder.board} channel {encoder.channel}, "
                    f"expected board 0 to {board_count - 1} and channel 0"
                )
            elif self.joint_of_board.setdefault(encoder.board, index) != index:
                problems.append(f"{joint.name}.encoder: board {encoder.board} has another joint's")
            joints.append(encoder.board)
            self.boards.setdefault(encoder.board, [])
        if not rig.muscles:
            problems.append("the rig has no muscle")
        if problems:
            raise RigError("\n".join(problems))
        self.muscles = tuple(muscles)
        self.joints = tuple(joints)
