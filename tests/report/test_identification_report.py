"""The report of an identification: units, records by their names, and no table that nobody can read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification
from stickslip.report.identified import Source, write_identification
from stickslip.report.plots import quantity, tied


def found(count: int, **details: object) -> Identification:
    estimates = tuple(
        Estimate(f"p{i}", "N·m", "p", 1.0, 0.1, 0.8, 1.2, identified=True) for i in range(count)
    )
    correlation = np.eye(count)
    correlation[0, 1] = correlation[1, 0] = -0.95
    return Identification(
        "axis", None, estimates, correlation,
        {"rms_Nm": 2e-3, "position_rms": 1e-4, "held_out_drive_rms": 0.1, "position_relative": 0.02}, details=details,
    )  # fmt: skip


@pytest.fixture(scope="module")
def source() -> Source:
    time = 1940.0 + 0.01 * np.arange(600)
    record = Record(time, {"position": np.sin(time)}, {"position": "rad"})
    return Source("presliding", record)


def page(tmp_path: Path, result: Identification, source: Source) -> str:
    return write_identification(tmp_path / "report.html", result, [source]).read_text(encoding="utf-8")


def test_misfits_have_units(tmp_path: Path, source: Source) -> None:
    result = found(3, units={"position": "m", "drive": "A"})
    units = {name: result.misfit_unit(name) for name in result.misfit}
    assert units == {
        "rms_Nm": "N·m",
        "position_rms": "m",
        "held_out_drive_rms": "A",
        "position_relative": "",
    }
    assert '<tr><td>held out drive rms</td><td>0.1</td><td class="unit">A</td></tr>' in page(
        tmp_path, result, source
    )


def test_many_correlations_are_listed_only_where_they_are_strong(tmp_path: Path, source: Source) -> None:
    few = page(tmp_path, found(15), source)
    assert few.count('class="best">-0.95') == 2
    many = page(tmp_path, found(16), source)
    assert "<td>p1, p0</td><td>-0.95</td>" in many
    assert many.count("-0.95</td>") == 1


def test_records_are_drawn_under_their_names_from_their_first_sample(tmp_path: Path, source: Source) -> None:
    shown = page(tmp_path, found(3), source)
    assert 'alt="presliding: position. 600 samples over 5.99 s"' in shown


def test_a_number_and_its_unit_stay_on_one_line() -> None:
    nbsp = "\N{NO-BREAK SPACE}"
    assert tied("12.2 mrad RMS, PD 36 Hz") == f"12.2{nbsp}mrad RMS, PD 36{nbsp}Hz"
    assert tied("95 % of 3 N·m") == f"95{nbsp}% of 3{nbsp}N·m"
    assert tied("12 standstills, PD 5 mrads") == "12 standstills, PD 5 mrads"
    assert quantity(-3.67e-3, "N·m") == "-3.67 mN·m"
