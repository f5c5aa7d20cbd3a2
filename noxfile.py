"""Sessions: ``nox -l`` lists them, ``nox -s tests-3.13`` runs one; a Python that is missing is named."""

import nox

PYTHONS = ("3.11", "3.12", "3.13", "3.14")  # from the oldest that we promise to the newest that numba supports
nox.options.sessions = ["lint", "tests"]
nox.options.error_on_missing_interpreters = False
nox.options.reuse_existing_virtualenvs = True


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run the tests, on every Python that is installed."""
    session.install("-e", ".[test]")
    session.run("python", "-m", "pytest", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Check style, types and floors."""
    session.install("-e", ".[lint,test]")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")
    session.run("lint-imports")


@nox.session
def coverage(session: nox.Session) -> None:
    """Report which lines the tests run; kernels run interpreted, or they would not be seen."""
    session.install("-e", ".[test]")
    session.run(
        "python", "-m", "pytest", "-m", "small", "--cov=tilestamp", "--cov-report=term-missing:skip-covered",
        *session.posargs, env={"NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip


@nox.session
def docs(session: nox.Session) -> None:
    """Build the documentation into build/site; TILESTAMP_RESULTS names results whose plots the atlas shows."""
    session.install("-e", ".[docs]")
    session.run("python", "-m", "mkdocs", "build", "--strict", "--site-dir", "build/site")


@nox.session
def benchmarks(session: nox.Session) -> None:
    """Run the benchmarks, add a line each to their history, and plot it."""
    session.install("-e", ".[test]")
    session.run("python", "-m", "tests.benchmarks.history", *session.posargs)
