"""`python -m pam_model`: list, show, fit and compare models, design a muscle, draw the gallery."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pam_model.errors import PamError
from pam_model.identify.catalogue import FAMILIES, catalogue, find_row
from pam_model.identify.measurements import Measurements, load_measurements
from pam_model.muscles.force_model import MuscleGeometry, create_force_model, registered_models


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 2 after a user's mistake, which is told in one line."""
    chosen = _parser().parse_args(arguments)
    try:
        chosen.run(chosen)
    except PamError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader has seen enough; keep the interpreter from flushing into the closed pipe.
        sys.stderr.close()
        return 1
    return 0


def _list(chosen: argparse.Namespace) -> None:
    rows = catalogue()
    if chosen.json:
        print(json.dumps([{n: getattr(r, n) for n in r.__dataclass_fields__} for r in rows]))
        return
    known = registered_models()
    for family in FAMILIES:
        print(family.upper())
        for row in (r for r in rows if r.family == family):
            names = [name for name in row.models if name in known]
            print(f"  {row.key:28s} {row.equations or '-':34s} {row.status}")
            print(f"      {row.title}" + (f"; model {', '.join(names)}" if names else ""))


def _show(chosen: argparse.Namespace) -> None:
    from pam_model.identify.gallery import default_model, draw_row  # noqa: PLC0415  (matplotlib)
    from pam_model.identify.show import PRESSURES, draw_force_model, save_figure  # noqa: PLC0415

    row = find_row(chosen.name)
    pressures = chosen.pressures or PRESSURES
    geometry, constants = _geometry(chosen), _constants(chosen.set)
    name = chosen.name if chosen.name in registered_models() else ""
    if not name and (geometry or constants or chosen.pressures):
        name = next((n for n in row.models if n in registered_models()), "")
        if not name:
            raise PamError(f"{row.key} is no length-force model: its picture has fixed numbers")
    if not name:
        figure = draw_row(row)
    else:
        if geometry is None:
            _, geometry = default_model(name)
        model = create_force_model(name, geometry, constants)
        figure = draw_force_model(model, geometry.rest_length, pressures)
    print(f"{row.title}: equations {row.equations or '-'}, {row.status}")
    print(f"  domain: {row.domain}\n  use it: {row.use}\n  not for: {row.avoid}")
    print(save_figure(figure, chosen.output or Path(f"{chosen.name}.png")))


