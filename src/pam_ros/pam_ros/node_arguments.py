"""The arguments of one command line that are for one of several nodes of a process.

`-p NODE:NAME:=VALUE` gives a parameter to one node. rcl compares NODE with the full name of a node
and drops the value silently where the node is in a namespace, so that the robot would be driven
with the defaults. Therefore such arguments are handed to their node itself.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

_FLAGS: Final = ("-p", "--param")


def arguments_by_node(
    words: Sequence[str], nodes: Collection[str]
) -> tuple[list[str], dict[str, list[str]]]:
    """Take what is for one node out of a command line.

    Parameters
    ----------
    words : sequence of str
        The command line, with --ros-args.
    nodes : collection of str
        The usual names of the nodes of this process.

    Returns
    -------
    rest : list of str
        The words that are for all nodes.
    by_node : dict of str to list of str
        For each node its own arguments, from `--ros-args` on; empty if it has none.
    """
    rest: list[str] = []
    found: dict[str, list[str]] = {node: [] for node in nodes}
    place = 0
    while place < len(words):
        word, rule = words[place], words[place + 1] if place + 1 < len(words) else ""
        node, _, parameter = rule.partition(":=")[0].partition(":")
        if word in _FLAGS and parameter and node in found:
            found[node] += ["-p", rule.removeprefix(f"{node}:")]
            place += 2
        else:
            rest.append(word)
            place += 1
    return rest, {node: ["--ros-args", *own] if own else [] for node, own in found.items()}
