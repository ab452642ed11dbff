"""model.toml: what is written is read back, whatever the law; what a person writes is checked."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.model_file import write_model
from stickslip.models import plugins
from stickslip.models.model import Model

LAWS = [plugins.law(name) for name in plugins.law_names()]
LAWS += [law.having(**{c.name: list(c.options)[-1] for c in law.choices}) for law in LAWS if law.choices]
ESTIMATE = Estimate(
    "k[0]", "N·m/rad", "k_i", 1e4, math.nan, 9e3, math.inf, False, 'the data "set" no limit\n(really)'
)


def found(model):
    one = np.array([[1.0]])
    return Identification("axis", model, (ESTIMATE,), one, {"rms_Nm": 1e-3}, ("a note",), ("at 2 rad/s",))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: "-".join([law.name, *law.chosen.values()]))
def test_what_is_written_is_read_back(law, tmp_path):
    model = Model(law, **dict(law.example))
    write_model(
        tmp_path / "model.toml", found(model), data=[{"file": "a b.csv", "sha256": "00ff", "rows": 12}]
    )
    again = Model.from_file(tmp_path / "model.toml")
    assert again.as_dict() == model.as_dict()
    written = tomllib.loads((tmp_path / "model.toml").read_text())
    assert written["estimates"][0]["verdict"] == ESTIMATE.verdict
    assert written["estimates"][0]["upper"] == math.inf
    assert written["data"][0]["rows"] == 12
    assert "k[0]" not in written["assumed"]
    for f in law.fields:
        if not f.per_element:
            assert written["assumed"][f.name] == pytest.approx(getattr(model.parameters, f.name))


def test_a_person_writes_law_and_parameters(tmp_path):
    (tmp_path / "m.toml").write_text('law = "coulomb"\n[parameters]\nfc = 0.3\n')
    assert Model.from_file(tmp_path / "m.toml").parameters.fc == 0.3


def test_a_law_from_a_file_is_found_again(tmp_path):
    source = plugins.importlib.import_module("stickslip.laws.dahl").__file__
    text = Path(source).read_text().replace('"dahl",\n', '"my-dahl",\n', 1)
    (tmp_path / "my_law.py").write_text(text)
    law = plugins.law(str(tmp_path / "my_law.py"))
    model = Model(law, **dict(law.example))
    write_model(tmp_path / "model.toml", found(model), law=str(tmp_path / "my_law.py"))
    assert Model.from_file(tmp_path / "model.toml").law is law


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "law"),
        ("law = 'coulomb'\n[parameters]\n", "fc.*missing"),
        ("format = 'x'\nlaw = 'coulomb'\n[parameters]\nfc = 1.0", "another version"),
        ("law = 'coulomb'\n[parameters]\nfd = 1.0", "choose from .*fc"),
        ("law = 'colomb'\n[parameters]\nfc = 1.0", "did you mean 'coulomb'"),
        ("law = 'coulomb'\n[parameters]\nfc = -1.0", "at least 0"),
    ],
)
def test_bad_files_get_one_line(tmp_path, text, complaint):
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match=complaint):
        Model.from_file(tmp_path / "m.toml")


def test_an_unwritable_place_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot write"):
        write_model(tmp_path / "none" / "model.toml", found(Model("coulomb", fc=1.0)))
