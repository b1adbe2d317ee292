"""The bit rate of a CAN bus for which no other one is given."""

from typing import Final

DEFAULT_BITRATE: Final = 1_000_000
"""[bit/s]"""
