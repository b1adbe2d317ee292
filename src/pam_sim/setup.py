"""Installs pam_sim the way ament_python expects it."""

from setuptools import find_packages, setup

NAME = "pam_sim"

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
    description="Simulated rig with valve boards on a CAN bus, and faults that can be injected.",
    license="Apache-2.0",
    entry_points={
        "pam.tools": ["sim = pam_sim.__main__:TOOL"],
        "console_scripts": [
            "pam_rig = pam_sim.__main__:rig_node",
        ],
    },
)
