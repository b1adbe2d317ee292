"""The table of a node's parameters: declared, checked, changed or refused; on a stand-in node."""

import math
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rcl_interfaces.msg")

from pam_model.errors import PamError, RigError
from pam_model.rig import described_key, load_rig, rig_of_node
from pam_model.rig.keys import Key
from pam_ros.errors import ParameterError
from pam_ros.parameter_files import remember_arguments
from pam_ros.parameter_row import Parameter, Value
from pam_ros.parameters import NodeParameters

RIG = load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")
TABLE = (
    Parameter("rate", 500.0, "Hz", 1.0, 1000.0, "how often", changeable=True),
    Parameter("count", 3, "-", 1, 9, "how many"),
    Parameter("interface", "socketcan", "-", 0, 0, "which bus"),
    Parameter("vent", False, "-", 0, 0, "whether"),
)


class FakeNode:
    """What NodeParameters asks of a node: overrides in, declarations out."""

    def __init__(self, overrides: Mapping[str, Any]) -> None:
        self.values = dict(overrides)
        self.descriptors: dict[str, Any] = {}
        self.set: Callable[[list[Any]], Any]

    def get_fully_qualified_name(self) -> str:
        return "/left/tunnel"

    def set_parameters(self, parameters: list[Any]) -> None:
        for each in parameters:
            assert self.set([each]).successful
            self.values[each.name] = each.value

    def get_parameter(self, name: str) -> Any:
        assert name == "use_sim_time"
        return SimpleNamespace(value=self.values.get(name, False))

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Any]:
        assert prefix == ""
        return {name: SimpleNamespace(value=value) for name, value in self.values.items()}

    def undeclare_parameter(self, name: str) -> None:
        del self.values[name]

    def declare_parameter(
        self, name: str, value: Any, descriptor: Any, *, ignore_override: bool
    ) -> None:
        assert name not in self.values
        assert ignore_override
        self.values[name] = value
        self.descriptors[name] = descriptor

    def add_on_set_parameters_callback(self, callback: Callable[[list[Any]], Any]) -> None:
        self.set = callback

    def change(self, **values: Any) -> tuple[bool, str]:
        result = self.set([SimpleNamespace(name=key, value=values[key]) for key in values])
        return result.successful, result.reason


def made(
    node: FakeNode,
    read_others: Callable[..., Any] = rig_of_node,
    on_change: Callable[[Mapping[str, Value]], str | None] | None = None,
) -> NodeParameters[Any]:
    return NodeParameters(
        node, TABLE, read_others, on_change, describe=described_key, usual_name="tunnel"
    )


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


def overrides(**more: Any) -> dict[str, Any]:
    return flat(RIG.to_parameters()) | more


def test_declared_with_unit_and_range() -> None:
    node = FakeNode(overrides(rate=200, use_sim_time=False))
    parameters = made(node)
    assert parameters.described == RIG
    assert parameters.number("rate") == 200.0
    assert type(node.values["rate"]) is float
    assert (parameters["count"], parameters["interface"], parameters["vent"]) == (
        3,
        "socketcan",
        False,
    )
    described = node.descriptors["rate"]
    assert described.description == "how often [Hz]"
    assert described.floating_point_range[0].to_value == 1000.0
    assert not described.read_only
    assert node.descriptors["count"].integer_range[0].to_value == 9
    assert node.descriptors["count"].read_only


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"rate": 5000.0}, "rate = 5000 Hz: must be from 1 to 1000 Hz"),
        ({"rate": math.nan}, "rate = nan Hz: must be a finite number"),
        ({"rate": "fast"}, "rate = 'fast': must be a number in Hz"),
        ({"rate": True}, "rate = True: must be a number in Hz"),
        ({"count": 2.5}, "count = 2.5: must be a whole number"),
        ({"count": 10}, "must be from 1 to 9"),
        ({"interface": 3}, "interface = 3: must be text"),
        ({"vent": 1}, "vent = 1: must be true or false"),
        ({"rat": 3.0}, "rat: unknown key; did you mean rate?"),
    ],
)
def test_bad_parameter_file_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises((ParameterError, RigError)) as caught:
        made(FakeNode(overrides(**given)))
    assert reason in str(caught.value)


