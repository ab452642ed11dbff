"""Write the report of an identification: one self-contained HTML file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stickslip.analyse.wording import ends
from stickslip.core.finding import Finding
from stickslip.core.messages import code_of
from stickslip.core.record import Record
from stickslip.core.whole_files import write_whole
from stickslip.identification.estimate import Estimate, Held, Identification, Picture
from stickslip.identification.output_error.search import FittedAxis
from stickslip.report.answers import answers_of, meaning_of, one_number_each, speeds_in
from stickslip.report.axis_evidence import GOOD_CODE, judgements
from stickslip.report.axis_pictures import data_pictures, pictures_of
from stickslip.report.identification import HEIGHT, panel_of
from stickslip.report.page import filled
from stickslip.report.sliding_torque import sliding_of
from stickslip.report.svg import embedded_svg

TABLE = 15
"""Number of estimates above which a table of all correlations is too wide."""
STRONG = 0.9
GREEK = {
    "sigma": "σ",
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "tau": "τ",
    "phi": "φ",
    "kappa": "κ",
}
LABELS = {
    "parameters": ("free parameters", "", 1.0),
    "held_out": ("held-out misfit", "standard deviations", 1.0),
    "rms_Nm": ("residual", "N·m, RMS", 1.0),
    "relative": ("residual over the torque", "", 1.0),
    "cross_validated": ("left-out error over the torque", "", 1.0),
    "cross_validated_Nm": ("left-out error", "N·m, RMS", 1.0),
    "rms_N": ("residual", "N, RMS", 1.0),
    "cross_validated_N": ("left-out error", "N, RMS", 1.0),
    "aicc": ("AICc", "", 1.0),
    "bic": ("BIC", "", 1.0),
}


@dataclass(frozen=True, eq=False)
class Source:
    """One record in the report: name, findings and source."""

    name: str
    record: Record
    findings: Sequence[Finding] = ()
    about: Mapping[str, Any] = field(default_factory=dict[str, Any])
    held_out: bool = False


def write_identification(
    path: str | os.PathLike[str], found: Identification, sources: Sequence[Source], *, title: str = "",
    versions: Mapping[str, str] | None = None, headline: Sequence[tuple[str, str]] = (),
    model_file: str | os.PathLike[str] | None = None,
) -> Path:  # fmt: skip
    """Write the report of an identification.

    Parameters
    ----------
    path : path
        Of the HTML file.
    found : Identification
    sources : sequence of Source
        The records with the doctor's findings.
    title : str
    versions : mapping
        Versions of the software.
    headline : sequence of (str, str)
        Lines at the top: a word and a text each.
    model_file : path, optional
        Path of the model in the next command; default: next to the report.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    model = Path(model_file) if model_file is not None else Path(path).with_name("model.toml")
    return write_whole(Path(path), rendered(found, sources, title, versions or {}, headline, model))


def rendered(
    found: Identification,
    sources: Sequence[Source],
    title: str,
    versions: Mapping[str, str],
    headline: Sequence[tuple[str, str]] = (),
    model_file: str | os.PathLike[str] = "model.toml",
) -> str:
    """Return the HTML."""
    fitted = [s for s in sources if not s.held_out]
    records = [s.record for s in fitted]
    answers = answers_of(found, records, Path(model_file), files_of(fitted))
    pictures = pictures_of(found, speeds_in(records))
    rest = [p for p in pictures if p.name.startswith("residual-") or p.name.endswith("-residuals")]
    law_picture, torque = headed(pictures, rest)
    shown_first = {p.name for p in (*law_picture, *torque)}
    rest = [p for p in rest if p.name not in shown_first]
    law = found.model.law if found.model else None
    method = found.method.replace("_", " ")
    columns, rows = comparison_of(found)
    meanings = meaning_of(found)
    parts = {
        "data": figures(data_pictures([s.record for s in sources], [s.name for s in sources])),
        "friction": figures(law_picture), "trust": figures(torque),
        "fits": figures([p for p in pictures if p not in rest and p.name not in shown_first]),
        "residuals": figures(rest),
    }  # fmt: skip
    return filled(
        "commission.html" if headline else "identification.html",
        headline=headline,
        title=title or f"Friction identified: {sources[0].name if sources else method}",
        ran=ran(found, sources, versions),
        law=f"{law.title or law.name}" if law else "",
        answers=answers, open_loop=open_loop(found),
        tally=tally(found, sources),
        estimates=[
            *(shown(e, meanings[e.name]) for e in found.estimates),
            *(known(h, meanings[h.name]) for h in found.held),
        ],
        missing=one_number_each(found.estimates), given=bool(found.held),
        notes=[n for n in found.notes if n not in answers.told],
        misfit=[
            {"name": k.replace("_", " "), "value": number(float(v)), "unit": found.misfit_unit(k)}
            for k, v in found.misfit.items()
        ],
        sources=[source(s) for s in sources],
        columns=columns, rows=rows, parts=parts,
        correlation=correlation(found),
        result=json.dumps(found.as_dict() | answers.as_dict(), indent=1, default=str, ensure_ascii=False),
    )  # fmt: skip


