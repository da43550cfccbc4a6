"""The ways a run ends early, each with its exit code."""


class DistfsiError(Exception):
    """Base of all errors a user can meet; `exit_code` is what the process returns."""

    exit_code = 1


class InputError(DistfsiError):
    """The input is wrong. `faults` holds one line per fault, all of them."""

    exit_code = 2

    def __init__(self, faults: list[str]):
        self.faults = list(faults)
        super().__init__("\n".join(self.faults))


class Diverged(DistfsiError):
    """The state became unphysical; the message says where, when and why."""

    exit_code = 3


class StepFailed(Diverged):
    """No attempt at a step has left a valid state; the state before the step is still there."""


class StepTooShort(Diverged):
    """The time step has fallen below what the scene allows; the state before the step is valid."""


class OutputError(DistfsiError):
    """Results could not be written; the message names the file, the cause and the space left. Raised on every rank."""

    exit_code = 74  # EX_IOERR of sysexits.h


class Stopped(DistfsiError):
    """The run was asked to stop early and left a restart file."""

    exit_code = 75
