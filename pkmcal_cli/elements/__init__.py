"""Elements: what holds a machine together, as generalised strains and their stiffness."""

from .bar import Bar, ElasticBar
from .base import Element
from .beam import Beam
from .joint import JOINTS, Joint, JointType
from .load import Load

__all__ = ["JOINTS", "Bar", "Beam", "ElasticBar", "Element", "Joint", "JointType", "Load"]