def ran(found: Identification, sources: Sequence[Source], versions: Mapping[str, str]) -> str:
    """Return a line on method and records."""
    rows = sum(len(s.record) for s in sources)
    words = (
        f"Method {found.method.replace('_', ' ')} on {len(sources)} record{'s' if len(sources) != 1 else ''}"
    )
    named = ", ".join(f"{k} {v}" for k, v in versions.items())
    return f"{words} with {rows} samples. {named}".strip()


def files_of(sources: Sequence[Source]) -> list[str]:
    """Return the files of the records without duplicates."""
    return [f for f in dict.fromkeys(str(s.about.get("file", "")) for s in sources) if f]


def headed(pictures: Sequence[Picture], rest: Sequence[Picture]) -> tuple[list[Picture], list[Picture]]:
    """Return the pictures at the top: the friction curve, and measured and model torque."""
    curve = [p for p in pictures if p.name == "sliding-curve"][:1]
    torque = [p for p in pictures if p.name in ("torque-stretch", "torque-velocity")]
    others = [p for p in pictures if p not in rest and p not in torque]
    return curve or others[:1], torque or list(rest[:1])


def open_loop(found: Identification) -> bool:
    """Whether position misfits come from an open-loop simulation with the recorded torque."""
    output = found.details.get("output")
    return isinstance(output, FittedAxis) and not all(t.closed_loop for t in output.problem.experiments)


def tally(found: Identification, sources: Sequence[Source]) -> list[dict[str, Any]]:
    """Return the key numbers of the result."""
    good = sum(e.identified for e in found.estimates)
    warnings = sum(f.level == "warning" for s in sources for f in s.findings)
    out: list[dict[str, Any]] = [
        {"count": f"{good} of {len(found.estimates)}", "words": "numbers identified"},
        {"count": str(warnings), "words": "warnings about the records"},
    ]
    if (sliding := sliding_of(found)) is not None:
        out.append(
            {
                "count": f"{100.0 * sliding.relative:.3g} %",
                "words": "torque error in gross sliding",
            }
        )
    for name, words in (
        ("force_relative", "force error over the whole record"),
        ("inverse_dynamics_relative", "force error of plain least squares"),
        ("held_out_force_relative", "force error held out"),
    ):  # fmt: skip
        if math.isfinite(float(found.misfit.get(name, math.nan))):
            out.append({"count": f"{100.0 * float(found.misfit[name]):.3g} %", "words": words})
    judged = judgements(found) if not open_loop(found) else {}
    for name, words in (
        ("position_relative", "position error of the simulation"),
        ("drive_relative", "drive error of the simulation"),
    ):  # fmt: skip
        if name in found.misfit and not open_loop(found):
            told = judged.get(name, "")
            count = f"{100.0 * float(found.misfit[name]):.3g} %"
            out.append({"count": count, "words": words, "judged": told, "good": code_of(told) == GOOD_CODE})
    return out


def number(value: float) -> str:
    """Return a number as text."""
    if not math.isfinite(value):
        return "no limit" if math.isinf(value) else "unknown"
    return f"{value:.4g}"


def interval(e: Estimate) -> str:
    """Return the 95 % interval as text."""
    if math.isnan(e.lower) or math.isnan(e.upper):
        return "unknown"
    return "-" if e.undetermined else " to ".join(ends(e.value, e.lower, e.upper))


