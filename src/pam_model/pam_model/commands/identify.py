"""Commands that fit models to measurements, and design a muscle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pam_model.argument_types import count, input_file, make_parents, number, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.commands.muscle_arguments import add_muscle, geometry_to_fit, in_both_words
from pam_model.errors import PamError

if TYPE_CHECKING:
    from pam_model.identify.measurements import Measurements


def _declare_fit(parser: Parser) -> None:
    parser.add_argument("name", help="a length-force model")
    _add_data(parser)
    parser.add_argument(
        "--section", metavar="MUSCLE", help="also print the section of this muscle for a rig file"
    )


def _fit(chosen: Arguments) -> Outcome:
    from pam_model.identify.fit import fit  # noqa: PLC0415  (scipy)
    from pam_model.muscles.force_model import registered_models  # noqa: PLC0415
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415

    if chosen.name not in registered_models():
        raise PamError(
            f"{chosen.name} is not a length-force model; known: {', '.join(registered_models())}"
        )
    data = _data(chosen)
    geometry, stated = geometry_to_fit(chosen)
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
            stated=stated,
        )
        print(f"{branch}\n{result.table()}" if branch else result.table())
        print(f"  {in_both_words(result.geometry)}")
        if chosen.section:
            braid = BraidFromDatasheet.of_geometry(result.geometry)
            print(braid.section(chosen.section, result.model, result.constants))
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


def _declare_compare(parser: Parser) -> None:
    _add_data(parser)
    parser.add_argument("--models", nargs="+", metavar="NAME", help="only these (default: all)")


def _compare(chosen: Arguments) -> Outcome:
    from pam_model.identify.compare import compare  # noqa: PLC0415  (scipy)

    data = _data(chosen)
    geometry, stated = geometry_to_fit(chosen)
    comparisons = compare(
        data,
        chosen.models,
        geometry,
        fit_geometry=chosen.fit_geometry or geometry is None,
        residual=_residual(chosen, data),
        starts=chosen.starts,
        stated=stated,
    )
    print("\n\n".join(c.table() for c in comparisons))
    _print_assumptions(data)
    if chosen.plot:
        from pam_model.identify.fit_figures import draw_comparison  # noqa: PLC0415  (matplotlib)
        from pam_model.identify.show import save_figure  # noqa: PLC0415

        print(save_figure(draw_comparison(comparisons), make_parents(chosen.plot)))
    return Outcome([c.as_dict() for c in comparisons])


def _declare_design(parser: Parser) -> None:
    def add(name: str, unit: str, text: str, above: float = 0.0, **more: Any) -> None:
        kind = number(unit, above=above)
        parser.add_argument(name, type=kind, metavar="X", help=f"{text} [{unit or '-'}]", **more)

    add("--force", "N", "force at the end of the stroke", required=True)
    add("--stroke", "m", "stroke under that force", required=True)
    add("--pressure", "Pa", "gauge pressure", above=1e4, required=True)
    add("--contraction", "", "stroke over rest length (default: chosen by the program)")
    add("--strand-width", "m", "of the braid (default: %(default)g)", default=0.3e-3)
    parser.add_argument(
        "--strands", type=count(), default=96, help="both families (default: %(default)s)"
    )
    add("--largest-length", "m", "at rest")
    add("--largest-diameter", "m", "contracted")
    add("--strand-strength", "N", "per strand")


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


def _add_data(parser: Parser) -> None:
    parser.add_argument(
        "data", type=input_file, help="CSV: pressure, force, length or shortening, ..."
    )
    add_muscle(parser)
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


COMMANDS = (
    Command(
        "fit",
        "identify the constants of a model from measured points",
        _declare_fit,
        _fit,
        examples=(
            "pam model fit tondu_lopez points.csv --rest-length 0.23 --diameter 0.02 --angle 23",
            "pam model fit sarosi points.csv --size DMSP-10 --rest-length 0.2 --section flexor",
        ),
    ),
    Command(
        "compare",
        "rank models by their errors at measured points",
        _declare_compare,
        _compare,
        examples=("pam model compare points.csv --plot ranking.png",),
    ),
    Command(
        "design",
        "design a muscle for a force, a stroke and a pressure",
        _declare_design,
        _design,
        examples=("pam model design --force 100 --stroke 0.05 --pressure 300000",),
    ),
)
