"""What `recommend` tries besides the identified laws: compensators of the catalogue, and controllers of the user's."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from stickslip.control.catalogue import CATALOGUE
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option
from stickslip.models.model import Model
from stickslip.recommendation.beside import Own
from stickslip.recommendation.candidate_run import Drive

Given = Controller | str | os.PathLike[str]
"""A name of the catalogue, a controller, or the path of a TOML file with a table [controller]."""


def compensators_of(given: Sequence[Given]) -> tuple[Given, ...]:
    """Names of the catalogue, all of it for ("all",), and controllers with their files.

    Raises
    ------
    UnknownName
        If there is none of a name.
    InputError
        If "all" stands beside another name of the catalogue, or there is no such file.
    """
    names = [name for name in given if isinstance(name, str) and not is_file(name)]
    if "all" in names and len(names) > 1:
        raise InputError(
            f"{name_option('compensators', ','.join(names))}: 'all' stands alone; give it without the others, "
            "or leave it out"
        )
    for name in names:
        if name not in (*CATALOGUE, "all"):
            raise UnknownName("compensator", name, (*CATALOGUE, "all"))
    for file in given:
        if is_file(file) and not Path(str(file)).is_file():
            raise InputError(
                f"{name_option('compensators', file)}: there is no such file; give a TOML file with a table "
                "[controller]"
            )
    return tuple(each for name in given for each in (CATALOGUE if name == "all" else [name]))


def is_file(given: Given) -> bool:
    """Whether it is the path of a controller's file."""
    return isinstance(given, os.PathLike) or (isinstance(given, str) and given.endswith(".toml"))


IDENTIFIED = "identified"
"""What ``friction`` of a controller's file may name: the identified law."""


def made_for(
    given: Sequence[Given], drive: Drive, inertia: float | None, friction: Model
) -> tuple[str | Own, ...]:
    """The same, with every controller as the drive runs it.

    Parameters
    ----------
    given : sequence
        As `compensators_of` gives them.
    drive : Drive
    inertia : float or None
        Of the axis, kg·m², where a file has no ``[axis]``.
    friction : Model
        The identified law.

    Raises
    ------
    InputError
        If a file's controller cannot be read, or one is made for another drive.
    """
    made: list[str | Own] = []
    for each in given:
        if isinstance(each, Controller):
            made.append(Own(parts_of(each), run_by(drive, each, parts_of(each))))
        elif is_file(each):
            read = read_controller(Path(each), inertia, {IDENTIFIED: friction}, drive.sample_time)
            made.append(Own(Path(each).stem, run_by(drive, read, str(each))))
        else:
            made.append(str(each))
    return tuple(made)


def parts_of(controller: Controller) -> str:
    """``pd + my_observer``"""
    laws = [block.law for block in controller.blocks.values() if block.law.place != "estimator"]
    return " + ".join(law.name for law in laws)


def run_by(drive: Drive, own: Controller, name: str) -> Controller:
    """The controller with the drive's sample time, counts and limit; its own limit where that is lower.

    Raises
    ------
    InputError
        If it has another sample time or encoder.
    """
    for key, option, unit in (("sample_time", "sample_time", " s"), ("encoder_counts", "counts_per_rev", "")):
        mine, theirs = getattr(own, key), getattr(drive, key)
        if mine not in (0.0, theirs):
            raise InputError(
                f"{name_option('compensators', name)}: {key} = {mine:g}{unit} is not the drive's, "
                f"{theirs:g}{unit}; leave it out "
                f"there, or give {name_option(option, f'{mine:g}')}"
            )
    return replace(
        own, sample_time=drive.sample_time, encoder_counts=drive.encoder_counts,
        torque_limit=min(own.torque_limit, drive.torque_limit),
        reference_velocity=own.reference_velocity or drive.reference_velocity,
    )  # fmt: skip
