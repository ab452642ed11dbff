"""The GPU's path, in numba's simulator (a process of its own: it is chosen when numba is imported), or told apart."""

import os
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from stickslip.errors import InputError, UnknownName
from support.lane_loops import loops

PROGRAM = """
import sys
import numpy as np
sys.path.insert(0, {here!r})
from support.lane_loops import loops
_, _, many = loops({plant!r}, {helper!r}, n=3, duration=0.04, step=2e-4)
found = many.run(device="gpu")
np.savez({out!r}, position=found.position, velocity=found.velocity, **found.metrics)
"""
HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


@pytest.mark.skipif(find_spec("numba.cuda") is None, reason="needs a GPU: numba-cuda is not installed")
def test_the_simulated_gpu_does_what_the_processor_does(tmp_path):
    """To 1e-9 of each number: the last bits of products, sums and exp differ, and events magnify that."""
    plant, helper, out = "gms", "FB-gms", str(tmp_path / "gpu.npz")
    program = PROGRAM.format(here=HERE, plant=plant, helper=helper, out=out)
    simulated = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1"}
    subprocess.run([sys.executable, "-c", program], env=simulated, check=True, timeout=120)
    there, here = np.load(out), loops(plant, helper, n=3, duration=0.04, step=2e-4)[2].run()
    assert np.ptp(here.position) > 0.0
    for name, value in {"position": here.position, "velocity": here.velocity, **here.metrics}.items():
        np.testing.assert_allclose(there[name], value, rtol=1e-9, atol=1e-13, err_msg=name)


def test_no_gpu_is_told_with_what_was_looked_for():
    from numba import cuda

    if cuda.is_available():
        pytest.skip("needs a machine without a GPU")
    with pytest.raises(InputError, match=r"looked for NVIDIA's driver.*pip install 'stickslip\[gpu\]'"):
        loops(n=2, duration=0.01)[2].run((), device="gpu")


def test_a_gpu_does_what_the_processor_does():
    from numba import cuda

    if not cuda.is_available():
        pytest.skip("needs a GPU")
    many = loops("gms", "FB-gms", n=64, duration=0.2)[2]
    there, here = many.run(device="gpu"), many.run()
    assert np.max(np.abs(there.position - here.position)) < 1e-9


def test_an_unknown_device_is_refused():
    with pytest.raises(UnknownName, match="unknown device 'tpu'"):
        loops(n=2, duration=0.01)[2].run((), device="tpu")
