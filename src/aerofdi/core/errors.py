"""Errors a person can act on: who, what was given, what is accepted, next move. exit_code is what the CLI returns."""


class AerofdiError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1


class WrongUse(AerofdiError):
    """Wrong arguments, names, units or values."""

    exit_code = 2


class UnreadableFile(AerofdiError):
    """A file that is missing, empty, truncated, foreign or corrupt."""

    exit_code = 2


class MissingExtra(AerofdiError):
    """A command needs an optional dependency that is not installed."""

    exit_code = 2


class CannotJudge(AerofdiError):
    """The data do not allow a judgement: a missing signal, too little excitation, an inhomogeneous training span."""

    exit_code = 3


class MissingChannel(CannotJudge):
    """A channel is needed by one side and not offered by the other; the message names both."""


class ContractError(AerofdiError):
    """A diagnoser breaks the contract of `check_diagnoser`; the message lists every broken clause."""
