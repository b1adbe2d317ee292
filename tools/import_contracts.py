"""Rules about imports for which import-linter has no contract; `make lint` checks them.

pyproject.toml lists them under `tool.importlinter` together with import-linter's own contracts.
"""

from __future__ import annotations

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


def _is_entry_point(module: str) -> bool:
    return module.endswith(".__main__") or ".commands." in module


def _is_node(module: str) -> bool:
    """Whether a module is a ROS node, according to its file name."""
    return module.endswith("_node")


class _ImportRule(Contract):
    """A rule about single imports; a subclass lists the imports that break it."""

    advice = ""

    def broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        """The importing and the imported module of every import that breaks the rule."""
        raise NotImplementedError

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Check the graph of all imports."""
        lines = []
        for importer, imported in sorted(set(self.broken(graph))):
            details = graph.get_import_details(importer=importer, imported=imported)
            where = ", ".join(f"line {detail['line_number']}" for detail in details)
            lines.append(f"{importer} imports {imported} ({where})")
        return ContractCheck(kept=not lines, metadata={"lines": lines})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Print the imports that break the rule, and what to do instead."""
        for line in check.metadata["lines"]:
            output.print_error(f"- {line}")
        output.new_line()
        output.print_error(self.advice)


class NodesAreStartedNotImported(_ImportRule):
    """Only a program's entry point may import a module called `*_node`.

    That is `__main__`, or a file of the folder `commands` of which `__main__` is made.
    """

    advice = (
        "Start the node as a process, or move the needed code into a module without ROS; "
        "code that needs an object of the node gets it from the entry point."
    )

    def broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        """Imports of nodes by modules that are not entry points."""
        return [
            (importer, node)
            for node in graph.modules
            if _is_node(node)
            for importer in graph.find_modules_that_directly_import(node)
            if not _is_entry_point(importer)
        ]


class RosStaysInNodes(_ImportRule):
    """Only `*_node` modules and pam_ros may import ROS itself."""

    ros_packages = fields.SetField(subfield=fields.StringField())
    advice = "Put the algorithm into a module without ROS, and call it from a *_node.py."

    def broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        """Imports of ROS by other modules."""
        return [
            (importer, package)
            for package in self.ros_packages & graph.modules
            for importer in graph.find_modules_that_directly_import(package)
            if not _is_node(importer) and importer.split(".")[0] != "pam_ros"
        ]
