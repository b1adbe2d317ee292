"""The longest step of the integration, where no other one is given."""

from typing import Final

DEFAULT_STEP: Final = 2.5e-4
"""[s]"""