def shown(e: Estimate, meaning: str = "") -> dict[str, Any]:
    """Return an estimate as a row; if the interval is unlimited, the value is not shown."""
    value, verdict, chosen = number(e.value), e.verdict, ""
    if e.undetermined:
        value, chosen = "not determined", f"the model's {value} is one choice among many"
        verdict = f"{verdict}; {chosen}" if verdict else chosen
    return {
        "name": e.name, "meaning": meaning, "unit": e.unit, "value": value, "interval": interval(e),
        "good": e.identified, "verdict": verdict, "chosen": chosen,
        "symbol": symbol(e.symbol if meaning and e.symbol != e.name else ""),
    }  # fmt: skip


def known(h: Held, meaning: str) -> dict[str, Any]:
    """Return a given number as a row."""
    return {
        "name": h.name, "meaning": meaning, "unit": h.unit, "value": number(h.value), "interval": "-", "given": True,
        "symbol": symbol(h.symbol if meaning else ""),
    }  # fmt: skip


def symbol(text: str) -> tuple[str, str]:
    """Return a symbol and its index: sigma_2 as σ and 2, and F_C^-, for v < 0, as F and C⁻."""
    base, _, index = text.partition("_")
    return GREEK.get(base, base), index.replace("^-", "⁻")


def source(s: Source) -> dict[str, Any]:
    """Return a record for the report's list."""
    seconds = float(s.record.time[-1] - s.record.time[0]) if len(s.record) else 0.0
    reading: Mapping[str, Any] = s.record.meta.get("reading", {})
    channels = ", ".join(
        f"{c['channel']} from {c['column']!r} ({c['unit']})" for c in reading.get("columns", [])
    )
    return {
        "name": s.name, "what": "held out" if s.held_out else "fitted", "rows": len(s.record),
        "seconds": f"{seconds:.4g}", "channels": channels, "sha256": str(s.about.get("sha256", ""))[:16],
        "findings": [{"level": f.level, "code": f.code, "line": f.line()} for f in s.findings],
    }  # fmt: skip


def comparison_of(found: Identification) -> tuple[list[str], list[dict[str, Any]]]:
    """Return columns and rows of the comparison of laws; empty for a single law."""
    rows: list[dict[str, Any]] = []
    chosen = found.model.law.name if found.model else ""
    for c in found.details.get("candidates", ()):
        blocks: list[float] = [] if c.failure else list(c.score)
        score = math.sqrt(math.fsum(blocks) / len(blocks)) if blocks else math.nan
        cells: dict[str, float] = {"parameters": float(c.parameters), "held_out": score}
        rows.append({"law": c.law, "chosen": c.law == chosen, "failure": c.failure, "cells": cells})
    table: dict[str, dict[str, float]] = found.details.get("comparison", {})
    picked = found.details.get("chosen", chosen)
    for name, cells in table.items():
        rows.append({"law": name, "chosen": name == picked, "failure": "", "cells": cells})
    keys = list(dict.fromkeys(k for row in rows for k in row["cells"]))
    columns = [f"{LABELS[k][0]}{f' ({LABELS[k][1]})' if LABELS[k][1] else ''}" for k in keys]
    out = [{**row, "cells": [number(row["cells"].get(k, math.nan)) for k in keys]} for row in rows]
    return columns, out


def correlation(found: Identification) -> dict[str, Any]:
    """Return names and rows of the correlation, with values above 0.9 marked."""
    names = [e.name for e in found.estimates]
    none: dict[str, Any] = {"names": [], "rows": [], "pairs": [], "many": 0}
    if len(names) < 2 or found.correlation.shape != (len(names), len(names)):
        return none
    if len(names) > TABLE:
        strong = [
            {"names": f"{names[i]}, {names[j]}", "text": f"{found.correlation[i, j]:.2f}"}
            for i in range(len(names)) for j in range(i) if abs(found.correlation[i, j]) > STRONG
        ]  # fmt: skip
        return {**none, "pairs": strong, "many": len(names)}
    rows = [
        {"name": n, "cells": [
            {"text": f"{c:.2f}" if math.isfinite(c) else "-", "strong": i != j and math.isfinite(c) and abs(c) > STRONG}
            for j, c in enumerate(row)
        ]}
        for i, (n, row) in enumerate(zip(names, found.correlation.tolist(), strict=True))
    ]  # fmt: skip
    return {**none, "names": names, "rows": rows}


def figures(pictures: Sequence[Picture]) -> list[dict[str, Any]]:
    """Draw pictures and embed them."""
    return [
        {"id": p.name, "title": p.title, "caption": p.message}
        | embedded_svg(p.title, p.message, panel_of(p), HEIGHT)
        for p in pictures
    ]
