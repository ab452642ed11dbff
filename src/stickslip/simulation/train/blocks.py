"""The flow of a train over a step, exact for a slipping force whose rate is a polynomial.

For a step that resolves every mode it is a series; that over twice as long a step follows from it.
"""

from __future__ import annotations

from stickslip.jit import WIDTH, columns_times, kernel, pointer
from stickslip.simulation.train.records import (
    BLOCK,
    BLOCKS,
    CONTACT,
    FACTORS,
    GIVEN,
    HALVES,
    KINDS,
    MATRIX,
    MOTOR,
    MOVED,
    PARTIAL,
    RAISED,
    SHOWN,
    SLIDING,
    STICKING,
    SYSTEM,
    SYSTEMS,
    TABLES,
    Train,
)
from stickslip.simulation.train.shapes import (
    DRIVEN,
    ENDS,
    INTEGRAL,
    LEFT,
    NODES,
    PARTS,
    RIGHT,
    TAU,
    TERMS,
)

NOTHING = 1e-15
"""Of a flow, that its series may leave out."""


@kernel()
def system_of(train: Train, kind: int, stiffness: float) -> None:
    """Write the powers of a system whose contact has a spring of `stiffness`, N·m/rad.

    The matrix of the sliding one, and what motor and contact act on, are there.
    """
    n, mem = train.n, train.all
    size, at, sliding = n.size, SYSTEMS + kind * SYSTEM, SYSTEMS + SLIDING * SYSTEM
    angle = n.turning - 1
    for i in range(size * WIDTH):
        mem[at + MATRIX + i] = mem[sliding + MATRIX + i]
    for i in range(WIDTH):
        mem[at + MOTOR + i], mem[at + CONTACT + i] = mem[sliding + MOTOR + i], mem[sliding + CONTACT + i]
        mem[at + MATRIX + angle * WIDTH + i] -= stiffness * mem[sliding + CONTACT + i]
    for j in range(size):
        first = at + RAISED + j * (TERMS + 1) * WIDTH
        for i in range(WIDTH):
            mem[first + i] = 1.0 if i == j else 0.0
        raised(train, at, first, TERMS + 1)
    raised(train, at, at + MOTOR, TERMS)
    raised(train, at, at + CONTACT, TERMS)


@kernel()
def raised(train: Train, system: int, first: int, count: int) -> None:
    """Behind the column `first`, `count` in all: the matrix times the one before."""
    mem = train.all
    for k in range(1, count):
        before = first + (k - 1) * WIDTH
        columns_times(
            pointer(mem, system + MATRIX), pointer(mem, before), train.n.size, pointer(mem, before + WIDTH)
        )


@kernel()
def series(train: Train, kind: int, h: float, block: int) -> None:
    """Write the flow of a system over h, which resolves its modes."""
    mem, size = train.all, train.n.size
    terms = terms_for(train.n.pace[min(kind, STICKING)] * h)
    at, shown = SYSTEMS + kind * SYSTEM, block + (size + GIVEN) * WIDTH
    for j in range(size):
        grown = 1.0
        for k in range(terms + 1):
            mem[FACTORS + k] = grown
            grown *= h / (k + 1)
        column(
            train, at + RAISED + j * (TERMS + 1) * WIDTH, terms + 1, TAU, block + j * WIDTH, shown + j * WIDTH
        )
    for source in range(2):
        grown = h if source == 0 else -h
        for m in range(terms):
            mem[FACTORS + m] = grown
            grown *= h / (m + 2)
        j = (size + source) * WIDTH
        column(train, at + (MOTOR if source == 0 else CONTACT), terms, TAU + 2, block + j, shown + j)
    driven(train, at + CONTACT, terms, h, block + (size + 2) * WIDTH)


@kernel()
def driven(train: Train, contact: int, terms: int, h: float, first: int) -> None:
    """What the rates of the contact's torque at the nodes do, in columns from `first` on."""
    mem = train.all
    nodes = (train.n.size + GIVEN) * WIDTH
    grown = -h * h
    for m in range(terms):
        mem[FACTORS + m] = grown
        grown *= h
    entries_of(train, contact, terms)
    for node in range(NODES):
        out = first + node * WIDTH
        at_nodes(train, terms, DRIVEN + 2 * node * TERMS, out + nodes)
        ends = TABLES + (ENDS + 2 * node) * WIDTH
        for m in range(terms):
            mem[MOVED + m] = mem[FACTORS + m] * mem[ends + m]
        columns_times(pointer(mem, contact), pointer(mem, MOVED), terms, pointer(mem, out))


@kernel(inline=True)
def terms_for(x: float) -> int:
    """Terms of exp(x) for positive x, beyond which nothing is left of it."""
    terms, left = 2, 0.5 * x * x
    while left > NOTHING and terms < TERMS:
        terms += 1
        left *= x / terms
    return terms


