"""Names in structured text: the norm knows no case, no underscore at the end, no two in a row, and many words.

One name of Python has one name in structured text, and two have two, everywhere in a file. A name that the norm
permits stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

WORDS = """
abs abstract acos action add add_dt_time add_time add_tod_time adr and andn any any_bit any_chars any_date any_derived
any_duration any_elementary any_int any_magnitude any_num any_real any_signed any_string any_unsigned array asin assert
at atan atan2 bit bitadr bool by byte bytadr cal calc calcn cardinal case char class concat concat_date concat_date_tod
concat_dt concat_ltod concat_tod configuration const constant continue cos ctd ctu ctud date date_and_time day_of_week
delete delta_time dint div div_ltime div_time do dt dword else elsif en end_action end_case end_class end_configuration
end_for end_function end_function_block end_if end_interface end_method end_namespace end_program end_repeat
end_resource end_step end_struct end_transition end_type end_var end_while endianness eno eq exit exp expression expt
extends f_edge f_trig false final find for from from_big_endian from_little_endian function function_block ge gt if
implements in indexof ini initial_step insert int interface internal interval is_valid is_valid_bcd jmp jmpc jmpcn l ld
ldate ldate_and_time ldn ldt le left len limit lint ln log lower_bound lreal lt ltime ltime_of_day ltod lword max
method mid min mod move mul mul_ltime mul_time mux n namespace ne non_retain not null of on or orn overlap override
persistent pointer pow priority private program property protected public r r1 r_edge r_trig read_only read_write real
ref ref_to reference relocate repeat replace resource ret retain retc retcn return right rol ror round rs rtc s s1 s_t
safebool sel sema shl shr sin single sint sizeof split_date split_dt split_tod sqrt sr st ste step stn string struct
sub sub_date_date sub_dt_dt sub_dt_time sub_time sub_tod_time sub_tod_tod super tan task then this time time_of_day to
to_big_endian to_little_endian tod tof ton tp transition true trunc type udint uint ulint union until upper_bound using
usint ustring var var_access var_config var_external var_generic_constant var_global var_in_out var_inst
var_input var_output var_stat var_temp wchar while with word wstring xor xorn xsizeof
huge_val huge_valf huge_vall infinity nan fp_nan fp_zero fp_normal
m_pi m_e eof null bufsiz rand_max int_max int_min clocks_per_sec pi
"""
RESERVED = frozenset(re.findall(r"\w+", WORDS))
"""Of IEC 61131-3, editions 2 and 3: Annex C, types, standard functions and blocks; of instruction lists, of CODESYS and
TwinCAT, whose compilers refuse them too; of compilers that make C with names in capitals, where they are macros."""


def named_in_st(names: Iterable[str], taken: Iterable[str] = RESERVED) -> Mapping[str, str]:
    """The names in structured text; what is ``taken`` (in lower case) is left to others."""
    used = set(taken)
    wanted = {name: plain(name) for name in names}
    found: dict[str, str] = {}
    # Who has a right to its name keeps it; then in the order of the alphabet, so that a file is written twice alike.
    for name in sorted(wanted, key=lambda n: (wanted[n] != n, n)):
        candidate, count = wanted[name], 1
        while candidate.lower() in used:
            candidate = f"{wanted[name]}_var{count if count > 1 else ''}"
            count += 1
        used.add(candidate.lower())
        found[name] = candidate
    return found


def renamed(name: str, taken: str) -> tuple[str, ...]:
    """What the user must know of a block that is called otherwise, a sentence each."""
    if name == taken:
        return ()
    return (f"{name} is no name in structured text, or is taken there: the block is called {taken}",)


def plain(name: str) -> str:
    """The name without what the norm forbids."""
    letters = re.sub(r"_+", "_", name).strip("_")
    # The norm permits these inside a name; matiec looks for them letter by letter, and ends the body there.
    letters = re.sub(r"(?i)(end)_(function|program)", r"\1\2", letters)
    return letters if letters[:1].isalpha() else f"x{letters}"
