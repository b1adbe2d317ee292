"""The feedback of one joint alone, as the rows of the control cycle hold it."""

from __future__ import annotations

from pam_control.feedback.pid import N_FEEDBACK, PidGains, begin_feedback


def feedback(gains: PidGains) -> tuple[list[float], int, int]:
    """A row with the state and these gains, and where both begin."""
    row = [0.0] * N_FEEDBACK + gains.row
    begin_feedback(row, 0, 0.0)
    return row, 0, N_FEEDBACK
