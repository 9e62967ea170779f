"""What tests have to show beside passing, printed after them, also when they ran in several processes."""

from __future__ import annotations

from typing import Any

import pytest

TABLE = pytest.StashKey[list[str]]()
_SENT = "table"


@pytest.fixture(scope="session")
def shown(pytestconfig: pytest.Config) -> list[str]:
    """Lines to print at the end."""
    return pytestconfig.stash.setdefault(TABLE, [])


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A process of several hands its lines over."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output[_SENT] = session.config.stash.get(TABLE, [])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Takes the lines of a process that has ended."""
    node.config.stash.setdefault(TABLE, []).extend(getattr(node, "workeroutput", {}).get(_SENT, []))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Prints the table of the hostile DICOM folders."""
    lines = config.stash.get(TABLE, [])
    if lines:
        terminalreporter.section("hostile DICOM folders")
        for line in lines:
            terminalreporter.write_line(line)
