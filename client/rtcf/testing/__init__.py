"""Tests of components and graphs: inputs and outputs as NumPy arrays, measures of the response.

with rtcf.testing.Bench("my_package/Pi", kp=2.0) as bench:
    response = bench.run({"setpoint": 1.0}, steps=2000)
measured = rtcf.testing.step_response(response.time, response["effort"], target=1.0)
"""

from rtcf.testing.bench import Bench
from rtcf.testing.response import Response
from rtcf.testing.step import StepResponse, step_response

__all__ = ["Bench", "Response", "StepResponse", "step_response"]
