"""Installs pam_check the way ament_python expects it."""

from setuptools import find_packages, setup

NAME = "pam_check"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    author="PAM suite authors",
    author_email="pam-suite@example.org",
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    url="https://example.org/pam-suite",
    description="Checks of the suite: faults, fuzzing, endurance, security, withheld effects.",
    license="Apache-2.0",
    entry_points={
        "pam.tools": ["check = pam_check.__main__:TOOL"],
        "can.interface": [
            "unpluggable = pam_check.endurance.unpluggable_bus:UnpluggableBus",
        ],
    },
)
