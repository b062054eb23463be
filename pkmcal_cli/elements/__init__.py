"""Elements: what holds a machine together, as generalised strains and their stiffness."""

from pkmcal_cli.elements.bar import Bar, ElasticBar
from pkmcal_cli.elements.base import Element
from pkmcal_cli.elements.beam import Beam
from pkmcal_cli.elements.joint import JOINTS, Joint, JointType
from pkmcal_cli.elements.load import Load

__all__ = ["JOINTS", "Bar", "Beam", "ElasticBar", "Element", "Joint", "JointType", "Load"]
