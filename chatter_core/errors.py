"""What can go wrong in the physics, and why."""


class ChatterError(Exception):
    """Base of every error that the physics raises on purpose."""


class InvalidInput(ChatterError):
    """What the user described cannot exist or is out of range.

    ``problems`` holds one complete sentence per finding, so that all are told at once.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = problems
        super().__init__("\n".join(problems))


class OwnLawFails(InvalidInput):
    """A law of the user's own raises, or returns what no chain could use.

    hangs_on_values: whether that may be so at some values of its parameters alone; else its file has a slip.
    """

    def __init__(self, problems: list[str], *, hangs_on_values: bool = True) -> None:
        self.hangs_on_values = hangs_on_values
        super().__init__(problems)


class NoEquilibrium(ChatterError):
    """A bearing has no equilibrium at an operating point, or a ball leaves its race."""


class UnsupportedEquation(ChatterError):
    """A solver was given an equation outside the class that it solves."""


class NotConverged(ChatterError):
    """An iteration ended without meeting its tolerance."""
