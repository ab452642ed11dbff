"""Findings that question a unit or sign from a profile: they name the profile and how to read a file without it.

A profile applies to files with the same column names; another drive may use these names with other units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.identification.doctor.view import View

MOTION, DRIVEN = ("position", "velocity", "time"), ("motor_torque", "current", "friction_torque")
CONCERNS = {
    "position-unit": MOTION, "velocity-unit": MOTION, "time-unit": MOTION, "velocity-mismatch": MOTION,
    "velocity-sign": ("velocity", "position"), "position-reference-unit": ("position_reference", "position"),
    "reference-scale": ("position_reference", "position"), "torque-sign": (*DRIVEN, "position", "velocity"),
    "torque-unit": DRIVEN, "torque-magnitude": DRIVEN,
}  # fmt: skip
"""Channels whose units a finding questions, by its code."""


def told(findings: Sequence[Finding], view: View) -> list[Finding]:
    """Return the findings; those that question a profile's unit name the profile."""
    return [_told(finding, view) for finding in findings]


def _told(finding: Finding, view: View) -> Finding:
    # A current from which the torque is computed is questioned with it, a separate one is not.
    beside = {"current"} if "motor_torque" in view.columns else set[str]()
    by = [c for c in CONCERNS.get(finding.code, ()) if c not in beside and c in view.columns]
    by = [c for c in by if view.columns[c].by_profile]
    if not by:
        return finding
    saved = bool(_reading(view).get("saved_profile"))
    whose = "a saved profile, found by the names of the columns," if saved else "the profile"
    units = " and ".join(f"{c} in {view.columns[c].unit}" for c in by)
    without = name_columns(**{c: view.name(c) for c in by})
    also = f"; {name_option('profile', 'NEW.toml')} leaves out all that it says" if saved else ""
    message = f"{finding.message}; {whose} says {units}"
    remedy = f"{finding.remedy}, or {without} to leave that out{also}"
    turned = [c for c in by if view.columns[c].unit.startswith("-")]
    if turned and finding.code.endswith("-sign"):
        # A sign set for another file is questioned first.
        profile = f"the profile {_reading(view)['saved_profile']}" if saved else "the profile"
        undo = "delete that file" if saved else "correct it there"
        whether = "if this log's own sign is right"
        remedy = f"{profile} turned the sign of {' and '.join(turned)}: {undo}, {whether}; else {remedy}"
    return replace(finding, message=message, remedy=remedy)


def _reading(view: View) -> dict[str, Any]:
    return view.record.meta.get("reading", {})
