"""Builds a package `control_msgs` for the tests: the index of Python packages has none.

The package has the fields of control_msgs/action/FollowJointTrajectory of ROS 2 Jazzy. The ROS
wheels contain the generators of interface code, so it takes a C compiler and about ten seconds,
once: the result is kept in .cache/ and is made anew when this file changes.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = "control_msgs"

DEFINITIONS = {
    "msg/JointTolerance.msg": """
string name
float64 position
float64 velocity
float64 acceleration
float64 effort
""",
    "msg/JointComponentTolerance.msg": """
uint16 X_AXIS=1
uint16 Y_AXIS=2
uint16 Z_AXIS=3
uint16 TRANSLATION=4
uint16 ROTATION=5
string joint_name
uint16 component
float64 position
float64 velocity
float64 acceleration
float64 effort
""",
    "action/FollowJointTrajectory.action": """
trajectory_msgs/JointTrajectory trajectory
trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory
JointTolerance[] path_tolerance
JointComponentTolerance[] component_path_tolerance
JointTolerance[] goal_tolerance
JointComponentTolerance[] component_goal_tolerance
builtin_interfaces/Duration goal_time_tolerance
---
int32 error_code
int32 SUCCESSFUL = 0
int32 INVALID_GOAL = -1
int32 INVALID_JOINTS = -2
int32 OLD_HEADER_TIMESTAMP = -3
int32 PATH_TOLERANCE_VIOLATED = -4
int32 GOAL_TOLERANCE_VIOLATED = -5
string error_string
---
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
""",
}


def missing_for_build() -> str:
    """What the machine lacks to build the package; empty if nothing."""
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        return "no C and C++ compiler (apt install g++)"
    if not Path(sysconfig.get_paths()["include"], "Python.h").exists():
        return "no Python.h (apt install python3-dev)"
    return ""


def control_msgs_folder() -> Path:
    """The folder to put on PYTHONPATH; the package is built there if it is not there yet."""
    text = Path(__file__).read_bytes() + sys.version.encode() + sys.prefix.encode()
    folder = ROOT / ".cache" / f"{PACKAGE}-{hashlib.sha256(text).hexdigest()[:12]}"
    if not folder.exists():
        building = folder.with_name(f"{folder.name}.{os.getpid()}")
        shutil.rmtree(building, ignore_errors=True)
        with contextlib.redirect_stdout(io.StringIO()):  # the generators tell every file
            _build(building)
        try:
            building.rename(folder)
        except OSError:  # another process was faster
            shutil.rmtree(building, ignore_errors=True)
    return folder


def _build(folder: Path) -> None:
    """Generate and compile the package; the folder appears complete."""
    prefix = Path(sys.prefix)
    work, package = folder / "build", folder / PACKAGE
    idl = _idl_files(work)
    for kind in ("generator_c", "typesupport_fastrtps_c", "typesupport_introspection_c"):
        header = f"rosidl_{kind}__visibility_control.h"
        template = prefix / "share" / f"rosidl_{kind}" / "resource" / f"{header}.in"
        text = template.read_text().replace("@PROJECT_NAME@", PACKAGE)
        text = text.replace("@PROJECT_NAME_UPPER@", PACKAGE.upper())
        place = work / PACKAGE / "msg" / header
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    _generate(work, package, idl)
    includes = [
        work,
        work / "introspection",
        sysconfig.get_paths()["include"],
        np.get_include(),
        prefix / "include",
    ]
    includes += [path for path in sorted((prefix / "include").iterdir()) if path.is_dir()]
    sources = sorted(
        source
        for place in (work / PACKAGE, work / "introspection", package)
        for source in place.rglob("*")
        if source.suffix in {".c", ".cpp"}
    )
    flags = ["-w", "-O0", "-fPIC", *(f"-I{path}" for path in includes)]
    objects: dict[str, list[Path]] = {"fastrtps_c": [], "introspection_c": [], "module": []}
    for source in sources:
        compiled = work / f"{len(list(work.glob('*.o')))}.o"
        compiler = "g++" if source.suffix == ".cpp" else "gcc"
        _run([compiler, *flags, "-c", str(source), "-o", str(compiled)])
        if source.is_relative_to(package):
            objects["module"].append(compiled)
        else:
            introspects = source.is_relative_to(work / "introspection")
            objects["introspection_c" if introspects else "fastrtps_c"].append(compiled)
    needed = ["action_msgs", "builtin_interfaces", "service_msgs", "std_msgs", "trajectory_msgs"]
    needed += ["geometry_msgs", "unique_identifier_msgs"]
    kinds = ["generator_c", "generator_py", "typesupport_c", "typesupport_fastrtps_c"]
    kinds += ["typesupport_introspection_c"]
    libraries = [f"-l{name}__rosidl_{kind}" for name in needed for kind in kinds]
    libraries += ["-lfastcdr", "-lrcutils", "-lrosidl_runtime_c", "-lrosidl_typesupport_c"]
    libraries += ["-lrosidl_typesupport_fastrtps_c", "-lrosidl_typesupport_fastrtps_cpp", "-lrmw"]
    search = [f"-L{package}", f"-L{prefix / 'lib'}", "-Wl,--no-as-needed"]
    search += ["-Wl,-rpath,$ORIGIN", f"-Wl,-rpath,{prefix / 'lib'}"]
    own: list[str] = []
    for kind in ("fastrtps_c", "introspection_c"):
        name = f"{PACKAGE}__rosidl_typesupport_{kind}"
        library = package / f"lib{name}.so"
        # typesupport_c opens the library by this name; it is found, because it is loaded already
        named = ["-o", str(library), f"-Wl,-soname,{library.name}"]
        _run(["g++", "-shared", *named, *map(str, objects[kind]), *search, *own, *libraries])
        own.append(f"-l{name}")
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    module = package / f"{PACKAGE}_s__rosidl_typesupport_c{suffix}"
    made = ["-o", str(module), *map(str, objects["module"])]
    _run(["g++", "-shared", *made, *search, *own, *libraries])
    shutil.rmtree(work)


def _idl_files(work: Path) -> list[str]:
    """Convert the definitions to IDL; returns the generators' tuples "folder:file"."""
    from rosidl_adapter.action import convert_action_to_idl
    from rosidl_adapter.msg import convert_msg_to_idl

    tuples = []
    for name, text in DEFINITIONS.items():
        source = work / "definitions" / name
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(text.lstrip())
        convert = convert_action_to_idl if name.startswith("action") else convert_msg_to_idl
        out = work / "idl" / Path(name).parent
        out.mkdir(parents=True, exist_ok=True)
        convert(work / "definitions", PACKAGE, Path(name), out)
        tuples.append(f"{work / 'idl'}:{Path(name).with_suffix('.idl')}")
    return tuples


