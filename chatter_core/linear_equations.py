"""Linear equations of which a few directions hold the solution, by GMRES, and loops over vectors for compiled code.

A force that repeats with the revolution answers for itself through what it moves, and that dies away but for a few slow
motions: of its equations, 32 to 320 and more, some 15 to 100 directions hold the solution. Nobody has to write the
equations down: whoever asks says what they make of each direction in turn,

    found = begun(right)  # which is not zero everywhere
    for number in range(len(right)):
        if arrived(found, number, answer_to(found.basis[number])):
            break
    solution = combined(found, number)

Source: Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856-869.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core.jit import compiled

Array = NDArray[np.float64]

#: Share of the right side that may be left.
SOLVED = 1e-8


class Directions(NamedTuple):
    """Directions that hold a solution.

    size: of the right side; basis (direction, unknown): at right angles, of length one; triangle (direction,
    direction): what the equations make of them, in terms of them, brought to a triangle by rotations, of which cosine
    and sine (direction,) tell; left (direction,): of the right side, rotated alike.
    """

    size: float
    basis: Array
    triangle: Array
    cosine: Array
    sine: Array
    left: Array


@compiled
def dot(left, right):  # type: ignore[no-untyped-def]
    """Return the inner product of two vectors, in a loop that the compiler can put where it is called.

    See docs/physics.md#collocation.
    """
    total = 0.0
    for i in range(len(left)):
        total += left[i] * right[i]
    return total


@compiled
def add(factor, vector, result):  # type: ignore[no-untyped-def]
    """Add so many times a vector to another one, in such a loop.

    See docs/physics.md#collocation.
    """
    for i in range(len(vector)):
        result[i] += factor * vector[i]


@compiled
def begun(right):  # type: ignore[no-untyped-def]
    """Return the first direction for a right side (unknown,); there is none where that is zero everywhere.

    See docs/physics.md#forced-motion.
    """
    most, size = len(right), math.sqrt(dot(right, right))
    # Filled in as directions come, and there are few.
    basis, triangle = np.empty((most + 1, most)), np.empty((most + 1, most))
    cosine, sine, left = np.empty(most), np.empty(most), np.empty(most + 1)
    left[0] = size
    for i in range(most):
        basis[0, i] = right[i] / (size if size > 0.0 else 1.0)
    return Directions(size, basis, triangle, cosine, sine, left)


@compiled
def arrived(found, number, answer):  # type: ignore[no-untyped-def]
    """Take in what the equations make of a direction (unknown,); return whether the solution is held, to SOLVED.

    number: of the direction. If not, the next one is there. The answer is overwritten. Equations that make
    nothing of a direction arrive, at what is not a number.

    See docs/physics.md#forced-motion.
    """
    size, basis, triangle, cosine, sine, left = found
    for i in range(number + 1):
        triangle[i, number] = dot(basis[i], answer)
        add(-triangle[i, number], basis[i], answer)
    beyond = math.sqrt(dot(answer, answer))
    for i in range(number):
        above, below = triangle[i, number], triangle[i + 1, number]
        triangle[i, number] = cosine[i] * above + sine[i] * below
        triangle[i + 1, number] = cosine[i] * below - sine[i] * above
    turned = math.hypot(triangle[number, number], beyond)
    if turned == 0.0:
        turned = math.nan
    cosine[number], sine[number] = triangle[number, number] / turned, beyond / turned
    triangle[number, number] = turned
    left[number + 1], left[number] = -sine[number] * left[number], cosine[number] * left[number]
    if not abs(left[number + 1]) > SOLVED * size:
        return True
    for i in range(len(answer)):
        basis[number + 1, i] = answer[i] / beyond
    return False


@compiled
def combined(found, last):  # type: ignore[no-untyped-def]
    """Return what the directions up to a last one say of the solution (unknown,).

    See docs/physics.md#forced-motion.
    """
    share = found.left[: last + 1].copy()
    for row in range(last, -1, -1):
        known = dot(found.triangle[row, row + 1 : last + 1], share[row + 1 :])
        share[row] = (share[row] - known) / found.triangle[row, row]
    solution = np.zeros(found.basis.shape[1])
    for number in range(last + 1):
        add(share[number], found.basis[number], solution)
    return solution