def test_no_rig_is_told_how_to_get_one() -> None:
    with pytest.raises(PamError, match="--params-file"):
        made(FakeNode({"rate": 100.0}))


def test_bad_rig_is_told() -> None:
    with pytest.raises(RigError, match="looks like bar"):
        made(FakeNode(overrides(supply_pressure=7.0)))


def test_a_node_says_itself_what_its_other_keys_are() -> None:
    seen: list[tuple[dict[str, Any], tuple[str, ...]]] = []

    def read_others(others: Mapping[str, Any], own: Collection[str]) -> str:
        seen.append((dict(others), tuple(own)))
        return "a wind tunnel"

    node = FakeNode({"rate": 100.0, "qos_overrides./x.depth": 3, "tunnel.length": 8.0})
    parameters = NodeParameters(
        node,
        TABLE,
        read_others,
        describe=lambda _, name: Key("m", 0.0, 9.0, text=f"the {name}"),
        usual_name="tunnel",
    )
    assert parameters["rate"] == 100.0
    assert parameters.described == "a wind tunnel"
    assert seen == [({"tunnel.length": 8.0}, ("rate", "count", "interface", "vent"))]
    described = node.descriptors["tunnel.length"]
    assert described.description == "the tunnel.length [m]"
    assert described.floating_point_range[0].to_value == 9.0
    assert described.read_only


def test_a_change_may_be_answered_with_a_remark_and_be_taken_back() -> None:
    node = FakeNode(overrides())
    parameters = made(node, rig_of_node, lambda changes: "being designed")
    assert node.change(rate=250.0) == (True, "")
    answer = parameters.with_remark(SimpleNamespace(successful=True, reason=""))
    assert answer.reason == "being designed"
    assert not node.change(rate=0.0)[0]
    refused = SimpleNamespace(successful=False, reason="too low")
    assert parameters.with_remark(refused).reason == "too low"
    parameters.restore({"rate": 500.0})
    assert node.values["rate"] == parameters["rate"] == 500.0


def test_a_section_that_is_not_applied_ends_the_start(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    file = tmp_path / "my.yaml"
    file.write_text("tunnel:\n  ros__parameters:\n    rate: 5.0\n")
    remember_arguments(["--params-file", str(file)])
    request.addfinalizer(partial(remember_arguments, ()))
    with pytest.raises(ParameterError, match=r"my\.yaml, line 1.*Write /\*\*/tunnel:"):
        made(FakeNode(overrides()))


def test_changes_while_running() -> None:
    seen: list[Mapping[str, Value]] = []

    def on_change(values: Mapping[str, Value]) -> None:
        if values["rate"] == 13.0:
            raise ParameterError("not on a Friday")
        seen.append(values)

    node = FakeNode(overrides())
    parameters = made(node, rig_of_node, on_change)
    assert node.change(rate=250.0) == (True, "")
    assert parameters["rate"] == 250.0
    assert seen == [{"rate": 250.0}]
    assert node.change(rate=250.0) == (True, "")  # as it is: nothing is designed or logged anew
    assert seen == [{"rate": 250.0}]
    for values, reason in (
        ({"rate": 0.0}, "must be from 1 to 1000"),
        ({"rate": math.inf}, "finite"),
        ({"rate": 13.0}, "not on a Friday"),
        ({"count": 4}, "can only be changed by a restart"),
        ({"supply_pressure": 6e5}, "is only read from the parameter file when the node starts"),
        ({"rate": 100.0, "count": 4}, "can only be changed by a restart"),
    ):
        accepted, told = node.change(**values)
        assert not accepted
        assert reason in told
    assert parameters["rate"] == 250.0
    assert len(seen) == 1
    assert node.change(use_sim_time=True) == (True, "")
