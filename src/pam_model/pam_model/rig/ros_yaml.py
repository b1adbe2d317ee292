"""What the YAML reader of a ROS node refuses although it is YAML.

A rig file is given to nodes with `--params-file`, and their reader is not the one of the tools.
Source: package rcl_yaml_param_parser of ROS 2 Jazzy, parse.c.
"""

from __future__ import annotations

import math
import re
from typing import Final

import yaml

_TRUTH: Final = re.compile(
    r"[yYnN]|yes|Yes|YES|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF"
)
_INTEGER: Final = re.compile(r"[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
_REAL: Final = re.compile(
    r"[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|\.?(inf|Inf|INF)|infinity)"
    r"|\.?(nan|NaN|NAN)"
)
_SMALLEST_NORMAL: Final = 2.0**-1022
_NULL: Final = "tag:yaml.org,2002:null"
_TYPES: Final = {
    "tag:yaml.org,2002:bool": "true/false",
    "tag:yaml.org,2002:int": "number",
    "tag:yaml.org,2002:float": "number",
}
# YAML 1.1 reads such a number without a point as text; the rig file's reader knows it
_EXPONENT: Final = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")


def refused_by_nodes(node: yaml.Node) -> list[str]:
    """What a node would refuse in one value of a rig file, without what is nested in it.

    Parameters
    ----------
    node : yaml.Node
        A list, a section or a value, as YAML composed it.

    Returns
    -------
    list of str
        One line for each problem, which begins with the line of the file.
    """
    if isinstance(node, yaml.SequenceNode):
        return _mixed(node)
    found = []
    for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
        if _is_empty(value):
            found.append(
                f"{_line(value)}: {_text(key)} has no value; a node of ROS refuses that: give one, "
                "or remove the key"
            )
        elif isinstance(value, yaml.ScalarNode):
            found += _ambiguous(value)
    return found


def _is_empty(node: yaml.Node) -> bool:
    if isinstance(node, yaml.ScalarNode):
        return node.tag == _NULL
    return isinstance(node, yaml.MappingNode) and not node.value


def _ambiguous(node: yaml.ScalarNode) -> list[str]:
    """A value has one type for the tools and for a node."""
    here = _TYPES.get(node.tag, "text")
    there = _kind(node).replace("integer", "number")
    if here == there or _EXPONENT.fullmatch(node.value):
        return []
    text = _text(node)
    remedy = f'write "{text}" if it is a text'
    if re.fullmatch(r"[-+]?[\d_]+", text):
        remedy = f"write {text.replace('_', '')}"
    return [f"{_line(node)}: {text} is {here} in YAML and {there} for a node of ROS: {remedy}"]


def _mixed(node: yaml.SequenceNode) -> list[str]:
    """A list has entries of one type, and none of them is a list or a section."""
    if any(not isinstance(entry, yaml.ScalarNode) for entry in node.value):
        return [f"{_line(node)}: a list within a list, or a section within one, is not allowed"]
    kinds = [_kind(entry) for entry in node.value]
    if len(set(kinds)) < 2:
        return [line for entry in node.value for line in _ambiguous(entry)]
    shown = ", ".join(_text(entry) for entry in node.value[:8])
    remedy = "all entries must have one type"
    if "true/false" in kinds:
        word = next(
            _text(o) for o, kind in zip(node.value, kinds, strict=True) if kind == "true/false"
        )
        remedy = f'{word} is true or false in YAML: write "{word}", or better another name'
    if set(kinds) == {"integer", "number"}:
        whole = next(
            _text(one) for one, kind in zip(node.value, kinds, strict=True) if kind[0] == "i"
        )
        remedy = f"write {_with_point(whole)} for {whole}"
    mixed = " and ".join(dict.fromkeys(kinds))
    return [f"{_line(node)}: [{shown}] mixes {mixed}, which a node of ROS refuses: {remedy}"]


def _with_point(whole: str) -> str:
    """A whole number as one with a decimal point."""
    try:
        value = int(whole, 0)
    except ValueError:  # 010 is octal in YAML
        value = int(whole, 8)
    return f"{value}.0"


def _kind(node: yaml.ScalarNode) -> str:
    """The type that the reader of ROS gives to a value."""
    text = node.value
    if node.style in {"'", '"', "|", ">"}:
        return "text"
    if _TRUTH.fullmatch(text):
        return "true/false"
    if _INTEGER.fullmatch(text) and -(1 << 63) <= _whole(text) < 1 << 63:
        return "integer"
    if _REAL.fullmatch(text) and _fits(text):
        return "number"
    return "text"


def _whole(text: str) -> int:
    digits = text.lstrip("+-")
    if len(digits) > 40:
        return 1 << 64
    base = 16 if digits[:2].lower() == "0x" else 8 if digits[0] == "0" else 10
    return int(digits, base) * (-1 if text[0] == "-" else 1)


def _fits(text: str) -> bool:
    """Whether a double holds it; one out of range is a text for ROS."""
    if "n" in text.lower():
        return True
    value = abs(float(text))
    zero = not re.search(r"[1-9]", re.split(r"[eE]", text)[0])
    return value < math.inf and (zero or value >= _SMALLEST_NORMAL)


def _line(node: yaml.Node) -> str:
    return f"line {node.start_mark.line + 1}"


def _text(node: yaml.Node) -> str:
    text = node.value if isinstance(node, yaml.ScalarNode) else "?"
    return text if len(text) <= 64 else f"{text[:64]}..."
