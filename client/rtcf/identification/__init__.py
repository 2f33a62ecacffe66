"""Identification of a plant from recorded values, and gains of a PID controller for it.

experiment  excites one input of a loop within limits, and records
fitting     models of recorded values
models      models: frequency response, response to any input
tuning      gains by published rules
margins     margins of stability

All modules need NumPy; fitting, models and margins need SciPy, see require_scipy().
"""

from rtcf_shared.errors import RtcfError


def require_scipy() -> None:
    """Raise RtcfError if SciPy is not installed."""
    try:
        import scipy.signal  # noqa: F401
    except ImportError:
        raise RtcfError("identification needs SciPy: sudo apt install python3-scipy") from None
