"""Exceptions. Their messages are those of the command; most name arguments in place of options."""


class Error(Exception):
    """Something of artgs failed. `exit_code` is the one that the command ends with."""

    exit_code: int = 1


class InputError(Error, ValueError):
    """The capture, the settings or the arguments have to be changed."""

    exit_code = 2


class RunError(Error, RuntimeError):
    """A run, or reading or writing of its files, failed."""

    exit_code = 1


class CheckError(Error):
    """A check found something wrong."""

    exit_code = 3


class InternalError(Error, RuntimeError):
    """An error in artgs itself; please report the message."""

    exit_code = 70


# Users know them by the name of the package.
for _kind in (Error, InputError, RunError, CheckError, InternalError):
    _kind.__module__ = "artgs"


def of_exit_code(code: int, message: str) -> BaseException:
    """The exception for a command that ended with an exit code."""
    if code == 130:
        return KeyboardInterrupt(message)
    for kind in (InputError, CheckError, InternalError):
        if kind.exit_code == code:
            return kind(message)
    return RunError(message)
