"""An evaluator of Modelica functions, to try what is exported.

The grammar is the part of the specification's appendix A that functions, records and their algorithms use; inputs may
not be assigned, and every name must be declared.
"""

import functools
import math

from lark import Lark, Token, Tree

GRAMMAR = r"""
package: (record | function)*
record: "record" NAME [STRING] component* "end" NAME ";"
component: NAME NAME ["[" INT "]"] [modification] ["=" value] [STRING] ";"
modification: "(" start ("," fixed)? ")"
start: "each"? "start" "=" expression
fixed: "each"? "fixed" "=" "true"
value: "{" expression ("," expression)* "}" -> listed | expression
function: "function" NAME [STRING] input* output* ["protected" local*] "algorithm" statement* "end" NAME ";"
input: "input" NAME NAME ";"
output: "output" NAME NAME ";"
local: NAME NAME ";"

?statement: assign | call_assign | if_ | for_ | RETURN ";" -> return_ | BREAK ";" -> break_
assign: place ":=" expression ";"
call_assign: "(" [place] ("," place)* ")" ":=" call ";"
if_: "if" expression "then" body ("elseif" expression "then" body)* ["else" body] "end" "if" ";"
for_: "for" NAME "in" expression ":" expression "loop" body "end" "for" ";"
body: statement*
place: NAME ("." NAME)? ("[" expression "]")?

?expression: "if" expression "then" expression "else" expression -> choice | disjunction
?disjunction: conjunction ("or" conjunction)*
?conjunction: negation ("and" negation)*
?negation: "not" negation -> not_ | comparison
?comparison: sum [COMPARE sum]
?sum: [SIGN] product (SIGN product)*
?product: power (TIMES power)*
?power: atom ["^" atom]
?atom: NUMBER | call | place | "(" expression ")"
call: NAME "(" [expression ("," expression)*] ")"

COMPARE: "<=" | ">=" | "<>" | "==" | "<" | ">"
SIGN: "+" | "-"
TIMES: "*" | "/"
RETURN.3: /return\b/
BREAK.3: /break\b/
NUMBER: /[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?/
INT.2: /[0-9]+(?=\])/
STRING: /"[^"]*"/
NAME: /(?!(?:WORDS)\b)[A-Za-z_]\w*/
COMMENT: /\/\*.*?\*\//s
%ignore COMMENT
%ignore /\s+/
"""
WORDS = "end|if|then|else|elseif|for|loop|in|and|or|not|input|output|protected|algorithm|function|record|return|break"
LIBRARY = {
    "abs": abs, "exp": math.exp, "log": math.log, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "atan2": math.atan2, "tanh": math.tanh, "sinh": math.sinh, "cosh": math.cosh, "min": min,
    "max": max, "floor": math.floor, "ceil": math.ceil, "integer": math.floor, "mod": lambda a, b: a % b,
}  # fmt: skip
COMPARISONS = {
    "<": lambda a, b: a < b, ">": lambda a, b: a > b, "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b, "<>": lambda a, b: a != b,
}  # fmt: skip


ARITHMETIC = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b
}  # fmt: skip


class Returned(Exception):
    """return."""


class Left(Exception):
    """break."""


def copied(value):
    """A record by value."""
    if not isinstance(value, dict):
        return value
    return {k: list(x) if isinstance(x, list) else x for k, x in value.items()}


@functools.cache
def reader():
    """What reads a package, made of the grammar once."""
    return Lark(GRAMMAR.replace("WORDS", WORDS), parser="lalr", start="package", maybe_placeholders=True)


