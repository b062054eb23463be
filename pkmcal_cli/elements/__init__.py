"""Elements: what holds a machine together, as generalised strains and their stiffness."""

from pkmcal_cli.elements.bar import BarElement, ElasticBarElement
from pkmcal_cli.elements.beam import BeamElement, SpanElement
from pkmcal_cli.elements.element import Element, LinkGeometry
from pkmcal_cli.elements.joint import JOINTS, JointElement, JointType
from pkmcal_cli.elements.load import LoadElement, SpanWeight
from pkmcal_cli.elements.orientation import OrientationElement
from pkmcal_cli.elements.pulley import (
    ElasticPlanarPulleyElement,
    ElasticSwivelPulleyElement,
    PlanarPulleyElement,
    SwivelPulleyElement,
)

__all__ = [
    "JOINTS", "BarElement", "BeamElement", "ElasticBarElement", "ElasticPlanarPulleyElement",
    "ElasticSwivelPulleyElement", "Element", "JointElement", "JointType", "LinkGeometry", "LoadElement",
    "OrientationElement", "PlanarPulleyElement", "SpanElement", "SpanWeight", "SwivelPulleyElement",
]  # fmt: skip