def _generate(work: Path, package: Path, idl: list[str]) -> None:
    from rosidl_generator_c import generate_c
    from rosidl_generator_py import generate_py
    from rosidl_generator_type_description import generate_type_hash
    from rosidl_typesupport_c import generate_c as generate_typesupport_c
    from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
    from rosidl_typesupport_introspection_c import generate_c as generate_introspection

    share = Path(sys.prefix, "share")
    arguments: dict[str, Any] = {
        "package_name": PACKAGE,
        "idl_tuples": idl,
        "ros_interface_dependencies": [],
        "target_dependencies": [],
        "include_paths": [f"{place.name}:{place}" for place in sorted(share.iterdir())],
    }
    place = work / "arguments.json"

    def call(generator: str, generate: Callable[..., Any], output: Path, *more: Any) -> None:
        resource = {"output_dir": str(output), "template_dir": str(share / generator / "resource")}
        place.write_text(json.dumps(arguments | resource))
        generate(str(place), *more)

    call("rosidl_generator_type_description", generate_type_hash, work / PACKAGE)
    arguments["type_description_tuples"] = [
        f"{path}:{work / PACKAGE / Path(path).with_suffix('.json')}"
        for path in (entry.rsplit(":", 1)[1] for entry in idl)
    ]
    arguments["ros_interface_files"] = [str(work / "definitions" / name) for name in DEFINITIONS]
    call("rosidl_generator_c", generate_c, work / PACKAGE)
    call("rosidl_typesupport_fastrtps_c", generate_typesupport_fastrtps_c, work / PACKAGE)
    introspection = work / "introspection" / PACKAGE  # file names as of rosidl_generator_c
    call("rosidl_typesupport_introspection_c", generate_introspection, introspection)
    kinds = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
    call("rosidl_typesupport_c", generate_typesupport_c, work / PACKAGE, kinds)
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    call("rosidl_generator_py", generate_py, package, ["rosidl_typesupport_c"])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:3])} ...:\n{done.stderr[-3000:]}")