@kernel()
def column(train: Train, columns: int, count: int, table: int, end: int, shown: int) -> None:
    """A state or what is given: the sum of columns by the factors at the end, and at the nodes by a table."""
    mem = train.all
    columns_times(pointer(mem, columns), pointer(mem, FACTORS), count, pointer(mem, end))
    entries_of(train, columns, count)
    at_nodes(train, count, table, shown)


@kernel(inline=True)
def entries_of(train: Train, columns: int, count: int) -> None:
    """Velocity and angle of the contact in columns, times the factors, in turn behind these."""
    mem, turning, entries = train.all, train.n.turning, FACTORS + 2 * WIDTH
    for k in range(count):
        mem[entries + 2 * k] = mem[FACTORS + k] * mem[columns + k * WIDTH + turning]
        mem[entries + 2 * k + 1] = mem[FACTORS + k] * mem[columns + k * WIDTH + turning - 1]


@kernel(inline=True)
def at_nodes(train: Train, count: int, table: int, out: int) -> None:
    """What the entries make of velocity and angle at the nodes, by the columns of a table."""
    mem, entries = train.all, FACTORS + 2 * WIDTH
    columns_times(pointer(mem, TABLES + table * WIDTH), pointer(mem, entries), 2 * count, pointer(mem, out))


@kernel()
def doubled(train: Train, half: int, h: float, block: int) -> None:
    """Write the flow over 2 h from that over h."""
    mem, size = train.all, train.n.size
    count = size + GIVEN
    for j in range(count):
        given = j - size
        for i in range(count):
            mem[HALVES + i] = 1.0 if i == j else 0.0
        if given >= 2:
            for i in range(NODES):
                mem[HALVES + size + 2 + i] = mem[TABLES + (LEFT + given - 2) * WIDTH + i]
        flowed(train, half, MOVED)
        halved(train, 0, block + (count + j) * WIDTH)
        grown = 0.0
        for i in range(NODES if given >= 2 else 0):
            grown += mem[TABLES + (INTEGRAL + i) * WIDTH + PARTS - 1] * mem[HALVES + size + 2 + i]
            mem[FACTORS + i] = mem[TABLES + (RIGHT + given - 2) * WIDTH + i]
        for i in range(NODES if given >= 2 else 0):
            mem[HALVES + size + 2 + i] = mem[FACTORS + i]
        if given >= 2:
            mem[HALVES + size + 1] = h * grown
        for i in range(size):
            mem[HALVES + i] = mem[MOVED + i]
        flowed(train, half, block + j * WIDTH)
        halved(train, PARTS // 2, block + (count + j) * WIDTH)


@kernel()
def flowed(train: Train, block: int, out: int) -> None:
    """A flow applied to `HALVES`: the states behind it, and what the nodes show."""
    mem, count = train.all, train.n.size + GIVEN
    columns_times(pointer(mem, block), pointer(mem, HALVES), count, pointer(mem, out))
    columns_times(pointer(mem, block + count * WIDTH), pointer(mem, HALVES), count, pointer(mem, SHOWN))


@kernel()
def halved(train: Train, first: int, out: int) -> None:
    """Every second node of a half is one of the whole, from the node behind `first` on."""
    mem = train.all
    for i in range(PARTS // 2):
        mem[out + first + i] = mem[SHOWN + 2 * i + 1]
        mem[out + PARTS + first + i] = mem[SHOWN + PARTS + 2 * i + 1]


@kernel()
def ready(train: Train, kind: int, stiffness: float) -> None:
    """Write a system whose contact has a spring of `stiffness`, N·m/rad, and its flows over parts of a sample."""
    n = train.n
    system_of(train, kind, stiffness)
    n.springs[kind] = stiffness
    for level in range(n.deepest, -1, -1):
        h = n.sample_time / float(1 << level)
        block = kept(train, kind, level)
        if level == n.deepest:
            series(train, kind, h, block)
        else:
            doubled(train, kept(train, kind, level + 1), 0.5 * h, block)


@kernel(inline=True)
def kept(train: Train, kind: int, level: int) -> int:
    """Where the flow over a whole part of a sample lies."""
    return BLOCKS + (1 + kind * (train.n.deepest + 1) + level) * BLOCK


@kernel()
def partial(train: Train, stiffness: float) -> int:
    """The system of which so much of the contact sticks, N·m/rad; the oldest gives way to a new one."""
    n = train.n
    for kind in range(PARTIAL, KINDS):
        if n.springs[kind] == stiffness:
            return kind
    kind = PARTIAL + n.written % (KINDS - PARTIAL)
    n.written += 1
    ready(train, kind, stiffness)
    return kind
