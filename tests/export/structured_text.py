"""An evaluator of IEC 61131-3 structured text (types, functions, function blocks), to try what is exported.

The grammar is the part of the norm's Annex B that covers user types, POUs with VAR sections, assignments, IF,
FOR, RETURN, EXIT and calls with named arguments. LREAL is a double, INT an int; names know no case.
"""

import math

from lark import Lark, Token, Tree

GRAMMAR = r"""
start: (type_block | function | block)*
type_block: "TYPE"i (NAME ":" "STRUCT"i declaration* "END_STRUCT"i ";"?)+ "END_TYPE"i
function: "FUNCTION"i NAME ":" NAME section* statement* "END_FUNCTION"i
block: "FUNCTION_BLOCK"i NAME section* statement* "END_FUNCTION_BLOCK"i
section: SECTION declaration* "END_VAR"i
SECTION.3: /VAR_INPUT|VAR_OUTPUT|VAR_IN_OUT|VAR(?!_)/i
declaration: NAME ":" kind [":=" initial] ";"
kind: "ARRAY"i "[" INT ".." INT "]" "OF"i NAME -> array | NAME -> named
?initial: "[" expression ("," expression)* "]" -> listed | expression

?statement: assign | call_statement | if_ | for_ | return_ | exit_ | empty
empty: ";"
assign: place ":=" expression ";"
call_statement: call ";"
if_: "IF"i expression "THEN"i body ("ELSIF"i expression "THEN"i body)* ["ELSE"i body] "END_IF"i ";"
for_: "FOR"i NAME ":=" expression "TO"i expression "DO"i body "END_FOR"i ";"
return_: "RETURN"i ";"
exit_: "EXIT"i ";"
body: statement*

place: NAME ("." NAME | "[" expression "]")*

?expression: conjunction | expression "OR"i conjunction -> or_
?conjunction: comparison | conjunction "AND"i comparison -> and_
?comparison: sum (COMPARE sum)?
?sum: product (SIGN product)*
?product: unary (TIMES unary)*
?unary: "-" atom -> negative | "NOT"i atom -> not_ | atom
?atom: NUMBER | call | place | TRUTH | "(" expression ")"
call: NAME "(" [argument ("," argument)*] ")"
argument: NAME ":=" expression -> named_argument | expression -> plain_argument

COMPARE: "<=" | ">=" | "<>" | "<" | ">" | "="
SIGN: "+" | "-"
TIMES: "*" | "/" | /MOD\b/i
TRUTH.2: /TRUE|FALSE/i
NUMBER: /[0-9]+(\.[0-9]+)?([Ee][+-]?[0-9]+)?(?!\.\.)/
INT: /[0-9]+/
NAME: /(?!(?:ELSE|ELSIF|THEN|DO|TO|OR|AND|NOT|RETURN|EXIT|IF|FOR|VAR|TYPE|FUNCTION|STRUCT)\b)(?!END_|VAR_)[A-Z_a-z]\w*/
COMMENT: /\(\*.*?\*\)/s
%ignore COMMENT
%ignore /\s+/
"""
LIBRARY = {
    "abs": abs, "exp": math.exp, "ln": math.log, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "expt": math.pow, "min": min, "max": max, "sel": lambda c, a, b: b if c else a,
    "int_to_lreal": float, "lint_to_lreal": float, "trunc_lint": math.trunc, "lreal_to_int": int,
}  # fmt: skip
ARITHMETIC = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
    "MOD": math.fmod,
}  # fmt: skip
COMPARISONS = {
    "<": lambda a, b: a < b, ">": lambda a, b: a > b, "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b,
    "=": lambda a, b: a == b, "<>": lambda a, b: a != b,
}  # fmt: skip


class Returned(Exception):
    """RETURN."""


class Left(Exception):
    """EXIT."""


