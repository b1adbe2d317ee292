"""Installs pam_model the way ament_python expects it."""

from setuptools import find_packages, setup

NAME = "pam_model"

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
    extras_require={"test": ["pytest"], "compiled": ["numba"]},
    zip_safe=False,
    author="PAM suite authors",
    author_email="pam-suite@example.org",
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    url="https://example.org/pam-suite",
    description="Pneumatic muscles: force models, joints, effects, plant, rig file, node.",
    license="Apache-2.0",
    entry_points={
        "pam.tools": ["model = pam_model.__main__:TOOL"],
        "console_scripts": [
            "model_node = pam_model.__main__:model_node",
        ],
    },
)
