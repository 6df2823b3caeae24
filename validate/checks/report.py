"""Findings of a check, and warnings that engines print while they load."""

import contextlib
import os
import re
import tempfile
import warnings

# Tolerances of an angle (radians) or a length (metres).
REACHED = {"hinge": 0.5 * 3.141592653589793 / 180.0, "slide": 0.002}
DRIFT = {"hinge": 0.1 * 3.141592653589793 / 180.0, "slide": 0.0005}
PENETRATION = 0.002

_SUSPICIOUS = re.compile(
    r"warn|error|fail|can.?not|could not|invalid|missing|not found|unable|no inertial", re.IGNORECASE
)

# Messages about the machine, which are independent of the file.
_MACHINE = re.compile(r"CUDA|libvulkan", re.IGNORECASE)


class Report:
    """Findings of one engine on one file, in plain data."""

    def __init__(self, engine, file):
        self.engine, self.file = engine, file
        self.findings, self.warnings = [], []
        # The engine is not installed.
        self.absent = False

    def add(self, subject, check, passed, value=None, unit="", note=""):
        """A finding; `passed` of None is for information only."""
        value = None if value is None else float(value)
        passed = None if passed is None else bool(passed)
        finding = dict(subject=subject, check=check, passed=passed, value=value, unit=unit, note=note)
        self.findings.append(finding)

    def data(self):
        """The report as JSON data. A warning of a loader counts as a failure; `passed` is None if no check ran."""
        findings = list(self.findings)
        note = "; ".join(self.warnings)
        findings.insert(
            0, dict(subject="-", check="no warnings", passed=not self.warnings, value=None, unit="", note=note)
        )
        passed = None if self.absent else all(f["passed"] is not False for f in findings)
        return dict(engine=self.engine, file=self.file, passed=passed, findings=findings)


@contextlib.contextmanager
def collect_warnings(report):
    """Adds lines that look like warnings to the report, from all output of Python and native code inside."""
    with tempfile.TemporaryFile() as log, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        kept = [os.dup(1), os.dup(2)]
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        try:
            yield
        finally:
            for target, fd in zip((1, 2), kept):
                os.dup2(fd, target)
                os.close(fd)
            log.seek(0)
            lines = log.read().decode("utf-8", "replace").splitlines()
            printed = [line.strip() for line in lines if _SUSPICIOUS.search(line) and not _MACHINE.search(line)]
            printed += [str(w.message) for w in caught if not issubclass(w.category, DeprecationWarning)]
            report.warnings += [line for i, line in enumerate(printed) if line not in printed[:i]]
