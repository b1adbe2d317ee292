"""Equal joints are designed once for all tests; a sharing that fails shows in their time alone."""

from __future__ import annotations

import pytest

from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_model.rig import Rig


@pytest.mark.usefixtures("shared_designs")
def test_the_same_controller_is_not_designed_again(rig: Rig) -> None:
    first = Controller(rig, ControlSettings())
    first.designs.take_report()
    second = Controller(rig, ControlSettings())
    report = second.designs.take_report()
    assert report.designed == 0
    assert report.shared > 0
    assert second.settings.gains == first.settings.gains
