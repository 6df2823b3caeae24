"""RGB-D images of an articulated object in two states to a replica that moves.

`reconstruct` makes a replica, `discover` only finds its parts and joints, `load` opens one, `read_capture` reads images and `Capture.from_arrays` takes arrays. `artgs.ray` reconstructs
many captures on a cluster, `artgs.rerun` logs replicas and captures to Rerun. The command ``artgs`` is part of the package.
"""

from artgs._arrays import Mesh, Splats
from artgs._capture import Capture, State, View, read_capture
from artgs._errors import CheckError, Error, InputError, InternalError, RunError
from artgs._events import Event
from artgs._native import __version__
from artgs._reconstruct import discover, inspect, reconstruct, synth
from artgs._replica import Alternative, Check, Joint, Part, Replica, load

__all__ = [
    "Alternative",
    "Capture",
    "Check",
    "CheckError",
    "Error",
    "Event",
    "InputError",
    "InternalError",
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
