"""Where the fields of structured arguments lie in flat arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.core.spec import Field, Law, Surroundings

PARAMETER, INPUT, SURROUNDINGS = "a parameter", "an input", "a quantity of the surroundings"
"""What the fields are that a law may only read."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the fields of a structured argument lie in its flat array."""

    scalars: tuple[str, ...]
    blocks: tuple[str, ...] = ()
    counted: bool = False
    """The array holds its numbers of elements after its scalars (parameters do, states ask the parameters)."""
    pers: tuple[str, ...] = ()
    """What each block has a value per; empty: elements."""
    parts: tuple[str, ...] = ()
    """What the names of fields of each part begin with: ``z.law.force`` is the field ``law_force`` of the part
    ``law_``."""
    fixed: str = ""
    """What its fields are to a law, where a law may only read them: "a parameter", "an input"."""

    @staticmethod
    def of(fields: Sequence[Field], *, counted: bool, parts: tuple[str, ...] = (), fixed: str = "") -> Layout:
        """Scalars in order, then one block per field that has a value per element."""
        mixed = any(f.per_element and f.par.per != "element" for f in fields)
        return Layout(
            tuple(f.name for f in fields if not f.per_element),
            tuple(f.name for f in fields if f.per_element),
            counted,
            tuple(f.par.per for f in fields if f.per_element) if mixed else (),
            parts,
            fixed,
        )

    def per(self, block: int) -> str:
        """What a block has a value per."""
        return self.pers[block] if self.pers else "element"

    @property
    def counts(self) -> tuple[str, ...]:
        """What the numbers after the scalars count."""
        return tuple(dict.fromkeys(map(self.per, range(len(self.blocks)))))


def law_layouts(law: Law) -> dict[str, Layout]:
    """The layouts of a law's structured arguments, by argument name."""
    state = Layout.of(law.state_fields, counted=False)
    return {
        "p": Layout.of(law.fields, counted=True, fixed=PARAMETER),
        "z": state,
        "dz": state,
        "g": state,
        "u": Layout(Surroundings._fields, fixed=SURROUNDINGS),
    }
