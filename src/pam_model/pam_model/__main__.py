"""`python -m pam_model`: models, muscles and rig files from the command line."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pam_model.argument_types import (
    count,
    input_file,
    make_parents,
    named_number,
    number,
    output_file,
    output_folder,
)
from pam_model.command_line import (
    Arguments,
    Command,
    Outcome,
    Parser,
    add_rig,
    chosen_rig,
    run_program,
)
from pam_model.errors import PamError

if TYPE_CHECKING:
    from pam_model.identify.measurements import Measurements
    from pam_model.muscles.force_model import MuscleGeometry


def _list(chosen: Arguments) -> Outcome:
    from pam_model.catalogue.catalogue import FAMILIES, catalogue  # noqa: PLC0415  (numpy)
    from pam_model.muscles.force_model import registered_models  # noqa: PLC0415

    rows = catalogue()
    known = registered_models()
    for family in FAMILIES:
        print(family.upper())
        for row in (r for r in rows if r.family == family):
            names = [name for name in row.models if name in known]
            print(f"  {row.key:28s} {row.equations or '-':34s} {row.status}")
            usable = " or ".join(names) or "none, it is not a length-force model"
            print(f"      {row.title}\n      in a rig file: {usable}")
    return Outcome([{n: getattr(r, n) for n in r.__dataclass_fields__} for r in rows])


def _show(chosen: Arguments) -> Outcome:
    from pam_model.catalogue.catalogue import find_row  # noqa: PLC0415  (numpy)
    from pam_model.catalogue.gallery import default_model, draw_row  # noqa: PLC0415  (matplotlib)
    from pam_model.identify.show import (  # noqa: PLC0415
        PRESSURES,
        draw_force_model,
        save_figure,
    )
    from pam_model.muscles.force_model import (  # noqa: PLC0415
        create_force_model,
        registered_models,
    )

    row = find_row(chosen.name)
    pressures = chosen.pressures or PRESSURES
    geometry, constants = _geometry(chosen), dict(chosen.set)
    name = chosen.name if chosen.name in registered_models() else ""
    if not name and (geometry or constants or chosen.pressures):
        name = next((n for n in row.models if n in registered_models()), "")
        if not name:
            raise PamError(f"{row.key} is not a length-force model: its picture has fixed numbers")
    if not name:
        figure = draw_row(row)
    else:
        if geometry is None:
            _, geometry = default_model(name)
        model = create_force_model(name, geometry, constants)
        figure = draw_force_model(model, geometry.rest_length, pressures)
    picture = save_figure(figure, make_parents(chosen.output or Path(f"{chosen.name}.png")))
    print(f"{row.title}: equations {row.equations or '-'}, {row.status}")
    print(f"  domain: {row.domain}\n  suited for: {row.use}\n  not suited for: {row.avoid}")
    print(picture)
    facts = {n: getattr(row, n) for n in row.__dataclass_fields__}
    return Outcome({**facts, "picture": picture})


def _fit(chosen: Arguments) -> Outcome:
    from pam_model.identify.fit import fit  # noqa: PLC0415  (scipy)
    from pam_model.muscles.force_model import registered_models  # noqa: PLC0415

    if chosen.name not in registered_models():
        raise PamError(
            f"{chosen.name} is not a length-force model; known: {', '.join(registered_models())}"
        )
    data = _data(chosen)
    geometry = _geometry(chosen)
    results: list[dict[str, Any]] = []
    for branch, points in data.branches().items():
        result = fit(
            chosen.name,
            points,
            geometry,
            dict(chosen.set),
            fit_geometry=chosen.fit_geometry or geometry is None,
            residual=_residual(chosen, data),
            starts=chosen.starts,
        )
        print(f"{branch}\n{result.table()}" if branch else result.table())
        results.append({"branch": branch, **result.as_dict()})
        if chosen.plot:
            from pam_model.identify.fit_figures import draw_fit  # noqa: PLC0415  (matplotlib)
            from pam_model.identify.show import save_figure  # noqa: PLC0415

            path = chosen.plot
            if branch:
                path = path.with_stem(f"{path.stem}_{branch.replace(' ', '_')}")
            print(save_figure(draw_fit(result, points), make_parents(path)))
    _print_assumptions(data)
    return Outcome(results)


def _compare(chosen: Arguments) -> Outcome:
    from pam_model.identify.compare import compare  # noqa: PLC0415  (scipy)

    data = _data(chosen)
    geometry = _geometry(chosen)
    comparisons = compare(
        data,
        chosen.models,
        geometry,
        fit_geometry=chosen.fit_geometry or geometry is None,
        residual=_residual(chosen, data),
        starts=chosen.starts,
    )
    print("\n\n".join(c.table() for c in comparisons))
    _print_assumptions(data)
    if chosen.plot:
        from pam_model.identify.fit_figures import draw_comparison  # noqa: PLC0415  (matplotlib)
        from pam_model.identify.show import save_figure  # noqa: PLC0415

        print(save_figure(draw_comparison(comparisons), make_parents(chosen.plot)))
    results = [c.as_dict() for c in comparisons]
    if chosen.page:
        from pam_model.identify.comparison_page import write_comparison  # noqa: PLC0415

        print(write_comparison(results, chosen.page))
    return Outcome(results)


def _design(chosen: Arguments) -> Outcome:
    from pam_model.identify.design import design  # noqa: PLC0415  (scipy)

    made = design(
        chosen.force,
        chosen.stroke,
        chosen.pressure,
        contraction=chosen.contraction,
        strand_width=chosen.strand_width,
        strands=chosen.strands,
        largest_length=chosen.largest_length,
        largest_diameter=chosen.largest_diameter,
        strand_strength=chosen.strand_strength,
    )
    print(made.table())
    return Outcome(made.as_dict())


def _braid(chosen: Arguments) -> Outcome:
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415  (numpy)

    made = BraidFromDatasheet.measured(
        chosen.diameter, chosen.length, math.radians(chosen.angle), chosen.wall_thickness
    )
    print(made.section(chosen.name))
    per_bar, share = 1e5 * made.force_per_pressure, made.largest_contraction
    print(
        f"# ideal braid: pulls {per_bar:.3g} N per bar at rest length, contracts by at most "
        f"{100.0 * share:.3g} %"
    )
    return Outcome({**asdict(made), "force_per_pressure": made.force_per_pressure,
                    "largest_contraction": share})  # fmt: skip


def _urdf(chosen: Arguments) -> Outcome:
    from pam_model.joints.urdf import rig_as_urdf  # noqa: PLC0415
    from pam_model.rig import load_rig  # noqa: PLC0415  (numpy)

    rig = chosen_rig(chosen)
    document = rig_as_urdf(load_rig(rig), rig.stem)
    if chosen.output is None:
        print(document, end="")
    else:
        make_parents(chosen.output).write_text(document)
        print(f"written: {chosen.output}")
    return Outcome({"urdf": document, "file": chosen.output})


def _gallery(chosen: Arguments) -> Outcome:
    from pam_model.catalogue.gallery import write_gallery  # noqa: PLC0415  (matplotlib)

    written = write_gallery(chosen.folder)
    size = sum(path.stat().st_size for path in written)
    print(f"{len(written)} files, {size / 1e6:.2f} MB in {chosen.folder}")
    return Outcome({"written": written})


def _data(chosen: Arguments) -> Measurements:
    from pam_model.identify.measurements import load_measurements  # noqa: PLC0415  (numpy)

    data = load_measurements(chosen.data, load_share=chosen.load_share)
    if chosen.pressure_bands:
        data = data.with_pressure_blocks(chosen.pressure_bands)
    return data


def _residual(chosen: Arguments, data: Measurements) -> Literal["force", "length"]:
    # The residual is in the measured quantity: length at a known load, or force at a set length.
    if chosen.residual == "force" or (chosen.residual is None and not data.is_shortening):
        return "force"
    return "length"


def _print_assumptions(data: Measurements) -> None:
    for assumption in data.assumptions:
        print(f"assumed: {assumption}")


def _geometry(chosen: Arguments) -> MuscleGeometry | None:
    given = [chosen.thread_length, chosen.turns, chosen.rest_length]
    if all(value is None for value in given):
        return None
    if any(value is None for value in given):
        raise PamError("--thread-length [m], --turns and --rest-length [m] must be given together")
    from pam_model.muscles.force_model import MuscleGeometry  # noqa: PLC0415  (numpy)

    return MuscleGeometry(
        chosen.thread_length, chosen.turns, chosen.rest_length, chosen.wall_thickness
    )


def _declare_nothing(parser: Parser) -> None:
    """Declare nothing: the command has no arguments of its own."""


def _declare_show(parser: Parser) -> None:
    parser.add_argument("name", help="name as printed by `list`")
    parser.add_argument(
        "--pressures", type=number("Pa", above=0.0), nargs="+", metavar="PA", help="gauge [Pa]"
    )
    parser.add_argument(
        "--output", type=output_file, metavar="FILE", help="PNG or SVG file (default: NAME.png)"
    )
    _add_muscle(parser)


def _declare_fit(parser: Parser) -> None:
    parser.add_argument("name", help="a length-force model")
    _add_data(parser)


def _declare_compare(parser: Parser) -> None:
    _add_data(parser)
    parser.add_argument("--models", nargs="+", metavar="NAME", help="only these (default: all)")
    parser.add_argument(
        "--page",
        type=output_file,
        metavar="FILE",
        help="also write the tables into this Markdown page, between its markers",
    )


def _declare_design(parser: Parser) -> None:
    def add(name: str, unit: str, text: str, **more: Any) -> None:
        kind = number(unit, above=0.0)
        parser.add_argument(name, type=kind, metavar="X", help=f"{text} [{unit or '-'}]", **more)

    add("--force", "N", "force at the end of the stroke", required=True)
    add("--stroke", "m", "stroke under that force", required=True)
    add("--pressure", "Pa", "gauge pressure", required=True)
    add("--contraction", "", "stroke over rest length (default: chosen by the program)")
    add("--strand-width", "m", "of the braid (default: %(default)g)", default=0.3e-3)
    parser.add_argument(
        "--strands", type=count(), default=96, help="both families (default: %(default)s)"
    )
    add("--largest-length", "m", "at rest")
    add("--largest-diameter", "m", "contracted")
    add("--strand-strength", "N", "per strand")


def _declare_braid(parser: Parser) -> None:
    above: dict[str, Any] = {"required": True, "metavar": "X"}
    parser.add_argument(
        "--diameter", type=number("m", above=0.0), help="of the braid at rest [m]", **above
    )
    parser.add_argument(
        "--length", type=number("m", above=0.0), help="between the fittings at rest [m]", **above
    )
    parser.add_argument(
        "--angle", type=number("deg", above=0.0), help="between thread and axis at rest [deg]",
        **above,
    )  # fmt: skip
    parser.add_argument(
        "--wall-thickness", type=number("m", least=0.0), default=0.0, metavar="X",
        help="of the bladder [m] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--name", default="muscle", help="(default: %(default)s)")


def _declare_urdf(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--output", type=output_file, metavar="FILE", help="(default: standard output)"
    )


def _effect_tables(chosen: Arguments) -> Outcome:
    from pam_model.effect_tables import write_tables  # noqa: PLC0415

    changed = write_tables(Path(chosen.folder))
    print("written: " + ", ".join(map(str, changed)) if changed else "the tables are up to date")
    return Outcome({"changed": changed})


def _declare_gallery(parser: Parser) -> None:
    parser.add_argument(
        "folder", type=output_folder, nargs="?", default="docs", help="(default: docs)"
    )


def _add_muscle(parser: Parser) -> None:
    parser.add_argument("--thread-length", type=number("m", above=0.0), metavar="M", help="b [m]")
    parser.add_argument("--turns", type=number("", above=0.0), metavar="N", help="n [-]")
    parser.add_argument("--rest-length", type=number("m", above=0.0), metavar="M", help="[m]")
    parser.add_argument(
        "--wall-thickness", type=number("m", least=0.0), default=0.0, metavar="M",
        help="[m] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--set", type=named_number, nargs="+", default=[], metavar="NAME=NUMBER",
        help="a constant of the model",
    )  # fmt: skip


def _add_data(parser: Parser) -> None:
    parser.add_argument(
        "data", type=input_file, help="CSV: pressure, force, length or shortening, ..."
    )
    _add_muscle(parser)
    parser.add_argument(
        "--fit-geometry", action="store_true", help="also fit rest length, braid angle, diameter"
    )
    parser.add_argument("--residual", choices=("force", "length"), help="what is minimised")
    parser.add_argument(
        "--pressure-bands", type=count(2), metavar="N",
        help="cross-validate with this many bands of pressure instead of the blocks",
    )  # fmt: skip
    parser.add_argument(
        "--load-share", type=count(), default=6, metavar="N",
        help="staircase: number of muscles that carry the weight (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--starts", type=count(), default=4, metavar="N",
        help="starting points of each fit; more can find better optima (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--plot", type=output_file, metavar="FILE", help="PNG or SVG file")


COMMANDS = (
    Command("list", "list every model, its equations and status", _declare_nothing, _list),
    Command(
        "show",
        "draw a model",
        _declare_show,
        _show,
        examples=("python -m pam_model show tondu_lopez --set k=1.2 --output muscle.png",),
    ),
    Command(
        "fit",
        "identify the constants of a model from measured points",
        _declare_fit,
        _fit,
        examples=(
            "python -m pam_model fit tondu_lopez points.csv --thread-length 0.25 --turns 2 "
            "--rest-length 0.23",
        ),
    ),
    Command(
        "compare",
        "rank models by their errors at measured points",
        _declare_compare,
        _compare,
        examples=("python -m pam_model compare points.csv --plot ranking.png",),
    ),
    Command(
        "design",
        "design a muscle for a force, a stroke and a pressure",
        _declare_design,
        _design,
        examples=("python -m pam_model design --force 100 --stroke 0.05 --pressure 300000",),
    ),
    Command(
        "braid",
        "write the muscle section of a rig file from a data sheet",
        _declare_braid,
        _braid,
        examples=("python -m pam_model braid --diameter 20e-3 --length 0.3 --angle 23",),
    ),
    Command(
        "urdf",
        "write the joints of a rig as URDF",
        _declare_urdf,
        _urdf,
        examples=("python -m pam_model urdf --rig config/elbow.yaml --output elbow.urdf",),
    ),
    Command(
        "gallery", "write pictures and table of models for the docs", _declare_gallery, _gallery
    ),
    Command(
        "effect-tables", "write the tables of effects in the docs", _declare_gallery, _effect_tables
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    description = (
        "Models of pneumatic muscles: list, draw, fit and compare them; design a muscle; "
        "rig-file sections and URDF."
    )
    return run_program("python -m pam_model", description, COMMANDS, arguments)


if __name__ == "__main__":
    sys.exit(main())
