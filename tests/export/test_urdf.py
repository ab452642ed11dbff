"""URDF: what is written is read back, by us and by others."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.errors import InputError
from stickslip.exports import urdf
from stickslip.exports.job import Job
from stickslip.models.model import Model

number = st.floats(0.0, 1e6, allow_subnormal=False)


@settings(max_examples=50)
@given(fc=number, sigma2=number)
def test_the_way_there_and_back_changes_nothing(fc, sigma2):
    model = Model("coulomb", fc=fc, sigma2=sigma2)
    text = urdf.write(Job(model, "axis")).files["axis.urdf"]
    back = urdf.read(text)
    assert back.law is model.law
    assert back.parameters == model.parameters


def test_a_joints_name_is_written_as_xml_and_found_again():
    model = Model("coulomb", fc=0.25, sigma2=0.01)
    text = urdf.write(Job(model, "axis", settings={"joint": 'a<b & "c"'})).files["axis.urdf"]
    assert urdf.read(text, 'a<b & "c"').parameters == model.parameters


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<robot", "no URDF"),
        ("<robot><joint name='a'/></robot>", "no <dynamics>|has no such joint"),
        (
            "<robot><joint name='a'><dynamics friction='1'/></joint><joint name='b'><dynamics/></joint></robot>",
            "a, b",
        ),
        ("<robot><joint name='a'><dynamics friction='much'/></joint></robot>", "no numbers"),
        ("<robot><joint name='a'><dynamics friction='-1'/></joint></robot>", "fc"),
    ],
)
def test_a_damaged_file_is_named(text, says):
    with pytest.raises(InputError, match=says):
        urdf.read(text)


def test_joints_of_one_name_are_not_merged():
    one = "<joint name='a'><dynamics friction='{}'/></joint>"
    with pytest.raises(InputError, match="several joints are called 'a'"):
        urdf.read(f"<robot>{one.format(1)}{one.format(2)}</robot>", "a")
