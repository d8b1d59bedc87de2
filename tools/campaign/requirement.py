"""Whether a scenario kept what its campaign requires."""

from tools.campaign.scenario import Require, Row


def broken(require: Require, row: Row, *, refusal: str = "") -> str:
    """Return what of ``require`` was not kept, in words; empty: everything was.

    ``refusal`` is why the controller let nobody command, when it last said so.
    """
    told: list[str] = []
    if row["stops"] > require.stops:
        first = f", the first at {row['first_stop_s']} s: {row['first_stop']}"
        told.append(f"{row['stops']} stops (allowed: {require.stops}){first}")
    if require.margin_used is not None and row["margin_used"] > require.margin_used:
        used = f"{row['margin_used']:.1%} of the limit of {row['margin_monitor']} used"
        told.append(f"{used} (allowed: {require.margin_used:.1%})")
    latency_us = row["answer_latency_p99_us"]
    if require.answer_latency_p99_us is not None and (latency_us or 0.0) > require.answer_latency_p99_us:
        told.append(f"99 % of the answers within {latency_us:g} us (allowed: {require.answer_latency_p99_us:g} us)")
    if require.late_answers is not None and row["late_answers"] > require.late_answers:
        told.append(f"{row['late_answers']} late answers (allowed: {require.late_answers})")
    if require.commanded and row["commanded_s"] <= 0.0:
        answered = f" ({row['answers']} answers, {row['late_answers']} of them late, quality {row['quality']})"
        told.append(f"nobody commanded the arm{answered if row['messages'] else ''}{f': {refusal}' if refusal else ''}")
    return "; ".join(told)
