"""Commands for the controller on rigs that are not their rig file."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_seed
from pam_model.argument_types import count, number, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out, add_rig


def _add_tuned_pid(parser: Parser, least: int, zero: str = "") -> None:
    parser.add_argument(
        "--tries",
        type=count(least),
        default=30,
        metavar="N",
        help=f"gains that the search for the PID tries on each rig{zero} (default: %(default)s, "
        "which takes a minute for each)",
    )
    parser.add_argument(
        "--tuned",
        type=output_file,
        default="out/rough_control/tuned_pid.json",
        metavar="FILE",
        help="file with the gains of earlier searches, read and extended (default: %(default)s)",
    )


def _declare_rough_control(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--effects",
        nargs="+",
        metavar="NAME",
        help='effects to hide, other rigs of reported-swings, "several" for those with several '
        'effects, or "nothing" (default: nothing, then each effect)',
    )
    parser.add_argument(
        "--plant",
        choices=("first", "second"),
        default="first",
        help="independent plant that has the rigs; the laws of the second one are of other "
        "literature (default: %(default)s)",
    )
    parser.add_argument(
        "--observer", action="store_true", help="let the controller use its disturbance observer"
    )
    parser.add_argument(
        "--no-adaptation", action="store_true", help="do not let the controller adapt itself"
    )
    parser.add_argument(
        "--compare-unadapted",
        action="store_true",
        help="play each motion without adaptation as well, and count where what was learnt harms",
    )
    parser.add_argument(
        "--plays",
        type=count(1),
        default=2,
        metavar="N",
        help="how often the controller plays each motion; it learns meanwhile, and its last time "
        "is judged, as that of a PID that was tuned in the same motions (default: %(default)s)",
    )
    _add_tuned_pid(parser, 0, "; 0: no PID")
    parser.add_argument(
        "--tune-pressure-loops",
        action="store_true",
        help="search for the gain of the PID's pressure loops as well",
    )


def _rough_control(given: Arguments) -> Outcome:
    from pam_check.control.rough_control import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_learning(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--effects",
        nargs="+",
        metavar="NAME[+NAME]",
        default=["nothing", "hysteresis", "coulomb_friction", "payload", "hysteresis+payload"],
        help="effects to hide, several at once joined by + (default: %(default)s)",
    )
    parser.add_argument(
        "--repetitions",
        type=count(2),
        default=5,
        metavar="N",
        help="how often the motion is played (default: %(default)s)",
    )


def _learning(given: Arguments) -> Outcome:
    from pam_check.control.repeated_motions import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_stiffness(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--draws", type=count(1), default=20, metavar="N", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--test-motion",
        type=number("rad", least=0.0, most=0.2),
        default=0.0,
        metavar="RAD",
        help="play the small test motion of this amplitude at a drawn position in place of the arm "
        "motion (default: the arm motion)",
    )


def _stiffness(given: Arguments) -> Outcome:
    from pam_check.control.drawn_stiffness import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_adapted_rig(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--draws", type=count(1), default=12, metavar="N", help="(default: %(default)s)"
    )


def _adapted_rig(given: Arguments) -> Outcome:
    from pam_check.control.adapted_rigs import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_improved_rig(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--effects", nargs="+", metavar="NAME", help="effects to hide (default: each)"
    )


def _improved_rig(given: Arguments) -> Outcome:
    from pam_check.control.improved_rigs import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_rough_rig(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    _add_tuned_pid(parser, 1)
    parser.add_argument(
        "--repetitions",
        type=count(2),
        default=5,
        metavar="N",
        help="how often the motion is played to learn it (default: %(default)s)",
    )
    add_out(parser, "out/rough_rig")


def _rough_rig(given: Arguments) -> Outcome:
    from pam_check.control.rough_rig import run  # noqa: PLC0415  (scipy, numba, matplotlib)

    return run(given)


def _declare_trained_policy(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument(
        "--trainings",
        type=count(1),
        default=3,
        metavar="N",
        help="policies that are trained on each robot (default: %(default)s)",
    )
    parser.add_argument(
        "--generations",
        type=count(1),
        default=15,
        metavar="N",
        help="of the search for a policy (default: %(default)s)",
    )
    add_out(parser, "out/trained_policy")


def _trained_policy(given: Arguments) -> Outcome:
    from pam_check.control.trained_policy import run  # noqa: PLC0415  (scipy, numba, gymnasium)

    return run(given)


def _declare_feedback_cost(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)


def _feedback_cost(given: Arguments) -> Outcome:
    from pam_check.control.feedback_cost import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_disturbances(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)


def _disturbances(given: Arguments) -> Outcome:
    from pam_check.control.disturbances import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_reported_swings(parser: Parser) -> None:
    add_rig(parser)
    add_seed(parser, 1)
    parser.add_argument("--rigs", nargs="+", metavar="NAME", help="rigs (default: each)")
    parser.add_argument(
        "--no-adaptation", action="store_true", help="do not let the controller adapt itself"
    )
    parser.add_argument(
        "--ordinary",
        type=number("s", least=0.0, most=3600.0),
        default=0.0,
        metavar="S",
        help="play drawn ordinary motion for so long on each rig with one effect, and look for "
        "false alarms (default: the motions of rough-control, each with a rest)",
    )


def _reported_swings(given: Arguments) -> Outcome:
    from pam_check.control.reported_swings import run  # noqa: PLC0415  (numba)

    return run(given)


DISTURBANCES = Command(
    "disturbances",
    "push a joint that holds, and let the supply sag while it moves; show how far it yields",
    _declare_disturbances,
    _disturbances,
)

COMMANDS = (
    Command(
        "rough-control",
        "hide each effect from the controller and compare its error with a PID tuned on that rig",
        _declare_rough_control,
        _rough_control,
        bad_news="if an error is above 1.1 times the PID's or above that without adaptation, a "
        "joint is in a limit cycle or a valve is at its end",
        examples=(
            "pam check rough-control --tries 0 --compare-unadapted",
            "pam check rough-control --effects hysteresis payload",
        ),
    ),
    Command(
        "learning",
        "repeat a motion with a hidden effect while the controller learns it",
        _declare_learning,
        _learning,
        bad_news="if the last repetition has more than a quarter of the first error and more than "
        "the encoder's noise, or one has more than the first",
        examples=("pam check learning --effects hysteresis coulomb_friction+payload",),
    ),
    Command(
        "stiffness",
        "draw rigs within the tolerance of the rig file and compare the stiffness with the truth",
        _declare_stiffness,
        _stiffness,
        bad_news="if a stiffness is more than 5 % off, or fewer than 85 % of the intervals hold it",
    ),
    Command(
        "adapted-rig",
        "draw rigs with loads and friction, let the controller learn them, and compare its error "
        "with the rig file that is written from what it has learnt",
        _declare_adapted_rig,
        _adapted_rig,
        bad_news="if an error grows with the written file, or fewer than 85 % of the intervals "
        "hold the true number",
    ),
    Command(
        "improved-rig",
        "hide each effect from the controller, diagnose what it recorded, and compare its error "
        "with that of the improved rig file",
        _declare_improved_rig,
        _improved_rig,
        bad_news="if an error above 1 mrad is more than half of that before, or an error grows",
        examples=("pam check improved-rig --effects hysteresis payload",),
    ),
    Command(
        "rough-rig",
        "play a motion on a rough rig and on a clean one: a tuned PID, the controller, after a "
        "diagnosis, and after learning",
        _declare_rough_rig,
        _rough_rig,
        bad_news="if the controller is worse than before after the diagnosis or after learning, or "
        "then worse than the PID",
    ),
    Command(
        "trained-policy",
        "train policies in simulation, with and without what a diagnosis found, and try them on "
        "the true rig",
        _declare_trained_policy,
        _trained_policy,
        bad_news="if a policy that was trained with the diagnosis is worse than one without",
    ),
    Command(
        "feedback-cost",
        "design the feedback with several leads, margins and filters, and show how well each "
        "rejects disturbances and how much the valves work",
        _declare_feedback_cost,
        _feedback_cost,
    ),
    DISTURBANCES,
    Command(
        "reported-swings",
        "hide effects, pairs of them and delays, and show which joints swing at rest and when the "
        "controller reports it",
        _declare_reported_swings,
        _reported_swings,
        bad_news="if a joint swings at rest and this is not reported within 3 s, or with "
        "--ordinary something is reported of a joint that does not swing",
        examples=(
            'pam check reported-swings --rigs payload "commands 30 ms" --no-adaptation',
            "pam check reported-swings --ordinary 140",
        ),
    ),
)
