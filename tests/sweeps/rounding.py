"""How far pictures of the same numbers, added in another order, may lie apart."""

import math

import numpy as np

from vcc.plan.operators import AlongAxes


def gain(plan):
    """By how much sharpening multiplies what is rounded before it, pixel by pixel apart: in the mean square."""
    filters = [each for each in plan.after if isinstance(each, AlongAxes)]
    return math.prod(float(np.linalg.norm(each.down) * np.linalg.norm(each.across)) for each in filters)
