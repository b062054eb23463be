"""The fault of a machine that does not stay where it is drawn."""

from __future__ import annotations

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.plural import listed
from pkmcal_cli.compiler.assemble import coordinate_name
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.prediction.drawn_stability import unstable_motion

_SHARE = 0.3  # of the largest amount of a motion, from which on a coordinate is told
_LISTED = 3
_HINT = (
    "stiffen this motion (a stiffness, a member, a joint or a drive that holds it), reduce the load or the force that "
    "drives it, or draw the pose that the machine falls to"
)
_TENSION = "set values that tension the ropes hold it, as `pkmcal correct` gives them; state `t_min` of the ropes"


def unstable_faults(loaded: LoadedMachine) -> list[Fault]:
    """The equilibrium in the reference configuration is a saddle of the energy: no machine stays there.

    A warning where it does once its ropes are tensioned.
    """
    motion = unstable_motion(loaded.model)
    if motion is None:
        return []
    topology, large = loaded.model.topology, abs(motion.amounts) >= _SHARE * abs(motion.amounts[0])
    names = [coordinate_name(topology, int(k)) for k in motion.coordinates[large]]
    message = f"the machine does not stay as it is drawn: this equilibrium is unstable in the {listed(names, _LISTED)}"
    path = path_of(loaded.machine, names[0].rpartition(" ")[2])
    if motion.slack:
        message += ", with ropes that are slack"
    hint = _TENSION if motion.slack else _HINT
    return [loaded.machine.source.fault("unstable", message, path, hint, at_key=True, warning=motion.slack)]
