"""Linear equations of which a few directions hold the solution, by GMRES, and loops over vectors for compiled code.

A force that repeats with the revolution answers for itself through what it moves, and that dies away but for a few slow
motions: of its equations, 60 to 230, 13 to 19 directions hold the solution. With elimination all that
``chatter_core.contact`` does took 1.6 times as long for four helical teeth, and no longer for three straight ones.

Source: Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856-869.
"""

import math

import numpy as np

from chatter_core.jit import compiled

#: Directions at most, and the share of the right side that may be left.
DIRECTIONS, SOLVED = 60, 1e-12


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
def solve(matrix, right):  # type: ignore[no-untyped-def]
    """Return the solution (unknown,) of linear equations, to SOLVED; matrix (equation, unknown), right (equation,).

    A few directions hold it where the matrix is the identity but for a few strong ones; where they do not, elimination
    finds it. Raises LinAlgError where there is none.

    See docs/physics.md#forced-motion.
    """
    size, most = math.sqrt(dot(right, right)), min(DIRECTIONS, len(right))
    if size == 0.0:
        return np.zeros(len(right))
    basis, triangle = np.zeros((most + 1, len(right))), np.zeros((most + 1, most))
    # Rotations that bring the columns to a triangle, and what they leave of the right side.
    cosine, sine, left = np.zeros(most), np.zeros(most), np.zeros(most + 1)
    basis[0], left[0], new = right / size, size, np.empty(len(right))
    for j in range(most):
        np.dot(matrix, basis[j], new)
        for i in range(j + 1):
            triangle[i, j] = dot(basis[i], new)
            add(-triangle[i, j], basis[i], new)
        beyond = math.sqrt(dot(new, new))
        for i in range(j):
            above, below = triangle[i, j], triangle[i + 1, j]
            triangle[i, j], triangle[i + 1, j] = (
                cosine[i] * above + sine[i] * below,
                cosine[i] * below - sine[i] * above,
            )
        turned = math.sqrt(triangle[j, j] ** 2 + beyond**2)
        cosine[j], sine[j], triangle[j, j] = triangle[j, j] / turned, beyond / turned, turned
        left[j], left[j + 1] = cosine[j] * left[j], -sine[j] * left[j]
        if abs(left[j + 1]) <= SOLVED * size:
            for row in range(j, -1, -1):
                known = dot(triangle[row, row + 1 : j + 1], left[row + 1 : j + 1])
                left[row] = (left[row] - known) / triangle[row, row]
            return np.dot(left[: j + 1], basis[: j + 1])
        basis[j + 1] = new / beyond
    return np.linalg.solve(matrix, right)
