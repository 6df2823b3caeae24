"""RGB-D images of an articulated object in two states to a replica that moves.

`reconstruct` makes a replica, `discover` only finds its parts and joints, `load` opens one, `read_capture` reads images and `Capture.from_arrays` takes arrays. `artgs.ray` reconstructs
many captures on a cluster, `artgs.rerun` logs replicas and captures to Rerun. The command ``artgs`` is part of the package.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from artgs._native import __version__

if TYPE_CHECKING:
    from artgs._arrays import Mesh, Splats
    from artgs._capture import Capture, State, View, read_capture
    from artgs._errors import CheckError, Error, InputError, InternalError, RunError
    from artgs._events import Event
    from artgs._reconstruct import discover, inspect, reconstruct, synth
    from artgs._replica import Alternative, Check, Interval, Joint, Part, Replica, load

__all__ = [
    "Alternative",
    "Capture",
    "Check",
    "CheckError",
    "Error",
    "Event",
    "InputError",
    "InternalError",
    "Interval",
    "Joint",
    "Mesh",
    "Part",
    "Replica",
    "RunError",
    "Splats",
    "State",
    "View",
    "__version__",
    "discover",
    "inspect",
    "load",
    "read_capture",
    "reconstruct",
    "synth",
]

if not TYPE_CHECKING:
    # Imported when a name is used: numpy takes most of the time in which the command `artgs` starts.
    _NAMES = {
        "_arrays": ("Mesh", "Splats"),
        "_capture": ("Capture", "State", "View", "read_capture"),
        "_errors": ("CheckError", "Error", "InputError", "InternalError", "RunError"),
        "_events": ("Event",),
        "_reconstruct": ("discover", "inspect", "reconstruct", "synth"),
        "_replica": ("Alternative", "Check", "Interval", "Joint", "Part", "Replica", "load"),
    }

    def __getattr__(name: str) -> object:
        module = next((module for module, names in _NAMES.items() if name in names), None)
        if module is None:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        # The next use finds it in the module.
        value = globals()[name] = getattr(import_module(f"artgs.{module}"), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
