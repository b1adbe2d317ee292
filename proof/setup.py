"""Makes the checks of the suite importable in a clone; nothing installs them on a robot."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

setup(
    name="pam_check",
    version=ET.parse("../src/pam_model/package.xml").getroot().findtext("version"),
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