def _fit(chosen: argparse.Namespace) -> None:
    from pam_model.identify.fit import fit  # noqa: PLC0415  (scipy)

    if chosen.name not in registered_models():
        raise PamError(
            f"{chosen.name} is no length-force model; known: {', '.join(registered_models())}"
        )
    data = _data(chosen)
    geometry = _geometry(chosen)
    results = []
    for branch, points in data.branches().items():
        result = fit(
            chosen.name,
            points,
            geometry,
            _constants(chosen.set),
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
            print(save_figure(draw_fit(result, points), path))
    _print_assumptions(data)
    if chosen.json:
        _write_json(chosen.json, results)


def _compare(chosen: argparse.Namespace) -> None:
    from pam_model.identify.compare import compare, save_comparison  # noqa: PLC0415  (scipy)

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

        print(save_figure(draw_comparison(comparisons), chosen.plot))
    if chosen.json:
        save_comparison(comparisons, chosen.json)
        print(chosen.json)


def _design(chosen: argparse.Namespace) -> None:
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
    if chosen.json:
        _write_json(chosen.json, made.as_dict())


def _gallery(chosen: argparse.Namespace) -> None:
    from pam_model.identify.gallery import write_gallery  # noqa: PLC0415  (matplotlib)

    written = write_gallery(chosen.folder)
    size = sum(path.stat().st_size for path in written)
    print(f"{len(written)} files, {size / 1e6:.2f} MB in {chosen.folder}")


def _data(chosen: argparse.Namespace) -> Measurements:
    data = load_measurements(chosen.data, load_share=chosen.load_share)
    if chosen.pressure_bands:
        data = data.with_pressure_blocks(chosen.pressure_bands)
    return data


def _residual(chosen: argparse.Namespace, data: Measurements) -> Literal["force", "length"]:
    # A displacement under a known load is what was measured; a force at a set length likewise.
    if chosen.residual == "force" or (chosen.residual is None and not data.is_shortening):
        return "force"
    return "length"


def _print_assumptions(data: Measurements) -> None:
    for assumption in data.assumptions:
        print(f"assumed: {assumption}")


def _geometry(chosen: argparse.Namespace) -> MuscleGeometry | None:
    given = [chosen.thread_length, chosen.turns, chosen.rest_length]
    if all(value is None for value in given):
        return None
    if any(value is None for value in given):
        raise PamError("--thread-length [m], --turns and --rest-length [m] are given together")
    return MuscleGeometry(
        chosen.thread_length, chosen.turns, chosen.rest_length, chosen.wall_thickness
    )


def _constants(pairs: Sequence[str]) -> dict[str, float]:
    constants = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        try:
            constants[name] = float(value)
        except ValueError:
            raise PamError(f"--set {pair}: expected NAME=NUMBER") from None
    return constants


def _write_json(path: Path, content: object) -> None:
    try:
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise PamError(f"{path}: cannot be written: {error}") from error
    print(path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pam_model", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    command = commands.add_parser("list", help="every model, its equations and status")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_list)

    command = commands.add_parser("show", help="draw a model")
    command.add_argument("name", help="as `list` gives it")
    command.add_argument("--pressures", type=float, nargs="+", help="gauge [Pa]")
    command.add_argument("--output", type=Path, help="PNG or SVG file (NAME.png)")
    _add_muscle(command)
    command.set_defaults(run=_show)

    command = commands.add_parser("fit", help="identify a model's constants from measured points")
    command.add_argument("name", help="a length-force model")
    _add_data(command)
    command.set_defaults(run=_fit)

    command = commands.add_parser("compare", help="rank models on measured points")
    command.add_argument("--models", nargs="+", help="only these (all)")
    _add_data(command)
    command.set_defaults(run=_compare)

    command = commands.add_parser("design", help="from force, stroke and pressure to a muscle")
    for name, unit in (("--force", "N"), ("--stroke", "m"), ("--pressure", "Pa gauge")):
        command.add_argument(name, type=float, required=True, help=f"[{unit}]")
    command.add_argument("--contraction", type=float, help="stroke over rest length (0.2)")
    command.add_argument("--strand-width", type=float, default=0.3e-3, help="[m] (%(default)g)")
    command.add_argument("--strands", type=int, default=96, help="both families (%(default)s)")
    command.add_argument("--largest-length", type=float, help="[m], at rest")
    command.add_argument("--largest-diameter", type=float, help="[m], contracted")
    command.add_argument("--strand-strength", type=float, help="[N] per strand")
    command.add_argument("--json", type=Path, help="also write JSON here")
    command.set_defaults(run=_design)

    command = commands.add_parser("gallery", help="pictures and table of models for the docs")
    command.add_argument("folder", type=Path, nargs="?", default=Path("docs"), help="(docs)")
    command.set_defaults(run=_gallery)
    return parser


def _add_muscle(command: argparse.ArgumentParser) -> None:
    command.add_argument("--thread-length", type=float, help="b [m]")
    command.add_argument("--turns", type=float, help="n")
    command.add_argument("--rest-length", type=float, help="[m]")
    command.add_argument("--wall-thickness", type=float, default=0.0, help="[m] (%(default)g)")
    command.add_argument(
        "--set", nargs="+", default=[], metavar="NAME=NUMBER", help="a constant of the model"
    )


def _add_data(command: argparse.ArgumentParser) -> None:
    command.add_argument("data", type=Path, help="CSV: pressure, force, length or shortening, ...")
    _add_muscle(command)
    command.add_argument(
        "--fit-geometry", action="store_true", help="also fit rest length, braid angle, diameter"
    )
    command.add_argument("--residual", choices=("force", "length"), help="what is minimised")
    command.add_argument(
        "--pressure-bands", type=int, help="hold out this many bands of pressure, not the blocks"
    )
    command.add_argument(
        "--load-share", type=int, default=6, help="staircase: muscles that carry the weight (6)"
    )
    command.add_argument(
        "--starts", type=int, default=4, help="starts of each fit: more find better optima (4)"
    )
    command.add_argument("--plot", type=Path, help="PNG or SVG file")
    command.add_argument("--json", type=Path, help="also write JSON here")


if __name__ == "__main__":
    raise SystemExit(main())
