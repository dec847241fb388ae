"""The tube O(rho): all states within rho of the plan, as a domain that classifies boxes, and whether it is safe.

In: a plan, a radius, a window of time; coordinates and half-widths, where the tube has its own. Out: for boxes in
(x, u*, t): smaller boxes with the same points of the tube, or "outside"; for points: thin boxes proven inside.
Trusted: yes. Implements: (omega_norm_ball), (full_tube), assumption 1; theory 1.4 and 1a.
"""

from tubecert.tube.containment import Containment, containment
from tubecert.tube.domain import Tube
from tubecert.tube.sections import Ball, Ellipsoid, Section

__all__ = ["Ball", "Containment", "Ellipsoid", "Section", "Tube", "containment"]
