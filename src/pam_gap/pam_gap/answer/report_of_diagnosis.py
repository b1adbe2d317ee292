"""What the report page shows of a diagnosis: its answer, and traces along the first recording."""

from __future__ import annotations

import numpy as np

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.headline import headline
from pam_gap.answer.report import RankedCandidate, ReportData, StageBar
from pam_gap.answer.traces import RETUNED, WITH_ANSWER, Trace
from pam_gap.answer.user_units import plain
from pam_gap.prediction.channel_order import UNITS
from pam_gap.prediction.channels import block_means
from pam_gap.prediction.problem import PredictionProblem


def traces_of(problem: PredictionProblem, diagnosis: Diagnosis) -> list[Trace]:
    """Measured, nominal and improved predictions of the first recording."""
    known = [diagnosis.written_values, diagnosis.improved_values]
    if diagnosis.closest_values is not None:
        known.append(diagnosis.closest_values)
    vectors = np.array(known)
    errors = problem.errors(vectors)[:, : problem.offsets[1]]
    data = problem.data[0]
    rows = errors.shape[1]
    time = problem.row_time[:rows]
    has_answer = diagnosis.verdict != "not_identifiable"
    limits = {size.channel: size.limit for size in diagnosis.sizes}
    traces = []
    for c in np.nonzero(problem.present)[0]:
        measured = block_means(data.measured[:, c], problem.block)
        predicted = measured - errors[:, :, c] * data.block_deviation[c]
        traces.append(
            Trace(
                channel=problem.names[c],
                unit=UNITS[c],
                time=time,
                measured=measured,
                nominal=predicted[0],
                improved=predicted[1] if has_answer else None,
                closest=predicted[2] if len(known) > 2 else None,
                closest_name=" + ".join(diagnosis.ranking[0].effects) if diagnosis.ranking else "",
                improved_name=WITH_ANSWER if diagnosis.effects else RETUNED,
                limit=limits.get(problem.names[c], 0.0),
            )
        )
    return traces


def _delay(seconds: float) -> str:
    """A delay in words; what rounds to nothing is not called late or early."""
    shown = round(1e3 * seconds, 1)
    if shown == 0.0:
        return "by less than 0.05 ms"
    return f"{plain(shown)} ms late" if shown > 0.0 else f"{plain(-shown)} ms early"


def report_data(problem: PredictionProblem, diagnosis: Diagnosis, improved_name: str) -> ReportData:
    """The content of the report page for a diagnosis."""
    location = diagnosis.location
    stages = [] if location is None else list(location.stages)
    shown = [StageBar(s.stage, s.gap_over_floor, s.note) for s in stages]
    if location is not None and location.delays:
        late = "; ".join(f"{name} {_delay(delay)}" for name, delay in location.delays)
        words = f"{late}, against the re-tuned rig file; friction and lag shift signals too"
        shown.append(StageBar("sensing", None, words))
    return ReportData(
        title=f"Diagnosis of {diagnosis.joint}",
        headline=headline(diagnosis),
        verdict_sentence=diagnosis.sentence,
        diagnosis=diagnosis.to_json(),
        stages=shown,
        regimes=[] if location is None else [
            (name, share) for name, share in location.regimes[:4] if share > 1.1
        ],
        traces=traces_of(problem, diagnosis),
        ranking=[
            RankedCandidate(
                entry.label or " + ".join(entry.effects),
                entry.weight,
                entry.remaining.value,
                entry.remaining.low,
                entry.remaining.high,
                entry.note,
            )
            for entry in diagnosis.ranking
        ],
        horizons=[
            (f.horizon, f.channel, f.before, f.after, f.floor, f.unit) for f in diagnosis.horizons
        ],
        repairs=diagnosis.repairs,
        left_out=diagnosis.left_out,
        improved_rig=improved_name,
        facts={
            "simulations of the recording": f"{diagnosis.facts.get('simulations', 0):.0f}",
            "time": f"{diagnosis.facts.get('seconds', 0):.1f} s",
        },
    )  # fmt: skip
