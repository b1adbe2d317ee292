"""Makes the checks of the suite importable in a clone; nothing installs them on a robot."""

from setuptools import find_packages, setup

setup(
    name="pam_check",
    version="0.1.0",
    packages=find_packages(),
    license="Apache-2.0",
    description="Checks of the suite: faults, fuzzing, endurance, withheld effects.",
    entry_points={
        "pam.tools": ["check = pam_check.__main__:TOOL"],
        "can.interface": [
            "unpluggable = pam_check.endurance.unpluggable_bus:UnpluggableBus",
        ],
    },
)