class Package:
    """Records and functions of an exported package; its models are left out."""

    def __init__(self, text):
        inside = text[text.index("\n") + 1 : text.index("  model Contact")]
        tree = reader().parse(inside)
        self.records, self.functions = {}, {}
        for part in tree.children:
            if part.data == "record":
                self.records[str(part.children[0])] = part
        for part in tree.children:
            if part.data == "function":
                self.functions[str(part.children[0])] = self.prepared(part)

    def record(self, name):
        """A record with its values."""
        out = {}
        for c in self.records[name].find_data("component"):
            _, key, size, modified, value, _ = c.children
            assert modified is None or value is None, f"{key} has a start and a binding"
            if value is None:
                start = self.value(modified.children[0].children[0], {}) if modified else 0.0
                out[str(key)] = [start] * int(size) if size else start
            elif value.data == "listed":
                out[str(key)] = [self.value(v, {}) for v in value.children]
            else:
                out[str(key)] = self.value(value.children[0], {})
            assert not size or len(out[str(key)]) == int(size)
        return out

    def call(self, name, given):
        """Outputs of a function, in order."""
        if name in self.records:
            return [self.record(name)]
        if name not in self.functions:
            return [LIBRARY[name](*given)]
        inputs, outputs, fresh, body = self.functions[name]
        assert len(inputs) == len(given), f"{name} takes {inputs}"
        v = {n: copied(start) for n, start in fresh.items()} | dict(zip(inputs, given))
        frame = {"v": v, "may": fresh}
        try:
            for c in body:
                self.execute(c, frame)
        except Returned:
            pass
        return [v[n] for n in outputs]

    def prepared(self, part):
        """Inputs, outputs, starting values of what may be assigned, and statements of a function."""
        by_kind = {kind: [c for c in part.children if isinstance(c, Tree) and c.data == kind]
                   for kind in ("input", "output", "local")}  # fmt: skip
        names = {kind: [str(c.children[1]) for c in found] for kind, found in by_kind.items()}
        own = {str(c.children[1]): str(c.children[0]) for kind in ("output", "local") for c in by_kind[kind]}
        fresh = {n: self.record(kind) if kind in self.records else None for n, kind in own.items()}
        body = [c for c in part.children if isinstance(c, Tree) and c.data not in by_kind]
        return names["input"], names["output"], fresh, body

    def execute(self, node, frame):
        if node.data == "assign":
            self.store(node.children[0], self.value(node.children[1], frame["v"]), frame)
        elif node.data == "call_assign":
            *places, call = node.children
            results = self.called(call, frame["v"])
            for place, result in zip(places, results):
                if place is not None:
                    self.store(place, result, frame)
        elif node.data == "if_":
            *pairs, otherwise = node.children
            for test, body in zip(pairs[::2], pairs[1::2]):
                if self.value(test, frame["v"]):
                    return self.execute(body, frame)
            if otherwise is not None:
                self.execute(otherwise, frame)
        elif node.data == "for_":
            name, first, last, body = node.children
            try:
                for i in range(self.value(first, frame["v"]), self.value(last, frame["v"]) + 1):
                    frame["v"][str(name)] = i
                    self.execute(body, frame)
            except Left:
                pass
        elif node.data == "body":
            for c in node.children:
                self.execute(c, frame)
        elif node.data == "return_":
            raise Returned
        elif node.data == "break_":
            raise Left
        else:
            raise AssertionError(node.data)
        return None

    def store(self, place, value, frame):
        name, *rest = place.children
        assert str(name) in frame["may"], f"{name} is no local name and no output"
        value = (
            {k: list(x) if isinstance(x, list) else x for k, x in value.items()}
            if isinstance(value, dict)
            else value
        )
        if not rest:
            frame["v"][str(name)] = value
            return
        owner = frame["v"][str(name)]
        if len(rest) == 2:
            owner, rest = owner[str(rest[0])], [rest[1]]
            owner[self.value(rest[0], frame["v"]) - 1] = value
        else:
            assert str(rest[0]) in owner
            owner[str(rest[0])] = value

    def called(self, node, v):
        name, *given = node.children
        return self.call(str(name), [self.value(g, v) for g in given if g is not None])

    def value(self, node, v):
        if isinstance(node, Token):
            return float(node) if any(x in node for x in ".eE") else int(node)
        kind, c = node.data, node.children
        if kind == "place":
            out = v[str(c[0])]
            assert out is not None, f"{c[0]} is read before it is set"
            for step in c[1:]:
                out = (
                    out[str(step)]
                    if isinstance(step, Token) and step.type == "NAME"
                    else out[self.value(step, v) - 1]
                )
            return out
        if kind == "call":
            (out,) = self.called(node, v)
            return out
        if kind == "choice":
            return self.value(c[1] if self.value(c[0], v) else c[2], v)
        if kind == "not_":
            return not self.value(c[0], v)
        if kind == "disjunction":
            return any(self.value(x, v) for x in c)
        if kind == "conjunction":
            return all(self.value(x, v) for x in c)
        if kind == "comparison":
            return (
                COMPARISONS[c[1]](self.value(c[0], v), self.value(c[2], v)) if c[1] else self.value(c[0], v)
            )
        if kind == "power":
            return self.value(c[0], v) ** self.value(c[1], v) if c[1] else self.value(c[0], v)
        if kind == "sum":
            sign, first, *rest = c
            out = -self.value(first, v) if sign == "-" else self.value(first, v)
        else:
            first, *rest = c
            out = self.value(first, v)
        for operator, operand in zip(rest[::2], rest[1::2]):
            right = self.value(operand, v)
            out = {
                "+": lambda a, b: a + b,
                "-": lambda a, b: a - b,
                "*": lambda a, b: a * b,
                "/": lambda a, b: a / b,
            }[str(operator)](out, right)
        return out
