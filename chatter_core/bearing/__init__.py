"""Angular contact ball bearings: how load and speed set their contact angles and stiffness.

``axisymmetric_state`` serves a spindle's preload; ``general`` adds radial force and moment,
``arrangement`` sets of bearings on one shaft. ``ball`` is what they share.
"""

from chatter_core.bearing.axisymmetric import BearingState as BearingState
from chatter_core.bearing.axisymmetric import SpeedLaw as SpeedLaw
from chatter_core.bearing.axisymmetric import axisymmetric_state as axisymmetric_state
from chatter_core.bearing.axisymmetric import state_along as state_along
