"""Commands that show the models."""

from __future__ import annotations

from pathlib import Path

from pam_model.argument_types import make_parents, number, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser, no_arguments
from pam_model.commands.muscle_arguments import add_muscle, given_geometry
from pam_model.errors import PamError


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


def _declare_show(parser: Parser) -> None:
    parser.add_argument("name", help="name as printed by `list`")
    parser.add_argument(
        "--pressures", type=number("Pa", above=1e3), nargs="+", metavar="PA", help="gauge [Pa]"
    )
    parser.add_argument(
        "--output", type=output_file, metavar="FILE", help="PNG or SVG file (default: NAME.png)"
    )
    add_muscle(parser)


def _show(chosen: Arguments) -> Outcome:
    from pam_model.catalogue.catalogue import find_row  # noqa: PLC0415  (numpy)
    from pam_model.catalogue.default_model import default_model  # noqa: PLC0415
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
    known = registered_models()
    geometry, constants = given_geometry(chosen), dict(chosen.set)
    name = next((name for name in (chosen.name, *row.models) if name in known), "")
    picture = None
    if name:
        if geometry is None:
            _, geometry = default_model(name)
        model = create_force_model(name, geometry, constants)
        figure = draw_force_model(model, geometry.rest_length, chosen.pressures or PRESSURES)
        picture = save_figure(figure, make_parents(chosen.output or Path(f"{chosen.name}.png")))
    elif geometry or constants or chosen.pressures or chosen.output:
        raise PamError(
            f"{row.key} is not a length-force model; docs/models.md has its picture, with fixed "
            "numbers"
        )
    print(f"{row.title}: equations {row.equations or '-'}, {row.status}")
    print(f"  domain: {row.domain}\n  suited for: {row.use}\n  not suited for: {row.avoid}")
    print(picture or f"  code: {', '.join(row.objects)}")
    facts = {n: getattr(row, n) for n in row.__dataclass_fields__}
    return Outcome({**facts, "picture": picture})


COMMANDS = (
    Command("list", "list every model, its equations and status", no_arguments, _list),
    Command(
        "show",
        "describe a model, and draw a length-force model",
        _declare_show,
        _show,
        examples=("pam model show tondu_lopez --set k=1.2 --output muscle.png",),
    ),
)
