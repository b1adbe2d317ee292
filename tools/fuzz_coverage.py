#!/usr/bin/env python3
"""Runs a byte target under atheris; started by tools/fuzz.sh with libFuzzer's arguments.

The environment variable FUZZ_TARGET names the target. It cannot be an argument, since libFuzzer
starts this file again with its own arguments when it merges inputs.
"""

from __future__ import annotations

import os
import sys

import atheris

with atheris.instrument_imports(include=["pam_driver", "pam_driver.safety.pressure_plausibility"]):
    from pam_check.fuzz.byte_targets import TARGETS

atheris.Setup(sys.argv, TARGETS[os.environ["FUZZ_TARGET"]])
atheris.Fuzz()