class Program:
    """A file of structured text."""

    def __init__(self, text):
        tree = Lark(GRAMMAR, parser="lalr", maybe_placeholders=True).parse(text)
        self.types, self.pous = {}, {}
        for part in tree.children:
            names = [c for c in part.children if isinstance(c, Token)]
            if part.data == "type_block":
                self.types[names[0].lower()] = [c for c in part.children if isinstance(c, Tree)]
            else:
                self.pous[names[0].lower()] = part

    def fresh(self, declaration):
        """The initial value of a declared variable."""
        _, kind, initial = declaration.children
        if initial is not None and isinstance(initial, Tree) and initial.data == "listed":
            return [self.value(c, {}) for c in initial.children]
        if initial is not None:
            return self.value(initial, {})
        if kind.data == "array":
            return [0.0] * (int(kind.children[1]) + 1)
        name = kind.children[0].lower()
        if name in self.types:
            return {d.children[0].lower(): self.fresh(d) for d in self.types[name]}
        return {"int": 0, "bool": False}.get(name, 0.0)

    def instance(self, name):
        """The variables of a function block at the start."""
        return {
            d.children[0].lower(): self.fresh(d)
            for section in self.pous[name.lower()].find_data("section")
            for d in section.find_data("declaration")
        }

    def run(self, name, variables):
        """Run the statements of a POU on its variables."""
        part = self.pous[name.lower()]
        try:
            for c in part.children:
                if isinstance(c, Tree) and c.data != "section":
                    self.execute(c, variables)
        except Returned:
            pass

    def execute(self, node, v):
        if node.data == "assign":
            self.store(node.children[0], self.value(node.children[1], v), v)
        elif node.data == "call_statement":
            self.value(node.children[0], v)
        elif node.data == "if_":
            self.branch(node.children, v)
        elif node.data == "for_":
            name, first, last, body = node.children
            try:
                for i in range(int(self.value(first, v)), int(self.value(last, v)) + 1):
                    v[name.lower()] = i
                    self.execute(body, v)
            except Left:
                pass
        elif node.data == "body":
            for c in node.children:
                self.execute(c, v)
        elif node.data == "return_":
            raise Returned
        elif node.data == "exit_":
            raise Left

    def branch(self, children, v):
        *pairs, otherwise = children
        for test, body in zip(pairs[::2], pairs[1::2]):
            if self.value(test, v):
                self.execute(body, v)
                return
        if otherwise is not None:
            self.execute(otherwise, v)

    def steps(self, place, v):
        for step in place.children[1:]:
            yield (
                step.lower() if isinstance(step, Token) and step.type == "NAME" else int(self.value(step, v))
            )

    def store(self, place, value, v):
        keys = [place.children[0].lower(), *self.steps(place, v)]
        owner = v
        for key in keys[:-1]:
            owner = owner[key]
        assert keys[-1] in owner if isinstance(owner, dict) else keys[-1] < len(owner), f"undeclared {keys}"
        owner[keys[-1]] = value

    def value(self, node, v):
        if isinstance(node, Token):
            return self.token(node, v)
        kind, c = node.data, node.children
        if kind == "place":
            out = v[c[0].lower()]
            for key in self.steps(node, v):
                out = out[key]
            return out
        if kind == "call":
            return self.call(c[0].lower(), [a for a in c[1:] if a is not None], v)
        if kind == "negative":
            return -self.value(c[0], v)
        if kind == "not_":
            return not self.value(c[0], v)
        if kind in ("or_", "and_"):
            results = [self.value(x, v) for x in c]  # both sides, as a PLC may
            return any(results) if kind == "or_" else all(results)
        if kind == "comparison":
            return COMPARISONS[c[1]](self.value(c[0], v), self.value(c[2], v))
        out = self.value(c[0], v)
        for sign, operand in zip(c[1::2], c[2::2]):
            right = self.value(operand, v)
            out = ARITHMETIC[sign.upper()](out, right)
        return out

    def token(self, node, v):
        if node.type == "TRUTH":
            return node.lower() == "true"
        if node.type == "NAME":
            return v[node.lower()]
        return float(node) if any(x in node for x in ".eE") else int(node)

    def call(self, name, arguments, v):
        if name in LIBRARY:
            return LIBRARY[name](*(self.value(a.children[0], v) for a in arguments))
        inner = {name: 0.0, **self.instance(name)}
        for a in arguments:
            key, expression = a.children
            assert key.lower() in inner, f"{name} has no input {key}"
            inner[key.lower()] = self.value(expression, v)
        self.run(name, inner)
        return inner[name]
